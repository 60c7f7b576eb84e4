"""Files: found, read, and written in full or not at all."""

import os
from pathlib import Path

import pytest

from epuck_mj.errors import UserError
from epuck_mj.host import files


class StopError(BaseException):
    """A signal, at the worst of moments."""


def test_a_signal_right_after_a_file_was_made_leaves_nothing(tmp_path, monkeypatch):
    path = tmp_path / "history.csv"
    path.write_text("old")
    made, opened = [], Path.open

    def interrupted(self, mode):
        opened(self, mode).close()
        made.append(self)
        raise StopError

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", interrupted)
        with pytest.raises(StopError):
            files.write_text(path, "new")
    assert files.is_leftover(made[0])
    assert [each.name for each in tmp_path.iterdir()] == ["history.csv"]
    assert path.read_text() == "old"


def test_what_is_no_file_s_name_fails_as_the_system_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OSError, match=r"busy|directory"):
        files.write_text(Path(), "new")
    assert not [*tmp_path.iterdir()]


def test_leftovers_are_ours_alone(tmp_path):
    mine = [".vscode-settings", ".my-settings", ".a-12345678", "a-12345678.tmp"]
    for name in (*mine, ".history.csv-0a1b2c3d.tmp"):
        (tmp_path / name).write_text("")
    files.remove_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(mine)


@pytest.mark.parametrize("name", ["no/such/a.csv", "taken/a.csv", "folder"])
def test_what_cannot_be_written_is_named_as_it_was_asked_for(name, tmp_path):
    (tmp_path / "taken").write_text("")
    (tmp_path / "folder").mkdir()
    path = tmp_path / name
    with pytest.raises(UserError) as error, files.writing():
        files.write_text(path, "new")
    assert str(error.value).startswith(f"cannot write '{path}': ")
    assert not [each for each in tmp_path.iterdir() if files.is_leftover(each)]


def test_a_file_is_found_by_name_or_path(tmp_path):
    mine, shipped = tmp_path / "mine.xml", tmp_path / "round.xml"
    mine.write_text("")
    shipped.write_text("")

    def found(name):
        return files.find(name, "arena", {"round": shipped}, "an MJCF")

    assert found("round") == shipped
    assert found(str(mine)) == mine
    for name in ("square", str(tmp_path), "", "a" * 300, "\0"):
        with pytest.raises(UserError) as error:
            found(name)
        assert str(error.value) == (
            f"no arena '{name}': expected the path of an MJCF file or one of round"
        )


@pytest.mark.parametrize("name", ["nobody", ".", "a" * 300, "\0", "binary"])
def test_what_cannot_be_read_is_one_line(name, tmp_path):
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match="cannot read '") as error:
        files.read_text(tmp_path / name)
    assert "\n" not in str(error.value)
    assert "None" not in str(error.value)


def test_pipes_and_devices_are_refused_and_stay(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(UserError, match="pipe': it is a pipe or a device, no file"):
        files.check_writable(pipe)
    with pytest.raises(OSError, match="no file") as error:
        files.write_text(pipe, "new")
    assert error.value.filename == str(pipe)
    assert pipe.is_fifo()
    assert [each.name for each in tmp_path.iterdir()] == ["pipe"]


def test_what_a_link_names_is_replaced_and_the_link_stays(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    files.write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
