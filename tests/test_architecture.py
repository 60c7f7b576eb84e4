"""Layers: who may import whom, and which package may be imported where."""

import ast
import os
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULES = sorted([*ROOT.glob("epuck_mj/**/*.py"), *ROOT.glob("evolution/**/*.py")])

ROOMS = {
    "epuck_mj": [
        {"errors", "constants"},
        {"host"},
        {"step"},
        {"policies", "scene"},
        {"rungs"},
        {"trials"},
        {"show"},
        {"environments"},
        {"check", "view"},
        {"bridge"},
        {"calibrate"},
        {"__main__"},
    ],
    "evolution": [
        {"search", "statistics"},
        {"settings"},
        {"judging"},
        {"run"},
        {"study"},
        {"margins", "named_policies", "pages"},
        {"evaluate", "export", "frames", "gap", "replay", "report", "verify"},
        {"hybrids", "variations"},
        {"reproduce"},
        {"__main__"},
    ],
}
"""Each room imports from its own and from those above it here."""

NUMPY_ONLY = (
    "epuck_mj/step/control.py",
    "epuck_mj/step/disturbances.py",
    "epuck_mj/step/fitness.py",
    "epuck_mj/step/motors.py",
    "epuck_mj/step/sensors.py",
    "epuck_mj/policies/",
    "epuck_mj/bridge/failures.py",
    "epuck_mj/bridge/language/",
    "epuck_mj/bridge/fake/builds.py",
    "epuck_mj/bridge/fake/firmware.py",
    "epuck_mj/bridge/fake/motors_and_sensors.py",
    "epuck_mj/bridge/fake/talker.py",
    "epuck_mj/bridge/fake/wifi_firmware.py",
    "epuck_mj/bridge/fake/wire.py",
    "epuck_mj/calibrate/fitting.py",
    "evolution/search/",
)
"""Where numpy is the only package from outside; `ALLOWED_IN` has the exceptions."""

ALLOWED_IN = {
    "cmaes": ("evolution/search/symmetric_cma.py", "evolution/search/cma_es.py"),
    "contourpy": ("epuck_mj/scene/wall_loops.py",),
    "dask": ("evolution/study/cluster/",),
    "distributed": ("evolution/study/cluster/",),
    "dm_control": ("epuck_mj/environments/",),
    "dm_env": ("epuck_mj/environments/",),
    "gymnasium": ("epuck_mj/environments/",),
    "imageio_ffmpeg": ("epuck_mj/show/video.py",),
    "markdown_it": ("evolution/pages/blocks.py",),
    "matplotlib": (
        "epuck_mj/check/picture.py",
        "epuck_mj/show/",
        "evolution/gap/figure.py",
        "evolution/hybrids/hybrids_figures.py",
        "evolution/pages/figure_files.py",
        "evolution/pages/style.py",
        "evolution/report/figures/",
        "evolution/variations/variations_figure.py",
    ),
    "pandas": ("evolution/frames.py",),
    "pyarrow": (
        "evolution/margins/margins_table.py",
        "evolution/study/columns.py",
        "evolution/study/histories.py",
        "evolution/study/table_files.py",
        "evolution/study/thinning.py",
    ),
    "rerun": ("epuck_mj/show/recording/", "evolution/replay/viewer_picture.py"),
    "serial": ("epuck_mj/bridge/line/serial_port.py",),
    "yaml": ("epuck_mj/host/yaml_and_json.py",),
}
"""Packages that only some places may import."""

