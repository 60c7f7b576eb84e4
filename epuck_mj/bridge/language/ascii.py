r"""The e-puck's ASCII dialect: a letter and operands, ended by one `\r`.

The reply is a line: the letter in lower case, values, `\r\n`. It is recognised by its
letter, the number of its values and their ranges, at the end of any line, so that
an incomplete line before it does no harm. An acknowledgement is a whole line.

Not recognisable: a digit lost or changed, and a reply to an earlier, equal request.

Source: gctronic/e-puck-library, `Asercom.c` and `BTcom.c`; GCtronic's wiki, "Advanced
sercom protocol".
"""

import re

from epuck_mj.bridge.failures import BridgeError
from epuck_mj.bridge.language.parsing import Line, LinesParser, Request
from epuck_mj.bridge.language.replies import Acknowledged, Battery, Version
from epuck_mj.constants import CALIBRATION_TIME_MAX, REPLY_TIME_MAX, STEP_RATE_MAX


def version_query() -> Request[Version]:
    """V, and E to mark its end: some robots answer V in one line, some in two.

    `v,` comes from nothing else, so once it came everything older is over: this is the
    barrier behind which the robot is in step again.
    """
    version = re.compile(rb"(?<![A-Za-z])v,Version [ -~]+\r\Z")
    speeds = re.compile(rb"(?<![A-Za-z])e(?:,-?\d{1,5}){2}\r\Z")
    lines = (
        Line(version, b"v,", "a version line 'v,Version ...'"),
        Line(speeds, b"e,", "'e' and 2 integers"),
    )

    def reply(heard: list[bytes]) -> Version:
        texts = [line.decode("ascii", "replace").strip() for line in heard[:-1]]
        hardware = [text for text in texts[1:] if text.startswith("HW version")]
        return Version((texts[0][texts[0].index("v,") + 2 :], *hardware))

    return Request("V (version)", b"V\rE\r", lambda: LinesParser(lines, reply))


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


def stop_order() -> Request[Acknowledged]:
    """S: the motors stop, the ring's LEDs go out."""
    line = Line(re.compile(rb"\As\r\Z"), None, "'s'")
    return Request("S (stop)", b"S\r", lambda: LinesParser((line,), _acknowledged))


def calibration_order() -> Request[Acknowledged]:
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
        lambda: LinesParser(lines, _acknowledged),
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


def _acknowledged(_: list[bytes]) -> Acknowledged:
    return Acknowledged()
