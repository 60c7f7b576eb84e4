"""Files that are there in full or not at all."""

from pathlib import Path

import pytest

from epuck_mj import files


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
