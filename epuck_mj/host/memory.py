"""Memory of this computer, and the refusal of what needs more of it."""

import os

from epuck_mj.errors import UserError

UNKNOWN = 16 * 10**9
"""Memory of a computer that does not say [bytes]."""

TRACK_BYTES = 350
"""Bytes that a control step of a trial takes whose track is kept, with its noise."""

TRAJECTORY_BYTES = 1000
"""Bytes that a control step of a trial takes of which everything is kept."""


def memory() -> int:
    """Memory of this computer [bytes]."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        # Windows
        return UNKNOWN


def check_memory(what: str, size: float) -> None:
    """Refuse what needs more memory than this computer has.

    Args:
        what: needs it: the keys, or numbers of things.
        size: [bytes].

    Raises:
        UserError: if it is too much.
    """
    if size > memory():
        raise UserError(
            f"{what} needs about {size / 1e9:,.1f} GB of memory, and this computer has "
            f"{memory() / 1e9:,.1f} GB"
        )
