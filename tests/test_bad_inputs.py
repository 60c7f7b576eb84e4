"""Random bad inputs of all commands: one line, exit status 2, and nothing written.

More of them, and others, by hand:

    BAD_INPUTS=2000 BAD_INPUTS_FROM=1000 python -m pytest -q tests/test_bad_inputs.py
"""

import os
import random
import shutil
import sys
import time
from pathlib import Path

import pytest

from epuck_mj.bridge.__main__ import bridge
from epuck_mj.bridge.fake.__main__ import fake
from epuck_mj.calibrate.__main__ import calibrate
from epuck_mj.check.__main__ import check
from epuck_mj.host.command_line import main
from epuck_mj.view.__main__ import view
from evolution.evaluate import evaluate_policies
from evolution.export import export
from evolution.gap.__main__ import measure_gap
from evolution.replay.__main__ import replay
from evolution.report.__main__ import report_study
from evolution.reproduce.__main__ import reproduce_paper
from evolution.run.__main__ import evolve
from evolution.study.__main__ import study
from evolution.verify.__main__ import verify
from tests import faults
from tests.sound_inputs import BEGUN, FINISHED, PACKED, write_sound_inputs

N = int(os.environ.get("BAD_INPUTS", "200"))
FIRST = int(os.environ.get("BAD_INPUTS_FROM", "0"))
SHARES = 8
PATIENCE = 10.0
"""The longest that a command may take [s]."""

COMMANDS = {
    "run": evolve,
    "study": study,
    "evaluate": evaluate_policies,
    "replay": replay,
    "report": report_study,
    "gap": measure_gap,
    "reproduce": reproduce_paper,
    "verify": verify,
    "export": export,
    "check": check,
    "view": view,
    "bridge": bridge,
    "fake": fake,
    "calibrate": calibrate,
}

NOBODY = "--port socket://127.0.0.1:1"
"""Where no robot is: nothing bad is to get as far as this."""

ROBOT = "--calibration robot.yaml --noise strong"
RUN = "run mine.yaml --output out"
SHOW = "replay --save out.rrd"

READERS = {
    "mine.yaml": [RUN, "study study.yaml --output out"],
    "study.yaml": ["study study.yaml --output out --seeds 1"],
    "champion.json": [
        "evaluate champion.json",
        f"{SHOW} champion.json",
        "gap champion.json --output out",
        "view arena champion.json",
        f"bridge champion.json {NOBODY}",
    ],
    "robot.yaml": [
        f"{RUN} {ROBOT}",
        f"evaluate wall-follower {ROBOT}",
        f"{SHOW} wall-follower {ROBOT}",
        f"view arena {ROBOT}",
        f"bridge wall-follower --calibration robot.yaml {NOBODY}",
        f"calibrate --output robot.yaml {NOBODY}",
    ],
    "arena.xml": [
        "check arena.xml",
        f"{RUN} --arena arena.xml",
        "evaluate champion.json --arena arena.xml",
        f"{SHOW} champion.json --arena arena.xml",
        "view arena.xml",
        "fake --arena arena.xml",
        f"bridge champion.json --arena arena.xml {NOBODY}",
    ],
    f"{BEGUN}/champion.json": [
        f"evaluate {BEGUN}",
        f"{SHOW} {BEGUN}",
        f"gap {BEGUN} --output out",
        f"verify {BEGUN}",
    ],
    f"{BEGUN}/config.yaml": [
        f"run --resume {BEGUN}",
        f"evaluate {BEGUN}",
        f"{SHOW} {BEGUN} --generations 0",
        f"verify {BEGUN}",
    ],
    f"{BEGUN}/provenance.json": [f"run --resume {BEGUN}"],
    f"{BEGUN}/checkpoint.npz": [f"run --resume {BEGUN}"],
    f"{BEGUN}/best_individuals.npz": [
        f"evaluate {BEGUN} --generations last",
        f"{SHOW} {BEGUN} --generations 0",
    ],
    f"{FINISHED}/champion.json": ["report finished --output out"],
    f"{FINISHED}/config.yaml": ["report finished --output out"],
    f"{FINISHED}/provenance.json": ["report finished --output out"],
    f"{FINISHED}/history.csv": ["report finished --output out"],
    "packed/champions.parquet": [
        "report packed --output out",
        f"evaluate {PACKED}",
        f"{SHOW} packed",
        f"gap {PACKED} --output out",
        f"verify {PACKED}",
        f"export {PACKED} out.json",
        "study study.yaml --output packed --seeds 1",
    ],
    "packed/history.parquet": [
        "report packed --output out",
        f"verify {PACKED}",
    ],
    "packed/provenance.json": [
        "report packed --output out",
        f"evaluate {PACKED}",
        f"export {PACKED} out.yaml",
    ],
    "packed/study.yaml": [f"evaluate {PACKED}", f"export {PACKED} out.json"],
    "finished/study.yaml": [
        "report finished --output out",
        "study study.yaml --output finished --seeds 1",
    ],
    "finished/seeds.yaml": [
        "report finished --output out",
        "study study.yaml --output finished --seeds 1",
    ],
}
"""Files, and command lines that cannot do without them."""

