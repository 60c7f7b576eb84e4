"""What this computer lacks, in one line: memory, room on a disk, a file, letters.

Only what every Python has is imported: this is there before all else is loaded.
"""

import os

NO_MEMORY = (
    # MuJoCo
    "Could not allocate memory",
    # libraries that are loaded
    "Cannot allocate memory",
    "cannot allocate memory",
    "failed to map segment",
    "std::bad_alloc",
    # threads need a stack
    "can't start new thread",
)
"""What libraries say when there is no memory, whatever they raise."""


def hardship(error: BaseException) -> str | None:
    """What the computer lacked, in one line; None if the program itself is at fault."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) or any(part in text for part in NO_MEMORY):
        return f"not enough memory: {text}" if text else "not enough memory"
    if isinstance(error, OSError):
        name = error.filename2 or error.filename
        reason = error.strerror or text or type(error).__name__
        return reason if name is None else f"'{os.fsdecode(name)}': {reason}"
    if isinstance(error, UnicodeEncodeError):
        part = error.object[error.start : error.end]
        return f"cannot be written as {error.encoding}: {part!a}"
    return None
