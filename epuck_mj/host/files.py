"""Files: found, read, and written in full or not at all."""

import codecs
import errno
import io
import os
import re
import secrets
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from epuck_mj.errors import UserError

TEMPORARY = ".tmp"
"""Ending of the names of files that are being written."""

NO_FILE = "it is a pipe or a device, no file"


def write_bytes(path: Path, content: bytes) -> None:
    """Replace `path` by `content`; readers see the old file or the new one.

    A link stays one, and what it names is replaced; pipes and devices are refused.
    """
    asked, path = path, path.resolve() if path.is_symlink() else path
    # named before it exists, so that a signal at any time can remove it
    temporary = _temporary(path)
    try:
        if _is_special(path):
            raise OSError(errno.EINVAL, NO_FILE)
        try:
            with temporary.open("xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        # the user does not know the temporary file
        error.filename, error.filename2 = str(asked), None
        raise


def _is_special(path: Path) -> bool:
    """Whether a path is neither a file nor a folder, but exists."""
    return path.exists() and not path.is_file() and not path.is_dir()


def write_text(path: Path, content: str) -> None:
    """Replace `path` by `content` in UTF-8."""
    write_bytes(path, content.encode())


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Replace `path` by an .npz of `arrays`; equal arrays make equal files."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_bytes(path, buffer.getvalue())


def is_file(path: Path) -> bool:
    """Whether a file exists; False for what cannot be a file's name."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_directory(path: Path) -> bool:
    """Whether a directory exists; False for what cannot be a directory's name."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def find(name: str, kind: str, shipped: Mapping[str, Path], form: str) -> Path:
    """The file that a name or a path means.

    Args:
        name: of a shipped file, or the path of a person's own.
        kind: what it is.
        shipped: files by name.
        form: of its text, with an article: `a YAML`.

    Raises:
        UserError: if there is none.
    """
    path = shipped.get(name, Path(name))
    if is_file(path):
        return path
    raise UserError(
        f"no {kind} '{name}': expected the path of {form} file or one of "
        + ", ".join(shipped)
    )


@contextmanager
def writing() -> Iterator[None]:
    """Turn errors of writing in the block into UserError.

    Raises:
        UserError: naming the file, if the system does.
    """
    try:
        yield
    except OSError as error:
        name = error.filename2 or error.filename
        what = "cannot write" if name is None else f"cannot write '{name}'"
        raise UserError(f"{what}: {error.strerror or error}") from None


def check_writable(path: Path) -> None:
    """Refuse a path where no file can be written, before the work is done.

    Raises:
        UserError: for such a path.
    """
    if is_directory(path):
        raise UserError(f"cannot write '{path}': it is a folder")
    if _is_special(path):
        raise UserError(f"cannot write '{path}': {NO_FILE}")
    if not is_directory(path.parent):
        raise UserError(f"cannot write '{path}': no folder '{path.parent}'")
    probe = _temporary(path)
    try:
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise UserError(f"cannot write '{path}': {error.strerror}") from None


def leftovers(folder: Path) -> list[Path]:
    """Temporary files of writers that were killed."""
    return [path for path in folder.iterdir() if is_leftover(path)]


def is_leftover(path: Path) -> bool:
    """Whether a path is the temporary file of a writer."""
    return path.match(f".*-????????{TEMPORARY}")


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of writers that were killed."""
    for path in leftovers(folder):
        path.unlink(missing_ok=True)


def read_bytes(path: Path, most: int) -> bytes:
    """The bytes of a file, which is not read if it is larger than `most` bytes.

    Raises:
        UserError: if it is missing, not to be read, too large, or no file.
    """
    try:
        # opening a pipe would wait for its other end
        if _is_special(path):
            raise OSError(errno.EINVAL, NO_FILE)
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size <= most:
                return file.read()
    except OSError as error:
        raise UserError(f"cannot read '{path}': {error.strerror}") from None
    except ValueError as error:
        # no name for a file
        raise UserError(f"cannot read '{path}': {error}") from None
    sizes = f"at most {most / 1e6:g} MB, got {size / 1e6:.1f} MB"
    raise UserError(f"cannot read '{path}': expected {sizes}")


def read_text(path: Path, most: int = 16_000_000) -> str:
    """The text of a file of at most `most` bytes, with newlines as python has them.

    It is UTF-8, or UTF-16 if it begins with that byte order mark. What begins as an
    XML file may declare another encoding.

    Raises:
        UserError: if it is missing, not to be read, too large, or of another encoding.
    """
    content = read_bytes(path, most)
    try:
        with io.TextIOWrapper(io.BytesIO(content), _encoding(content)) as file:
            text = file.read()
        # halves of characters, which a few encodings can write
        text.encode()
    except (ValueError, LookupError) as error:
        raise UserError(f"cannot read '{path}': {error}") from None
    return text


def _encoding(content: bytes) -> str:
    """The encoding of a text, as its first bytes say."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    declared = XML_DECLARATION.match(content)
    # with a byte order mark, or without
    return declared[1].decode() if declared else "utf-8-sig"


XML_DECLARATION = re.compile(
    rb"""<\?xml\s[^>]*?encoding\s*=\s*["']([\w.:-]+)["']""", re.ASCII
)


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file.

    Raises:
        UserError: if it is missing, truncated, too large, or something else.
    """
    # in memory: np.load leaves a damaged archive open
    content = read_bytes(path, ARRAYS_MAX)
    # numpy takes anything else for a pickle
    if not content.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        raise UserError(f"cannot read '{path}': expected an .npz archive")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
        size = sum(member.file_size for member in members)
        if size > ARRAYS_MAX or len(members) > MEMBERS_MAX:
            raise ValueError(
                f"expected at most {MEMBERS_MAX} arrays of {ARRAYS_MAX / 1e6:g} MB "
                f"altogether, got {len(members)} of {size / 1e6:.0f} MB"
            )
        with (
            warnings.catch_warnings(action="error"),
            np.load(io.BytesIO(content), allow_pickle=False) as file,
        ):
            arrays = dict(file)
        for name, array in arrays.items():
            if array.dtype.kind not in "biufU":
                raise ValueError(f"expected numbers or texts as {name}")
    # zipfile, zlib and numpy raise a dozen kinds for damaged archives
    except Exception as error:
        reason = " ".join(str(error).split())
        raise UserError(f"cannot read '{path}': {reason}") from None
    return arrays


ARRAYS_MAX = 1_000_000_000
"""Most bytes of the arrays of a file, unpacked."""

MEMBERS_MAX = 1000
"""Most arrays of a file."""


def _temporary(path: Path) -> Path:
    """The name of a new file beside `path`."""
    # "." has no name to replace
    return path.parent / f".{path.name}-{secrets.token_hex(4)}{TEMPORARY}"
