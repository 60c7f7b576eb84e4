"""The page of the ladder, and its picture."""


def write_page(*_args: object) -> None:
    """Nothing yet."""