OUTSIDE = {*ALLOWED_IN, "mujoco", "pydantic", "scipy", "tqdm", "tyro"}


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def module_of(path: Path) -> str:
    return name_of(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def imports(path: Path) -> set[str]:
    """All that a file imports anywhere: `a.b` and `a.b.c` for `from a.b import c`."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            found.add(node.module or "")
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


IMPORTS = {path: imports(path) for path in MODULES}


def test_packages_stay_where_they_belong():
    strays = []
    for path, found in IMPORTS.items():
        packages, name = {each.split(".")[0] for each in found}, name_of(path)
        forbidden = {"pickle", "shelve", "marshal"}
        forbidden |= {p for p, to in ALLOWED_IN.items() if not name.startswith(to)}
        if name.startswith(NUMPY_ONLY):
            own = {p for p, to in ALLOWED_IN.items() if name.startswith(to)}
            forbidden |= OUTSIDE - own
        if name.startswith("epuck_mj/"):
            forbidden.add("evolution")
        strays += [f"{name} imports {package}" for package in packages & forbidden]
    assert not strays


def test_rooms_import_from_those_above_them():
    strays = []
    for path, found in IMPORTS.items():
        package, *inside = module_of(path).split(".")
        layers = ROOMS[package]
        if not inside:
            continue
        [own] = [i for i, layer in enumerate(layers) if inside[0] in layer]
        above = set().union(*layers[:own]) | {inside[0]}
        rooms = {each.split(".")[1] for each in found if each.startswith(f"{package}.")}
        strays += [
            f"{name_of(path)} imports {room}"
            for room in rooms & set().union(*layers)
            if room not in above
        ]
    assert not strays


def test_there_is_a_place_for_every_room_and_a_room_for_every_place():
    for package, layers in ROOMS.items():
        there = {path.stem for path in (ROOT / package).glob("*.py")}
        there |= {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}
        assert there - {"__init__"} == set().union(*layers)


def test_no_imports_in_circles():
    modules = {module_of(path): path for path in MODULES}
    uses = {
        name: {
            each
            for each in IMPORTS[path] & set(modules)
            # a package's face is no door to its own rooms
            if not f"{name}.".startswith(f"{each}.")
        }
        for name, path in modules.items()
    }
    # raises if there is one
    TopologicalSorter(uses).prepare()


COMMANDS = sorted(
    name
    for path, name in ((path, module_of(path)) for path in MODULES)
    if '__name__ == "__main__"' in path.read_text()
)


@pytest.mark.parametrize(
    ("modules", "absent"),
    [
        (
            ["epuck_mj", "epuck_mj.constants", "epuck_mj.bridge.language.protocol"],
            {*OUTSIDE, "xml"},
        ),
        (COMMANDS, OUTSIDE - {"pydantic", "tqdm", "tyro", "yaml", "serial"}),
    ],
)
def test_starting_loads_what_is_used(modules, absent):
    """No physics and no pictures before a command has read its arguments."""
    code = (
        "import importlib, sys\n"
        f"for name in {modules}: importlib.import_module(name)\n"
        f"print(*sorted({absent} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("", "")


def without_settings(*arguments: str) -> tuple[int, str, str]:
    """What a Python process without display or settings ends with, and says."""
    gone = ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL", "OPENBLAS_NUM_THREADS")
    result = subprocess.run(
        [sys.executable, "-W", "error", *arguments],
        env={k: v for k, v in os.environ.items() if k not in gone},
        capture_output=True,
        text=True,
    )
    return result.returncode, result.stdout, result.stderr


def test_nothing_here_draws():
    """The whole package imports without OpenGL, display or a word."""
    code = (
        "import epuck_mj, evolution.run.__main__, epuck_mj.environments.gymnasium as g;"
        "epuck_mj.load('follow_walls').reset();"
        # the kinematic robot's first compilation is announced
        "g.FollowWallsEnv(robot='epuck').reset()"
    )
    assert without_settings("-c", code) == (0, "", "")


def test_only_commands_change_the_environment():
    """Who imports the package may draw by any means, and multiply in any threads."""
    say = "print(*map(os.environ.get, ['MUJOCO_GL', 'OPENBLAS_NUM_THREADS']))"
    code = f"import epuck_mj, os; {say}"
    assert without_settings("-c", code) == (0, "None None\n", "")
    # the module of a command, loaded as `python -m` does
    command = (
        "import sys, os, importlib\n"
        "sys.argv, sys.orig_argv[1:] = ['-m'], ['-m', {0!r}]\n"
        f"importlib.import_module({{0!r}}); {say}"
    )
    for name in ("epuck_mj.check", "evolution.run", "benchmarks.ppo.network"):
        found = without_settings("-c", command.format(name))
        assert found == (0, "disabled 1\n", "")
