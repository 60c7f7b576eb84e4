"""What a user is told who is refused."""

from collections.abc import Callable
from typing import Any

import pytest

from epuck_mj.errors import UserError


def refused(act: Callable[..., Any], *arguments: Any) -> str:
    """The one line that a user gets."""
    with pytest.raises(UserError) as info:
        act(*arguments)
    message = str(info.value)
    assert message.strip()
    assert "\n" not in message
    return message
