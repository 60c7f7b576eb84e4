"""Connecting to a robot by the port's name: a serial line, or WiFi of an e-puck2."""

from urllib.parse import urlsplit

from epuck_mj.bridge.language import ascii
from epuck_mj.bridge.language.packets import wifi_command
from epuck_mj.bridge.language.protocol import RESYNC
from epuck_mj.bridge.line.interfaces import Connection
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.bridge.line.serial_port import SerialPort
from epuck_mj.bridge.line.wifi_line import WifiLine
from epuck_mj.constants import WIFI_PORT
from epuck_mj.errors import UserError

WIFI_SCHEME = "tcp://"
"""Beginning of the port name of a robot on WiFi."""


def connect(port: str) -> Connection:
    """A connection to the robot at a port; nothing is opened yet.

    Args:
        port: `/dev/rfcomm0`, `COM5`, `socket://host:port`, or `tcp://host[:port]`.

    Raises:
        UserError: if it is no address.
    """
    if port.startswith(WIFI_SCHEME):
        name = f"socket://{port.removeprefix(WIFI_SCHEME)}"
        try:
            address = urlsplit(name).netloc
        except ValueError as error:
            raise UserError(
                f"expected {WIFI_SCHEME}host[:port], got '{port}': {error}"
            ) from None
        if not address.rpartition("]")[2].count(":"):
            name += f":{WIFI_PORT}"
        return WifiLine(lambda: SerialPort(name, wifi_command(0, 0)))
    farewell = RESYNC.flush + ascii.stop_order().out
    return SerialLine(Link(lambda: SerialPort(port, farewell)))
