"""Layers: who may import whom, and which package may be imported where."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULES = sorted([*ROOT.glob("epuck_mj/**/*.py"), *ROOT.glob("evolution/**/*.py")])

LAYERS = [
    {"errors", "constants", "interruption"},
    {"sensors", "motors", "fitness", "controller", "files", "command_line"},
    {"control", "wall_follower", "interface", "colors", "pictures", "mappings"},
    {"mjcf", "calibration", "controller_file"},
    {"model", "disturbances"},
    {"simulation", "geometry"},
    {"disturbed_robots"},
    {"starts", "outline", "trajectory", "tracks", "clearance"},
    {"tasks", "phases", "wall_loops"},
    {"recording", "render", "metrics", "check", "view"},
    {"behaviour_classes", "video", "bridge"},
    {"calibrate"},
]
"""Modules of epuck_mj; each imports from layers above its own here only."""

NUMPY_ONLY = {
    "epuck_mj/sensors.py",
    "epuck_mj/motors.py",
    "epuck_mj/fitness.py",
    "epuck_mj/controller.py",
    "epuck_mj/controller_file.py",
    "epuck_mj/control.py",
    "epuck_mj/wall_follower.py",
    "epuck_mj/bridge/ascii.py",
    "epuck_mj/bridge/binary.py",
    "epuck_mj/bridge/body.py",
    "epuck_mj/bridge/builds.py",
    "epuck_mj/bridge/errors.py",
    "epuck_mj/bridge/firmware.py",
    "epuck_mj/bridge/packets.py",
    "epuck_mj/bridge/parsing.py",
    "epuck_mj/bridge/protocol.py",
    "epuck_mj/bridge/replies.py",
    "epuck_mj/bridge/wifi_firmware.py",
    "epuck_mj/bridge/wire.py",
    "epuck_mj/calibrate/fitting.py",
    "evolution/ask_tell.py",
    "evolution/bounds.py",
    "evolution/optimizer.py",
    "evolution/search_space.py",
    "evolution/differential_evolution.py",
    "evolution/genetic_algorithm.py",
    "evolution/random_search.py",
    "evolution/evolution_strategy.py",
    "evolution/stagnation.py",
}
"""Where numpy is the only package from outside."""

ALLOWED_IN = {
    "cmaes": "evolution/cma_es.py",
    "dask": "evolution/cluster/",
    "distributed": "evolution/cluster/",
    "rerun": "epuck_mj/recording/",
    "serial": "epuck_mj/bridge/serial_port.py",
    "contourpy": "epuck_mj/wall_loops.py",
    "imageio_ffmpeg": "epuck_mj/video.py",
    "matplotlib": (
        "epuck_mj/check/picture.py",
        "epuck_mj/pictures.py",
        "evolution/figures.py",
        "evolution/gap/figure.py",
        "evolution/report/figures/",
    ),
    "yaml": "epuck_mj/mappings.py",
}
"""Packages that only one place may import."""

OUTSIDE = {"mujoco", "dm_control", "dm_env", "scipy", "pydantic", "tyro", "tqdm"}


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            found.add(node.module or "")
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_packages_stay_where_they_belong(path):
    packages = {name.split(".")[0] for name in imports(path)}
    name = name_of(path)
    for package, places in ALLOWED_IN.items():
        assert package not in packages or name.startswith(places)
    if name in NUMPY_ONLY:
        assert not packages & (OUTSIDE | set(ALLOWED_IN))
    if name.startswith("epuck_mj/"):
        assert "evolution" not in packages
    assert not packages & {"pickle", "shelve", "marshal"}


def test_every_module_of_the_robot_has_a_layer():
    inside = {path for path in (ROOT / "epuck_mj").iterdir() if path.suffix == ".py"}
    names = {path.stem for path in inside} | {
        "bridge",
        "calibrate",
        "check",
        "recording",
    }
    assert names - {"__init__"} == set().union(*LAYERS)


LAYERED = [
    path
    for path in MODULES
    if name_of(path).startswith("epuck_mj/") and name_of(path) != "epuck_mj/__init__.py"
]


@pytest.mark.parametrize("path", LAYERED, ids=name_of)
def test_layers_of_the_robot(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    above: set[str] = set()
    for layer in LAYERS:
        if parts[1] in layer:
            break
        above |= layer
    used = {
        name.split(".")[1] for name in imports(path) if name.startswith("epuck_mj.")
    }
    used &= set().union(*LAYERS)
    assert used - {parts[1]} <= above


def test_nothing_here_draws():
    """The whole package imports without OpenGL, display or a word."""
    import os
    import subprocess
    import sys

    environment = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    environment.pop("MUJOCO_GL", None)
    code = "import epuck_mj, evolution.run; epuck_mj.load('follow_walls').reset()"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
