"""The bridge against the emulated robot, in real time on a pty: `make bridge`.

The emulator is a process of its own, the bridge this one; pyserial lies between them.
Its closed loop is compared with two simulations, see `tests.bridge_reference`:
one at the same times, which shows that nothing is lost or changed on the way, and one
with control steps all alike, which shows what a real robot's timing does to a path.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.figures import write_figures
from epuck_mj.bridge.drive.robot import RealRobot
from epuck_mj.bridge.drive.session import Session
from epuck_mj.bridge.fake.builds import BUILDS
from epuck_mj.bridge.fake.simulated_body import Journal
from epuck_mj.bridge.line.link import Link
from epuck_mj.bridge.line.serial_line import SerialLine
from epuck_mj.bridge.line.serial_port import SerialPort
from epuck_mj.host.command_line import main, parse
from epuck_mj.host.files import read_arrays
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import KINEMATIC_ROBOT, WHEELED_ROBOT
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.control import Policy, TaskParameters
from tests.bridge_reference import (
    at_control_steps,
    deviation,
    drive_steps,
    nominal,
    same_times,
)

ROBOTS = (WHEELED_ROBOT, KINEMATIC_ROBOT)
FIRMWARE = "asercom"
START = (0.1, -0.2, 0.7)
"""Pose: x, y [m], yaw [rad]; nothing is special about it."""

START_TIME_MAX = 60.0
"""An emulator that has no port by then [s] never gets one."""


@dataclass(frozen=True)
class Options:
    """Measure the bridge.

    Attributes:
        json: file for the figures.
        seconds: how long each robot drives.
        champion: controller file; the wall follower written by hand if not given.
    """

    json: Path | None = None
    seconds: float = 60.0
    champion: Path | None = None


def measure_bridge(argv: Sequence[str]) -> int:
    """Run the command line; its exit status."""
    options = parse(Options, "python -m benchmarks.bridge", argv, Options())
    task, policy = TaskParameters(), WallFollower()
    if options.champion is not None:
        file = load_controller(options.champion)
        task, policy = file.task, file.controller
    results = {}
    for robot in ROBOTS:
        results[robot] = measure(robot, policy, task, options.seconds)
        print(robot)
        for name, value in results[robot].items():
            print(f"  {name:36} {value:10.4g}")
    write_figures(options.json, results)
    return 0


def measure(
    robot: str, policy: Policy, task: TaskParameters, seconds: float
) -> dict[str, float]:
    """Figures of one drive."""
    scene = load_scene(robot, "arena", task.control_step)
    n_steps = round(seconds / task.control_step)
    with tempfile.TemporaryDirectory() as folder:
        port, file = Path(folder, "e-puck"), Path(folder, "journal.npz")
        load_before = os.getloadavg()[0]
        fake = _emulator(robot, port, file)
        try:
            with RealRobot(
                SerialLine(Link(lambda: SerialPort(str(port)))),
                Calibration(),
                task.control_step,
                start=START,
            ) as real:
                real.greet()
                session = Session(task)
                for _ in session.drive(real, policy, n_steps, time.monotonic):
                    pass
        finally:
            fake.terminate()
            fake.communicate(timeout=30)
        journal = read_journal(file)
    poses = np.array(journal.pose)
    start = np.array(START)
    same = same_times(scene, policy, task, start, journal, BUILDS[FIRMWARE].timer)
    there = deviation(same, poses[: len(same)])
    paced = at_control_steps(scene, journal, n_steps)
    plain = nominal(scene, policy, task, start, n_steps)[: len(paced)]
    undisturbed = deviation(paced, plain)
    by_odometry = np.array([step.moment.pose for step in session.steps])
    drift = np.linalg.norm(by_odometry[-1, :2] - poses[len(same) - 1, :2])
    latency = np.array([step.moment.latency for step in session.steps])
    compute = np.array([step.compute for step in session.steps])
    return {
        "control_steps": len(session.steps),
        "overruns": real.schedule.n_overruns,
        "resynchronisations": real.n_repairs,
        "latency_median_ms": 1000 * float(np.median(latency)),
        "latency_p95_ms": 1000 * float(np.percentile(latency, 95)),
        "latency_max_ms": 1000 * float(latency.max()),
        "compute_p95_ms": 1000 * float(np.percentile(compute, 95)),
        "compute_max_ms": 1000 * float(compute.max()),
        "same_times_mm": 1000 * there[0],
        "same_times_deg": float(np.degrees(there[1])),
        "commands_off_beat": off_beat(scene, journal),
        "nominal_mm": 1000 * undisturbed[0],
        "nominal_deg": float(np.degrees(undisturbed[1])),
        "odometry_drift_mm": 1000 * float(drift),
        "path_m": real.odometry.length,
        "load_average_before": load_before,
        "cores": os.cpu_count() or 1,
    }


def read_journal(path: Path) -> Journal:
    """What an emulated robot did."""
    arrays = read_arrays(path)
    return Journal(
        **{name: list(rows) for name, rows in arrays.items() if name != "timestep"}
    )


def off_beat(scene: Scene, journal: Journal) -> int:
    """Commands that did not come whole control steps after the one before.

    In physics steps: one early or late is enough to make another path of it.
    """
    driven = drive_steps(journal)
    return int(np.count_nonzero(np.diff(driven) % scene.n_substeps))


def _emulator(robot: str, port: Path, journal: Path) -> subprocess.Popen:
    """An emulated robot that is there."""
    pose = [str(START[0]), str(START[1]), str(np.degrees(START[2]))]
    fake = subprocess.Popen(
        [
            *(sys.executable, "-m", "epuck_mj.bridge.fake", "--robot", robot),
            *("--firmware", FIRMWARE, "--link", str(port), "--pose", *pose),
            *("--journal", str(journal)),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + START_TIME_MAX
    while not port.is_symlink():
        if fake.poll() is not None or time.monotonic() > deadline:
            fake.kill()
            raise RuntimeError("the emulated robot did not start")
        time.sleep(0.05)
    return fake


if __name__ == "__main__":
    main(measure_bridge)
