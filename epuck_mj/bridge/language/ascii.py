r"""The e-puck's ASCII dialect: a letter and operands, ended by one `\r`.

The reply is a line: the letter in lower case, values, `\r\n`. It is recognised by its
letter, the number of its values and their ranges, wherever it ends a line, so that
half a line before it does no harm. A bare acknowledgement is a line of its own.

Not recognisable: a digit lost or changed, and a reply to an earlier, equal request.

Source: gctronic/e-puck-library, `Asercom.c` and `BTcom.c`; GCtronic's wiki, "Advanced
sercom protocol".
"""

import re
from collections.abc import Callable

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.bridge.language.parsing import GREETING, Line, LinesParser, Request, T
from epuck_mj.bridge.language.replies import (
    Acknowledged,
    Ambient,
    Battery,
    Calibrated,
    CommandedSpeeds,
    Proximity,
    Restarted,
    Steps,
    Version,
)
from epuck_mj.constants import (
    CALIBRATION_TIME_MAX,
    N_LEDS,
    N_PROXIMITY,
    REPLY_TIME_MAX,
    STEP_RATE_MAX,
)

ALL_LEDS = N_LEDS
"""Number that stands for all LEDs of the ring."""

LED_OFF, LED_ON, LED_TOGGLED = range(3)
"""What an LED can be told."""


def version_query() -> Request[Version]:
    """V, and E to mark its end: some robots answer V in one line, some in two.

    `v,` comes from nothing else, so once it came everything older is over: this is the
    barrier behind which the robot is in step again.
    """
    pattern = re.compile(rb"(?<![A-Za-z])v,Version [ -~]+\r\Z")
    first = Line(pattern, b"v,", "a version line 'v,Version ...'")

    def reply(heard: list[bytes]) -> Version:
        texts = [line.decode("ascii", "replace").strip() for line in heard[:-1]]
        hardware = [text for text in texts[1:] if text.startswith("HW version")]
        return Version((texts[0][texts[0].index("v,") + 2 :], *hardware))

    return Request(
        "V (version)", b"V\rE\r", lambda: LinesParser((first, _values("e", 2)), reply)
    )


def battery_query() -> Request[Battery]:
    """b: the battery, of Asercom only; others do not understand, or toggle an LED."""
    line = Line(
        re.compile(rb"\Ab,(\d{1,5}(?: \(\d{1,3}%\))?)\r\Z"), b"b,", "'b,' and its state"
    )

    def reply(heard: list[bytes]) -> Battery:
        found = line.pattern.search(heard[-1])
        assert found
        return Battery(found[1].decode())

    return Request("b (battery)", b"b\r", lambda: LinesParser((line,), reply))


def proximity_query() -> Request[Proximity]:
    """N: the proximity counts, of the sensors as calibrated last."""
    return _query("n", "N (proximity)", N_PROXIMITY, lambda *v: Proximity(v))


def ambient_query() -> Request[Ambient]:
    """O: the ambient light counts."""
    return _query("o", "O (ambient light)", N_PROXIMITY, lambda *v: Ambient(v))


def steps_query() -> Request[Steps]:
    """Q: the step counters."""
    return _query("q", "Q (step counters)", 2, Steps)


def speeds_query() -> Request[CommandedSpeeds]:
    """E: the speeds last commanded."""
    return _query("e", "E (commanded speeds)", 2, CommandedSpeeds)


def drive_order(left: int, right: int) -> Request[Acknowledged]:
    """D: both motors' speeds from now on, even when the link is lost.

    To be sent when they change: an e-puck v1 loses up to half a step each time it
    hears the same again.

    Args:
        left: of the left motor [steps/s].
        right: of the right motor [steps/s].

    Raises:
        BridgeError: beyond +-1000, where the robot would saturate in silence.
    """
    refuse_fast_speeds(left, right)
    return _order("d", "D (speeds)", f"D,{left:d},{right:d}")


def stop_order() -> Request[Acknowledged]:
    """S: the motors stop, the ring's LEDs go out."""
    return _order("s", "S (stop)", "S")


def led_order(number: int, value: int) -> Request[Acknowledged]:
    """L: one LED of the ring, or all.

    Args:
        number: 0, in front, to 7, clockwise; or ALL_LEDS.
        value: LED_OFF, LED_ON or LED_TOGGLED.

    Raises:
        BridgeError: if there is no such LED or value.
    """
    if not 0 <= number <= ALL_LEDS or not LED_OFF <= value <= LED_TOGGLED:
        raise BridgeError(
            f"an LED from 0 to {N_LEDS - 1} or {ALL_LEDS} for all, and 0, 1 or 2",
            f"LED {number} and {value}",
        )
    return _order("l", "L (LED)", f"L,{number:d},{value:d}")


def calibration_order() -> Request[Calibrated]:
    """K: the sensors' offsets are measured anew; nothing may be in their range.

    Meanwhile the robot handles no commands, and its motors continue.
    """
    lines = (
        Line(re.compile(rb"k, Starting calibration[ -~]*\r\Z"), None, "'k, Starting'"),
        Line(re.compile(rb"k, Calibration finished\r\Z"), None, "'k, Calibration'"),
    )
    return Request(
        "K (calibration)",
        b"K\r",
        lambda: LinesParser(lines, lambda _: Calibrated()),
        REPLY_TIME_MAX + CALIBRATION_TIME_MAX,
    )


def reset_order() -> Request[Restarted]:
    """R: the robot starts anew, with its banner. An e-puck2 does not answer.

    A robot that calibrates itself as it starts takes that time, too. More text may
    follow the banner: drop everything until it is quiet.
    """
    return Request(
        "R (reset)",
        b"R\r",
        lambda: LinesParser((GREETING,), lambda _: Restarted()),
        REPLY_TIME_MAX + CALIBRATION_TIME_MAX,
    )


def refuse_fast_speeds(left: int, right: int) -> None:
    """Refuse speeds that the robot would silently make smaller.

    Raises:
        BridgeError: beyond +-1000 steps/s.
    """
    if max(abs(left), abs(right)) > STEP_RATE_MAX:
        raise BridgeError(
            f"wheel speeds within +-{STEP_RATE_MAX} steps/s", f"{left} and {right}"
        )


def _values(letter: str, n_values: int) -> Line:
    """A line that ends in a letter, with no other before it, and integers."""
    pattern = rb"(?<![A-Za-z])%b((?:,-?\d{1,5}){%d})\r\Z" % (letter.encode(), n_values)
    what = f"'{letter}' and {n_values} integers"
    return Line(re.compile(pattern), f"{letter},".encode(), what)


def _query(
    letter: str, name: str, n_values: int, reply: Callable[..., T]
) -> Request[T]:
    line = _values(letter, n_values)

    def read(heard: list[bytes]) -> T:
        found = line.pattern.search(heard[-1])
        assert found
        return reply(*(int(value) for value in found[1].split(b",")[1:]))

    out = letter.upper().encode() + b"\r"
    return Request(name, out, lambda: LinesParser((line,), read))


def _order(letter: str, name: str, text: str) -> Request[Acknowledged]:
    line = Line(re.compile(rb"\A%b\r\Z" % letter.encode()), None, f"'{letter}'")
    reply = Acknowledged(letter)
    out = text.encode() + b"\r"
    return Request(name, out, lambda: LinesParser((line,), lambda _: reply))