NUMBER = "x,nan,1e999,,9e9,0x10"
WHOLE = "-1,1.5,1000000000,1000000000000000000000," + NUMBER
SIZE = "0," + WHOLE
POSITIVE = "0,-1,inf,1e300,128.8," + NUMBER
SHARE = "-0.1,1.1,inf," + NUMBER
NAME = "nobody,nobody.xml,nobody.py:x,mine.yaml,."

FLAGS = {
    RUN: {
        "seed": "-1,1.5,1" + "0" * 30,
        **dict.fromkeys(("evaluations", "trials", "steps", "hidden", "bits"), SIZE),
        **dict.fromkeys(("population", "tournament", "test-starts"), SIZE),
        **dict.fromkeys(("threads", "elites", "validation-starts"), WHOLE + ",-7"),
        **dict.fromkeys(("control-step", "v-max", "w-max", "sensor-range"), POSITIVE),
        **dict.fromkeys(("start-clearance", "weight-bound"), "0,-1,inf,1e9," + NUMBER),
        **dict.fromkeys(("crossover", "mutation"), SHARE),
        **dict.fromkeys(("robot", "arena", "fitness", "network"), NAME),
        **dict.fromkeys(("optimizer", "noise", "engine", "calibration"), NAME),
        "weight-init": "6,1,0,-1,inf," + NUMBER,
        "resume": NAME,
        "unknown": "3",
        "randomise": "",
        "randomise-all": "",
    },
    "study study.yaml --output out": {
        "jobs": WHOLE,
        "seeds": "x,-1,3-1,1-10001,1--2",
        "experiments": "nobody,mine.nobody",
        "split": "",
    },
    "evaluate champion.json": {
        "starts": "1," + SIZE,
        "threads": WHOLE,
        **dict.fromkeys(("robot", "arena", "noise", "calibration"), NAME),
        "generations": "x,99,-1",
        "json": "no/such.json,.",
        "randomise": "",
        "randomise-all": "",
    },
    f"{SHOW} champion.json": {
        "trials": "51," + SIZE,
        "starts": "x,test,test:5-1,test:99999,training:0",
        "pose": "1,9,nan",
        **dict.fromkeys(("robot", "arena", "noise", "calibration"), NAME),
        "compare": "nobody,nobody.npz",
    },
    "gap champion.json --output out": {
        **dict.fromkeys(("worlds", "starts"), "1," + SIZE),
        "threads": WHOLE,
        "robot": NAME,
        "speeds": "0,-1,inf,0.2,x,nan,1e999",
    },
    "view arena champion.json": {
        "seed": WHOLE,
        "seconds": "0,-1,0.01,inf,1e300,100000," + NUMBER,
        "pose": "1,nan",
        **dict.fromkeys(("robot", "noise", "calibration"), NAME),
    },
    f"bridge champion.json {NOBODY}": {
        "seconds": "0,-1,inf,1e300,100000," + NUMBER,
        "max-speed": POSITIVE,
        **dict.fromkeys(("calibration", "arena"), NAME),
        "pose": "1,nan",
    },
    "fake": {
        "seed": "-1,x,1.5",
        "speed": "0,-1,inf,1e9," + NUMBER,
        "latency": "-1,2,inf," + NUMBER,
        "scenario": "x,stall,stall@,stall@-1,stall@x",
        **dict.fromkeys(("robot", "arena", "firmware"), NAME),
        "pose": "1,nan",
        "journal": "no/such.npz,.",
    },
    f"calibrate {NOBODY}": {"only": "x,all", "output": "no/such.yaml,.", "steps": "1"},
    "check arena.xml": {"robot": NAME},
    "report finished": {"outptu": "out", "output": "mine.yaml"},
    f"verify {BEGUN}": {"threads": WHOLE},
    "reproduce": {"wheels": "begun", "study": "nobody", "quick": "--full"},
}
"""Flags of command lines, and values that they cannot have; nothing is no value."""


