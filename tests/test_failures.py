"""Messages of failures: what happened, what was done, what to try; details if asked."""

import pytest

from epuck_mj.bridge import failures
from epuck_mj.bridge.failures import (
    STOPPED,
    BridgeError,
    LinkLost,
    StaleReading,
    StillMoving,
    told,
    told_of_runaway,
)
from epuck_mj.errors import UserError


def kinds(kind: type[BridgeError] = BridgeError) -> list[type[BridgeError]]:
    below = [each for child in kind.__subclasses__() for each in kinds(child)]
    return [kind, *(each for each in below if each.__module__ == failures.__name__)]


@pytest.mark.parametrize("kind", kinds())
def test_every_failure_says_what_happened_and_what_to_try(kind):
    error = kind("a", b"b")
    assert str(error) == "expected a; got b'b'"
    text = told(error, verbose=False, done=STOPPED)
    happened, done, advice = text.partition(", so it was stopped and stands still. ")
    assert done
    assert happened.startswith(("the robot ", "the connection ", "this computer "))
    assert advice.endswith((".", "?"))
    assert "expected" not in text
    assert told(error, verbose=True, done=STOPPED) == f"{text} Details: {error}"


def test_no_two_failures_have_the_same_words():
    assert len({kind.happened for kind in kinds()}) == len(kinds())


def test_a_robot_that_did_not_answer():
    error = StaleReading("a reading every 300 ms", "none")
    assert told(error, verbose=False, done=STOPPED) == (
        "the robot did not answer for 0.3 s, so it was stopped and stands still. "
        "Is it near enough? Is another program using it?"
    )


def test_other_mistakes_say_it_themselves():
    assert told(UserError("no port 'x'"), verbose=True) == "no port 'x'"


def test_a_runaway_says_what_came_before():
    lost = LinkLost("a robot at 'x'", "nobody")
    with pytest.raises(StillMoving) as caught:
        try:
            raise lost
        except LinkLost:
            raise StillMoving("a stop", "none")  # noqa: B904
    warning = (
        "THE MOTORS MAY STILL TURN, switch the robot off: the robot did not confirm "
        "that it stopped; before that, the connection to the robot was lost."
    )
    assert told_of_runaway(caught.value, verbose=False) == warning
    assert told_of_runaway(caught.value, verbose=True) == (
        f"{warning} Details: expected a stop; got none; at first: {lost}"
    )
    alone = told_of_runaway(StillMoving("a stop", "none"), verbose=False)
    assert alone == f"{warning.partition(';')[0]}."
