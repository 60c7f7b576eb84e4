"""Files: found, read, and written in full or not at all."""

import os
import zipfile
from pathlib import Path

import numpy as np
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
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
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


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "cp1252", "utf-16", "ascii"])
def test_an_xml_file_is_read_in_the_encoding_that_it_declares(encoding, tmp_path):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<a>e</a>'
    text = text if encoding == "ascii" else text.replace("e<", "ä<")
    path = tmp_path / "a.xml"
    path.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    assert files.read_text(path) == text


@pytest.mark.parametrize("encoding", ["nope", "hex", "utf-7", "undefined"])
def test_an_encoding_of_no_text_is_one_line(encoding, tmp_path):
    path = tmp_path / "a.xml"
    path.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?>+2AA-'.encode())
    with pytest.raises(UserError, match="cannot read '") as error:
        files.read_text(path)
    assert "\n" not in str(error.value)


def test_pipes_and_devices_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(UserError, match="it is a pipe or a device, no file"):
            files.read_text(path)
        with pytest.raises(UserError, match="it is a pipe or a device, no file"):
            files.read_arrays(path)


def test_what_is_too_large_on_disk_is_not_read(tmp_path):
    path = tmp_path / "a"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(UserError, match=r"at most 16 MB, got 1000000\.0 MB"):
        files.read_text(path)
    with pytest.raises(UserError, match="at most 1000 MB"):
        files.read_arrays(path)


def npz(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


def npy(descr: str, shape: str) -> bytes:
    """The bytes of an array whose header promises that, but for what it holds."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n"
    size = len(header).to_bytes(2, "little")
    return b"\x93NUMPY\x01\x00" + size + header.encode() + bytes(80)


@pytest.mark.parametrize(
    ("descr", "shape"),
    [
        ("'<f8'", "(10000000000000,)"),
        ("'<f8'", "(99999999999999999999,)"),
        ("'<f8'", "(-1,)"),
        ("'<f8'", "'a'"),
        ("'|O'", "(1,)"),
        ("'<M8[s]'", "(10,)"),
        ("[('a', '<f8')]", "(10,)"),
        ("'?", "(3,)"),
    ],
)
def test_a_header_that_promises_anything_else_is_refused(descr, shape, tmp_path):
    path = npz(tmp_path / "a.npz", a=npy(descr, shape))
    with pytest.raises(UserError, match="cannot read '") as error:
        files.read_arrays(path)
    assert "\n" not in str(error.value)


def test_arrays_of_two_gigabytes_are_not_unpacked(tmp_path):
    """2 GB in 40 bytes, as the directory of the archive says."""
    path = npz(tmp_path / "a.npz", a=npy("'<f8'", "(10,)"))
    content = bytearray(path.read_bytes())
    directory = content.index(b"PK\x01\x02")
    content[directory + 24 : directory + 28] = (2 * 10**9).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(UserError, match="at most 1000 arrays of 1000 MB altogether"):
        files.read_arrays(path)


@pytest.mark.parametrize("pack", [np.savez, np.savez_compressed])
def test_damaged_arrays_are_one_line(pack, tmp_path):
    path = tmp_path / "a.npz"
    pack(path, a=np.arange(50.0), b=np.array("text"), c=np.zeros((3, 4), bool))
    sound, rng = path.read_bytes(), np.random.default_rng(0)
    for _ in range(300):
        content = bytearray(sound)
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        path.write_bytes(content)
        try:
            files.read_arrays(path)
        except UserError as error:
            assert str(path) in str(error)
            assert "\n" not in str(error)
