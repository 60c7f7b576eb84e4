"""Ports of pyserial, which may fail at any time."""

import contextlib
import errno

import serial
from serial.tools import list_ports

from epuck_mj.bridge.failures import LinkLost
from epuck_mj.bridge.line import guardian
from epuck_mj.bridge.line.interfaces import POLL_TIME, READ_MAX, WRITE_TIME_MAX
from epuck_mj.constants import BAUD_RATE
from epuck_mj.errors import UserError


class SerialPort:
    """A port of pyserial: `/dev/rfcomm0` or `COM5`."""

    def __init__(self, name: str, farewell: bytes = b"") -> None:
        """Open the port for this process only.

        Args:
            name: of the port.
            farewell: bytes that a guardian sends if this process dies with the port
                open; nothing needs none. Not all ports can have one.

        Raises:
            UserError: if that is not possible; says why.
        """
        self.name = name
        try:
            self._serial = serial.serial_for_url(
                name,
                baudrate=BAUD_RATE,
                timeout=POLL_TIME,
                write_timeout=WRITE_TIME_MAX,
                exclusive=True,
            )
        # termios.error is no OSError
        except Exception as error:
            raise UserError(_why(name, error)) from None
        self._guardian = None
        try:
            self._guardian = guardian.hire(self._serial.fileno, farewell)
        except OSError as error:
            self.close()
            raise UserError(guardian.missing(name, error)) from None

    def send(self, data: bytes) -> None:
        """See Port."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise self._lost(error) from None

    def receive(self, timeout: float) -> bytes:
        """See Port; a wait is at most POLL_TIME long, whatever the timeout."""
        try:
            # pyserial waits for as many bytes as one asks for
            data = self._serial.read(1) if timeout > 0 else b""
            if n_waiting := self._serial.in_waiting:
                data += self._serial.read(min(n_waiting, READ_MAX))
        except (OSError, TypeError, ValueError) as error:
            raise self._lost(error) from None
        return bytes(data)

    def close(self) -> None:
        """See Port."""
        guardian.dismiss(self._guardian)
        with contextlib.suppress(OSError):
            self._serial.close()

    def _lost(self, error: Exception) -> LinkLost:
        return LinkLost(f"a robot at '{self.name}'", f"'{_one_line(error)}'")


def ports() -> list[tuple[str, str]]:
    """The serial ports of this machine: name and description."""
    return sorted((port.device, port.description) for port in list_ports.comports())


def _why(name: str, error: Exception) -> str:
    """Why a port cannot be opened, on one line."""
    # pyserial wraps most errors, sometimes in the text only
    number = getattr(error, "errno", None)
    reason = _one_line(error)
    if number == errno.ENOENT or isinstance(error, FileNotFoundError):
        names = ", ".join(port for port, _ in ports()) or "none"
        advice = "Is the robot switched on and paired?"
        return f"no port '{name}'; available: {names}. {advice}"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"permission denied for port '{name}': its group, often dialout, may use "
            "it. Join that group (sudo usermod -aG dialout $USER), then log in again"
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in reason:
        return (
            f"port '{name}' is busy: another program has it. Close that program, or "
            "wait a minute: some systems try a new port for themselves"
        )
    if "Inappropriate ioctl" in reason or number in (errno.EISDIR, errno.ENOTTY):
        return f"'{name}' is not a serial port; --list-ports lists the ports there are"
    return f"cannot open port '{name}': {reason}. Is the robot on and near enough?"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
