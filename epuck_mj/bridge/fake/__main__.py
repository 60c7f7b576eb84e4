"""An emulated e-puck to try the bridge on: `python -m epuck_mj.bridge.fake`."""

import math
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from epuck_mj.bridge.fake.scenarios import random_scenario, scenario
from epuck_mj.errors import UserError
from epuck_mj.host.command_line import main, parse, pose_flag, word
from epuck_mj.host.files import check_writable
from epuck_mj.host.interruption import Interrupted, Interruption
from epuck_mj.host.limits import check_flag
from epuck_mj.host.output import Output

MODULE = "epuck_mj.bridge.fake"
RANDOM = "random"
RANDOM_END = 10.0
"""Latest start of a fault in a random scenario [s]."""


EXAMPLES = (
    "python -m epuck_mj.bridge.fake",
    "python -m epuck_mj.bridge.fake --tcp 5000 --scenario stall@2",
)


@dataclass(frozen=True)
class Options:
    """Emulate an e-puck with a simulated body behind a serial port, until Ctrl-C.

    Attributes:
        arena: name of a shipped arena, or path of an MJCF file.
        robot: name of a shipped robot, or path of an MJCF file.
        pose: start: x and y [m] and heading [degrees].
        firmware: asercom, btcom or epuck2.
        link: path of a symbolic link to the pseudo-terminal; in a temporary folder if
            not given.
        tcp: listen on this TCP port instead, as socket://127.0.0.1:PORT; 0 is any.
        wifi: emulate an e-puck2 over WiFi, on this TCP port; 0 is any.
        scenario: faults, such as stall@2,loss@4+1, or random. The faults are loss,
            garbage, noise, stall, disconnect, gone and reset, each with its time since
            the first byte [s].
        seed: seed of random scenarios, garbage and lost bytes.
        latency: delay of each direction [s], in addition to the UART's.
        speed: how many times faster than real time the emulation runs.
        journal: file (.npz) for a record of everything that the robot did.
    """

    arena: Annotated[str, word("ARENA")] = "arena"
    robot: Annotated[str, word("ROBOT")] = "epuck"
    pose: Annotated[tuple[float, float, float], word("X Y DEGREES")] = (0.0, 0.0, 0.0)
    firmware: Annotated[str, word("NAME")] = "asercom"
    link: Annotated[Path | None, word("FILE")] = None
    tcp: Annotated[int | None, word("PORT")] = None
    wifi: Annotated[int | None, word("PORT")] = None
    scenario: Annotated[str, word("FAULTS")] = ""
    seed: int = 0
    latency: Annotated[float, word("SECONDS")] = 0.0
    speed: float = 1.0
    journal: Annotated[Path | None, word("FILE")] = None


def fake(argv: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    options = parse(Options, f"python -m {MODULE}", argv, examples=EXAMPLES)
    _refuse_bad_options(options)
    # slow to import, and not needed for --help
    from epuck_mj.bridge.fake.emulator import WIFI, Emulator
    from epuck_mj.bridge.fake.endpoints import Pty, Tcp, serve
    from epuck_mj.bridge.fake.simulated_body import SimulatedBody
    from epuck_mj.bridge.line.connect import WIFI_SCHEME
    from epuck_mj.scene.model import load_scene

    faults = (
        random_scenario(options.seed, RANDOM_END)
        if options.scenario == RANDOM
        else scenario(options.scenario)
    )
    scene = load_scene(options.robot, options.arena)
    origin = time.monotonic()

    def clock() -> float:
        return (time.monotonic() - origin) * options.speed

    body = SimulatedBody(scene, np.array(pose_flag(options.pose)), clock())
    robot = options.firmware if options.wifi is None else WIFI
    emulator = Emulator(body, robot, clock(), faults, options.latency, options.seed)
    with Output(sys.stdout) as output:
        with Interruption() as interruption, tempfile.TemporaryDirectory() as folder:
            link = options.link or Path(folder, "e-puck")
            if options.wifi is not None:
                endpoint = Tcp(options.wifi, WIFI_SCHEME)
            else:
                endpoint = Pty(link) if options.tcp is None else Tcp(options.tcp)
            try:
                with interruption.raising():
                    if faults:
                        output.say(f"scenario: {','.join(map(str, faults))}")
                    output.say(f"port: {endpoint.name}")
                    serve(emulator, endpoint, clock, lambda: not output.lost)
            except Interrupted:
                pass
            finally:
                endpoint.close()
        if options.journal is not None:
            body.journal.save(options.journal, scene.model.opt.timestep)
        state = "standing" if body.standing else "still driving"
        x, y, yaw = body.pose
        turned = f"yaw {math.degrees(yaw):.2f} degrees"
        output.say(f"{state}, x {x:.4f} m, y {y:.4f} m, {turned}")
        output.finish()
    return 0


def _refuse_bad_options(options: Options) -> None:
    ports = [x for x in (options.link, options.tcp, options.wifi) if x is not None]
    if len(ports) > 1:
        raise UserError("expected one of --link, --tcp and --wifi")
    if options.journal is not None:
        check_writable(options.journal)
    if not 0 < options.speed <= 1000:
        raise UserError(f"expected --speed above 0, up to 1000, got {options.speed}")
    if not 0 <= options.latency <= 1:
        raise UserError(f"expected --latency from 0 to 1 s, got {options.latency}")
    check_flag("seed", options.seed)
    pose_flag(options.pose)


if __name__ == "__main__":
    main(fake)
