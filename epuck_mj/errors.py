"""The exception for everything that a user can correct."""


class UserError(Exception):
    """Bad input; the message says what was expected, what came, what is available.

    Command lines print it as one line and end with exit status 2.
    """
