"""The one exception for what a user can put right."""


class UserError(Exception):
    """Bad input: says what was expected, what came and what is available.

    Command lines print it as one line and end with exit status 2.
    """
