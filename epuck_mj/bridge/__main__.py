"""A policy drives real robots: `python -m epuck_mj.bridge CHAMPION --port PORT`."""

import contextlib
import gc
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from epuck_mj.bridge.drive import log
from epuck_mj.bridge.drive.alone import drive_alone
from epuck_mj.bridge.drive.log import Show
from epuck_mj.bridge.drive.order import Order, champion, mission
from epuck_mj.bridge.failures import RUNAWAY
from epuck_mj.bridge.fleet.fleet_drive import drive_fleet
from epuck_mj.bridge.fleet.members import Member, members_at, read_fleet
from epuck_mj.bridge.line.connect import connect
from epuck_mj.bridge.line.last_resort import leave_to_last_resort
from epuck_mj.bridge.line.serial_port import ports
from epuck_mj.constants import SPEED_MAX
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, pose_flag, word
from epuck_mj.host.limits import check_flag
from epuck_mj.host.output import say
from epuck_mj.policies.wall_follower import YARDSTICK
from epuck_mj.trials.trajectory import Trajectory

MODULE = "epuck_mj.bridge"


EXAMPLES = (
    "python -m epuck_mj.bridge runs/ga-seed-1 --port /dev/rfcomm0",
    "python -m epuck_mj.bridge wall-follower --port COM5 --seconds 20",
    "python -m epuck_mj.bridge --fleet fleet.yaml",
)


@dataclass(frozen=True)
class Options:
    """Let a controller drive a real e-puck, or several, and stop them at the end.

    Attributes:
        champion: directory of a finished run, controller file, or wall-follower, the
            hand-written controller.
        port: port of the robot: /dev/rfcomm0, COM5 or socket://host:port; for an
            e-puck2 over WiFi tcp://host:1000. Repeat it for a fleet of robots.
        fleet: file with the name, port, controller and calibration of several robots.
        seconds: duration of the drive [s].
        calibrate: first let the robot set its sensors' zero; nothing may be near it.
        calibration: file written by python -m epuck_mj.calibrate for this robot.
        pose: start of the robot in the arena of its log: x and y [m] and heading
            [degrees]; if not given, the picture has no walls.
        max_speed: highest speed of a wheel [m/s]; the robot's own limit if not given.
        dry_run: read the sensors and compute commands, but do not move.
        arena: arena to show the log in; if not given, the one the champion evolved in.
        log: name of the log, written as .npz, .rrd and .png, or of a fleet's folder of
            logs; a name in runs/ if not given.
        verbose: add technical details to messages.
        list_ports: list the serial ports of this computer and exit.
    """

    champion: tyro.conf.Positional[Annotated[str, word("RUN")]] = ""
    port: tyro.conf.UseAppendAction[Annotated[tuple[str, ...], word("PORT")]] = ()
    fleet: Annotated[Path | None, word("FILE")] = None
    seconds: Annotated[float, word("SECONDS")] = 60.0
    calibrate: bool = False
    calibration: Annotated[Path | None, word("FILE")] = None
    pose: Annotated[tuple[float, float, float] | None, word("X Y DEGREES")] = None
    max_speed: Annotated[float | None, word("METRES")] = None
    dry_run: bool = False
    arena: Annotated[str | None, word("ARENA")] = None
    log: Annotated[Path | None, word("FILE")] = None
    verbose: bool = False
    list_ports: bool = False


def bridge(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    if options.list_ports:
        for name, description in ports():
            say(f"{name}  {description}")
        return 0
    _refuse_bad_options(options)
    if options.fleet is None and len(options.port) == 1:
        member = Member("", options.port[0], options.champion, _text(options))
        name = log.prepare(log.log_name(options.log))
        return _drive_alone(options, _order(options, member, name))
    members = (
        members_at(options.port, options.champion)
        if options.fleet is None
        else read_fleet(options.fleet)
    )
    return _drive_fleet(options, members)


def _drive_alone(options: Options, order: Order) -> int:
    """Drive one robot on this terminal and return the exit status."""
    wanted, show = mission(order), _show(options, order)
    # no garbage collection of loaded modules, neither during the drive nor at its end
    gc.freeze()
    status = drive_alone(wanted, lambda: connect(order.port), show)
    if status == RUNAWAY:
        leave_to_last_resort(order.port)
    return status


def _drive_fleet(options: Options, members: Sequence[Member]) -> int:
    """Drive robots, each by a process of its own, and return the exit status."""
    folder = log.log_name(options.log, "fleet")
    orders, shows = {}, {}
    for member in members:
        order = _order(options, member, folder / member.name)
        # find errors in the files before a process is started
        try:
            mission(order)
            shows[member.name] = _show(options, order)
        except UserError as error:
            raise UserError(f"robot {member.name}: {error}") from None
        orders[member.name] = order
    for order in orders.values():
        log.prepare(Path(order.log))
    try:
        return drive_fleet(orders, shows)
    finally:
        # the folder is empty if no robot drove
        with contextlib.suppress(OSError):
            folder.rmdir()


def _order(options: Options, member: Member, name: Path) -> Order:
    """What a robot is to do."""
    return Order(
        port=member.port,
        controller=member.controller,
        calibration=member.calibration,
        seconds=options.seconds,
        start=pose_flag(options.pose) or (0.0, 0.0, 0.0),
        max_speed=options.max_speed,
        dry_run=options.dry_run,
        calibrate=options.calibrate,
        log=str(name),
        verbose=options.verbose,
    )


def _show(options: Options, order: Order) -> Show:
    """What writes the pictures of a drive, when the robot stands."""
    # slow to import, and not needed for --help
    from epuck_mj.scene.model import load_scene

    driver = champion(order.controller)
    arena = options.arena or driver.arena
    scene = load_scene(driver.robot, arena, driver.task.control_step)

    def show(name: Path, trajectory: Trajectory, summary: str) -> list[Path]:
        # rerun and matplotlib are slow to import
        from epuck_mj.bridge.drive.pictures import save_pictures

        placed = options.pose is not None
        return save_pictures(name, trajectory, summary, driver.task, scene, placed)

    return show


def _text(options: Options) -> str | None:
    return None if options.calibration is None else str(options.calibration)


def _refuse_bad_options(options: Options) -> None:
    if options.fleet is not None and (options.champion or options.port):
        raise UserError("expected --fleet alone: its file has controllers and ports")
    if options.fleet is None and not options.champion:
        raise UserError(
            "expected the directory of a finished run, a controller file, "
            f"{YARDSTICK}, or --fleet"
        )
    if options.fleet is None and not options.port:
        raise UserError("expected --port; --list-ports lists the ports there are")
    if options.fleet is not None or len(options.port) > 1:
        for flag, value in (
            ("calibration", options.calibration),
            ("pose", options.pose),
        ):
            if value is not None:
                raise UserError(
                    f"expected --{flag} with one robot; robots of a fleet differ"
                )
    check_flag("seconds", options.seconds)
    if options.max_speed is not None and not 0 < options.max_speed <= SPEED_MAX:
        raise UserError(
            f"expected --max-speed above 0, up to {SPEED_MAX:.4f} m/s, "
            f"got {options.max_speed}"
        )
    pose_flag(options.pose)


if __name__ == "__main__":
    main(bridge)