def bad_file(rng: random.Random) -> tuple[str, str]:
    """Spoil a file; the command line that is to meet it, and what is wrong."""
    name = rng.choice(list(READERS))
    path, line = Path(name), rng.choice(READERS[name])
    content, form = path.read_bytes(), path.suffix[1:]
    if form in ("npz", "parquet"):
        content, what = getattr(faults, f"{form}_fault")(content, rng)
    else:
        text = content.decode()
        chance = rng.random()
        if chance < 0.2:
            content, what = faults.text_fault(text, rng)
        elif chance < 0.6 and form in ("yaml", "json") and path.stem != "seeds":
            content, what = faults.value_fault(text, form, rng, free_keys(path, line))
        else:
            content, what = getattr(faults, f"{form}_fault")(text, rng)
    path.write_bytes(content)
    return line, f"{name}: {what}"


def free_keys(path: Path, line: str) -> set[str]:
    """Keys of a file whose values a command does not need, or that may be None."""
    free = {"start_clearance", "calibration", "model", "machine", "started", "finished"}
    if path.stem == "provenance":
        free |= {"engine", "threads", "platform"}
    if line.startswith(("view", "bridge")):
        free.add("scores")
    return free


def bad_flag(rng: random.Random) -> tuple[str, str]:
    """A command line with a bad flag, and that flag."""
    line = rng.choice(list(FLAGS))
    flag = rng.choice(list(FLAGS[line]))
    value = rng.choice(FLAGS[line][flag].split(","))
    return line, f"--{flag} {value}".rstrip()


def tree() -> dict[str, bytes]:
    """All files below the working directory, and their contents."""
    return {
        str(path): path.read_bytes() if path.is_file() else b""
        for path in Path().rglob("*")
    }


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A directory of sound inputs."""
    directory = tmp_path_factory.mktemp("sound")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(directory)
        write_sound_inputs()
    return directory


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("share", range(SHARES))
def test_bad_inputs_are_one_line(share, sound, tmp_path, monkeypatch, capfd):
    said = {}
    for seed in range(FIRST + share, FIRST + N, SHARES):
        rng, here = random.Random(seed), tmp_path / str(seed)
        shutil.copytree(sound, here)
        monkeypatch.chdir(here)
        line, what = bad_file(rng) if rng.random() < 0.6 else bad_flag(rng)
        name, *argv = line.split()
        argv += what.split(" ") if what.startswith("--") else []
        before, start = tree(), time.monotonic()
        status, out, err = outcome(name, argv, monkeypatch, capfd)
        seconds = time.monotonic() - start
        # what is wrong with an arena, or a run, is what these two are asked for
        findings = name in ("check", "verify") and status == 1 and out and not err
        if status != 2 and not findings:
            said[seed] = f"status {status} {out[-200:]} {err[-900:]}"
        elif not findings and (err.count("\n") != 1 or not err.startswith("error: ")):
            said[seed] = f"stderr: {err}"
        elif tree() != before:
            said[seed] = f"written: {sorted(set(tree()) - set(before)) or 'changed'}"
        elif seconds > PATIENCE:
            said[seed] = f"{seconds:.1f} s"
        if seed in said:
            said[seed] = f"{name} {' '.join(argv)} [{what}] {said[seed]}"
        if os.environ.get("BAD_INPUTS_SHOWN"):
            with capfd.disabled():
                print(seed, line, f"[{what:.90}]", status, f"{seconds:.2f}", err[:300])
        monkeypatch.chdir(tmp_path)
        shutil.rmtree(here)
    assert not said, "\n".join(f"{seed}: {each}" for seed, each in said.items())


def outcome(name, argv, monkeypatch, capfd) -> tuple[int, str, str]:
    """Exit status and output of a command line in this process."""
    monkeypatch.setattr(sys, "argv", [name, *argv])
    capfd.readouterr()
    status: object = None
    try:
        main(COMMANDS[name])
    except SystemExit as end:
        status = end.code
    except BaseException as error:
        status, text = 99, f"{type(error).__name__}: {error}"
        print(text, file=sys.stderr)
    return (status if isinstance(status, int) else 98, *capfd.readouterr())
