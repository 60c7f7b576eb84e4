"""Connecting to a robot by the port's name: a serial line, or WiFi of an e-puck2."""

import re

from epuck_mj.bridge.language import ascii
from epuck_mj.bridge.language.packets import wifi_command
from epuck_mj.bridge.language.protocol import RESYNC
from epuck_mj.bridge.line.interfaces import Connection, Port
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.bridge.line.serial_port import SerialPort
from epuck_mj.bridge.line.socket_port import SocketPort
from epuck_mj.bridge.line.wifi_line import WifiLine
from epuck_mj.constants import WIFI_PORT
from epuck_mj.errors import UserError

WIFI_SCHEME = "tcp://"
"""Beginning of the port name of a robot on WiFi."""

SOCKET_SCHEME = "socket://"
"""Beginning of the port name of a serial line on TCP."""

ADDRESS = re.compile(r"(\[[^]/@]+\]|[^]\[/@:?#\s]+)(?::([0-9]{1,5}))?/?")
"""A host, and a port if there is one; IPv6 addresses are in brackets."""

PORT_MAX = 65_535
"""Highest number of a TCP port."""


def connect(port: str) -> Connection:
    """A connection to the robot at a port, which is open.

    Args:
        port: `/dev/rfcomm0`, `COM5`, `socket://host:port`, or `tcp://host[:port]`.

    Raises:
        UserError: if it is no address, or cannot be opened.
    """
    if port.startswith(WIFI_SCHEME):
        return WifiLine(lambda: open_port(port, wifi_command(0, 0)))
    farewell = RESYNC.flush + ascii.stop_order().out
    return SerialLine(Link(lambda: open_port(port, farewell)))


def open_port(name: str, farewell: bytes = b"") -> Port:
    """An open port.

    Args:
        name: as for `connect`.
        farewell: bytes that a guardian sends if this process dies with the port open;
            nothing needs none. Not all ports can have one.

    Raises:
        UserError: if it is no address, or cannot be opened.
    """
    for scheme, default in ((WIFI_SCHEME, WIFI_PORT), (SOCKET_SCHEME, None)):
        if name.startswith(scheme):
            return SocketPort(name, *_address(name, scheme, default), farewell)
    return SerialPort(name, farewell)


def _address(name: str, scheme: str, default: int | None) -> tuple[str, int]:
    """Host and port of a name that begins with a scheme.

    Raises:
        UserError: if that is not all that it has.
    """
    found = ADDRESS.fullmatch(name.removeprefix(scheme))
    number = int(found[2] or default or 0) if found else 0
    if not found or not 1 <= number <= PORT_MAX:
        form = f"{scheme}host:port" if default is None else f"{scheme}host[:port]"
        raise UserError(
            f"expected {form} with a port from 1 to {PORT_MAX}, got '{name}'"
        )
    return found[1].strip("[]"), number
