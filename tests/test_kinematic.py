"""The kinematic rung: against MuJoCo's geometry, equations of motion, and the loop."""

import ast
import errno
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numba.core import caching, event

from epuck_mj.errors import UserError
from epuck_mj.policies.network import Controller, Network
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.disturbed import disturbed
from epuck_mj.rungs.kinematic import compiling
from epuck_mj.rungs.kinematic.fused import FusedTrials
from epuck_mj.rungs.kinematic.kernel import (
    COS,
    N_OWN,
    SIN,
    X,
    Y,
    distance_to,
)
from epuck_mj.rungs.kinematic.plan import Grid, plan_of
from epuck_mj.rungs.kinematic.robots import (
    ENDLESS,
    KinematicRobots,
    at_rest,
    sensed,
    substeps,
)
from epuck_mj.rungs.kinematic.whole_trial import FITNESS
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.table import compiled_trials, robots_in
from epuck_mj.scene.clearance import CLEARANCE_MAX, ClearanceProbe
from epuck_mj.scene.model import Scene, load_scene
from epuck_mj.scene.model_files import MODELS, ON_WHEELS
from epuck_mj.scene.starts import FreeSpace
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import Everybody, TaskParameters, run_trials
from epuck_mj.step.disturbances import Disturbances
from evolution.judging.evaluation import BatchEngine, Race, Work
from evolution.run.generation_loop import Evolution
from evolution.settings.config import ExperimentConfig
from tests.processes import PATIENCE

ROBOT = "epuck_kinematic"
SHIPPED = ["arena", *(path.stem for path in sorted(MODELS.glob("arenas/*.xml")))]


@pytest.fixture(scope="module", params=SHIPPED)
def shipped(request) -> Scene:
    return load_scene(ROBOT, request.param)


@pytest.fixture(scope="module")
def square() -> Scene:
    return load_scene(ROBOT, "arena")


def starts_in(scene: Scene, n: int, seed: int = 0) -> np.ndarray:
    return FreeSpace(scene, 0.003).sample(np.random.default_rng(seed), n)


def controllers(n: int, network: Network, seed: int = 0) -> Controller:
    """Random ones, among them some that drive far."""
    rng = np.random.default_rng(seed)
    return network.decode(rng.normal(0, 4, (n, network.n_genes)))


def same(one, other) -> None:
    np.testing.assert_array_equal(one.fitness, other.fitness)
    np.testing.assert_array_equal(one.steps, other.steps)
    np.testing.assert_array_equal(one.crashed, other.crashed)


def both_ways(
    scene: Scene,
    task: TaskParameters,
    network: Network,
    met: Disturbances | None,
    n: int,
    threads: int = 1,
) -> None:
    """Compare compiled trials with those step by step."""
    starts, policy = starts_in(scene, n), controllers(n, network)
    compiled = FusedTrials(scene, task, threads)
    never = np.full(n, -np.inf)
    robots = disturbed(KinematicRobots(scene, n), met, task.control_step)
    expected = run_trials(robots, policy, starts, task)
    same(compiled(policy, starts, met, 1, never), expected)
    assert len(set(expected.fitness.tolist())) > n // 5


@pytest.mark.parametrize("noise", ["none", "calibrated"])
def test_compiled_trials_have_the_bits_of_the_loop_in_every_arena(shipped, noise):
    task = TaskParameters(steps=80)
    met = Conditions(noise).draw(np.random.default_rng(1), 40, task.steps)
    both_ways(shipped, task, Network(), met, 40)


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("fitness", FITNESS)
@pytest.mark.parametrize("network", [Network(), Network(1, True), Network(7, True)])
def test_compiled_trials_have_the_bits_of_the_loop_for_every_task(
    threads, fitness, network
):
    task = TaskParameters(60, 0.07, fitness, 0.05)
    square = load_scene(ROBOT, "arena", task.control_step)
    every = Conditions("strong", randomise_all=True)
    met = every.draw(np.random.default_rng(2), 30, task.steps)
    both_ways(square, task, network, met, 30, threads)
    both_ways(square, task, network, None, 30, threads)


def test_shells_and_sensors_are_mujoco_s(square):
    """A thousand poses, each of a robot with a shape of its own."""
    rng, n = np.random.default_rng(3), 1000
    poses = rng.uniform([-0.464, -0.464, -np.pi], [0.464, 0.464, np.pi], (n, 3))
    shapes = rng.uniform([[-0.001], [0.0]], [[0.0065], [0.003]], (2, n))
    bodies = replace(Bodies.own(n), wider=shapes[0], set_back=shapes[1])
    rolling, on_wheels = KinematicRobots(square, n), MujocoRobots(square, n, 1)
    found, expected = [], []
    for robots, readings in ((rolling, found), (on_wheels, expected)):
        robots.embody(bodies)
        readings.append(robots.reset(poses))
    np.testing.assert_allclose(found[0].distance, expected[0].distance, atol=1e-9)
    np.testing.assert_allclose(rolling.clearances(), on_wheels.clearances(), atol=1e-9)
    # MuJoCo tells of touches after a step
    touch = on_wheels.step(np.zeros((n, 2))).contact
    np.testing.assert_array_equal(found[0].contact, touch)
    assert 5 < touch.sum() < n / 2


def test_any_chunking_gives_the_same_bits(square):
    task, n = TaskParameters(steps=50), 24
    starts, policy = starts_in(square, n), controllers(n, Network())
    met = Conditions("calibrated").draw(np.random.default_rng(1), n, task.steps)
    assert met is not None
    compiled = FusedTrials(square, task, 1)
    whole = compiled(policy, starts, met, 1, np.full(n, -np.inf))
    for size in (1, 5, 23):
        for first in range(0, n, size):
            part = slice(first, min(first + size, n))
            some = compiled(
                policy[part], starts[part], met[part], 1, np.full(n, -np.inf)[part]
            )
            np.testing.assert_array_equal(some.fitness, whole.fitness[part])


def test_a_race_breaks_off_who_can_only_lose_and_nobody_else(square):
    task, trials, n = TaskParameters(steps=100), 3, 40
    starts = np.tile(starts_in(square, trials), (n, 1))
    network = Network()
    rng = np.random.default_rng(5)
    genomes = rng.normal(0, 5, (n, network.n_genes))
    policy = network.decode(np.repeat(genomes, trials, axis=0))
    engine = BatchEngine(square, task, 2)
    free = engine.run(Work(policy, starts))
    fitness = free.fitness.reshape(n, trials).mean(axis=1)
    to_beat = np.where(rng.random(n) < 0.5, np.sort(fitness)[n // 2], 50.0)
    raced = engine.run(Work(policy, starts, Race(to_beat, trials)))
    won = fitness >= to_beat
    assert 0 < won.sum() < n
    np.testing.assert_array_equal(
        raced.fitness.reshape(n, trials)[won], free.fitness.reshape(n, trials)[won]
    )
    got = raced.fitness.reshape(n, trials).mean(axis=1)
    assert (got[~won] < to_beat[~won]).all()
    assert raced.steps.sum() < 0.9 * free.steps.sum()


def test_trials_without_compiled_code_go_step_by_step(square, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my.py").write_text(
        "def far(facts):\n    return facts.distance.max(axis=-1)\n"
    )
    task = TaskParameters(steps=20, fitness="my.py:far")
    assert compiled_trials(square, task) is None
    assert compiled_trials(square, TaskParameters()) is not None
    assert compiled_trials(load_scene("epuck", "arena"), TaskParameters()) is None
    policy = controllers(6, Network())
    trials = BatchEngine(square, task).run(Work(policy, starts_in(square, 6)))
    assert (trials.fitness > 0).all()
    # any other policy, too
    by_hand = Everybody(WallFollower())
    trials = BatchEngine(square, TaskParameters(100)).run(
        Work(by_hand, starts_in(square, 6))
    )
    assert trials.fitness.mean() > 20


def test_the_table_gives_this_rung_by_its_name(square):
    assert isinstance(robots_in(square, 3), KinematicRobots)
    assert isinstance(robots_in(load_scene("epuck", "arena"), 3), MujocoRobots)
    assert square.robot == MODELS / "epuck.xml"


GEOMS = (
    '<geom type="box" pos="{x} {y} .03" size=".03 .06 .03" euler="0 0 {a}"/>',
    '<geom type="box" pos="{x} {y} .02" size=".04 .03 .05" euler="{a} 20 50"/>',
    '<geom type="cylinder" pos="{x} {y} .03" size=".04 .03"/>',
    '<geom type="cylinder" pos="{x} {y} .03" size=".03 .05" euler="90 {a} 0"/>',
    '<geom type="capsule" pos="{x} {y} .03" size=".03 .02"/>',
    '<geom type="capsule" pos="{x} {y} .035" size=".02 .05" euler="90 {a} 0"/>',
    '<geom type="sphere" pos="{x} {y} .03" size=".05"/>',
    '<geom type="ellipsoid" pos="{x} {y} .03" size=".03 .07 .04" euler="0 0 {a}"/>',
    '<geom type="mesh" mesh="m" pos="{x} {y} 0" euler="0 0 {a}"/>',
    '<geom type="plane" pos="{x} {y} 0" size="0 0 1" zaxis="-1 -{b} 0"/>',
)
MESH = (
    '<asset><mesh name="m" vertex="0 0 0 .1 0 0 .02 .08 0 '
    '0 0 .07 .1 0 .07 .02 .08 .07"/></asset>'
)


def arena_of(path: Path, rng: np.random.Generator) -> Scene:
    """A scene with one geom of each kind, somewhere."""
    geoms = []
    for i, geom in enumerate(GEOMS):
        x, y = 0.35 * (i % 3 - 1), 0.3 * (i // 3 - 1)
        if "plane" in geom:
            x, y = 0.6, 0.0
        x, y = np.round(rng.normal((x, y), 0.01), 4)
        a, b = np.round(rng.uniform([0, 0], [180, 0.3]), 3)
        geoms.append(geom.format(x=x, y=y, a=a, b=b))
    path.write_text(
        f"<mujoco>{MESH}<worldbody>"
        f'<geom type="plane" size="2 2 1"/>{"".join(geoms)}</worldbody></mujoco>'
    )
    return load_scene(ROBOT, str(path))


@pytest.mark.parametrize("seed", range(10))
def test_rays_and_clearance_are_mujoco_s(tmp_path, seed):
    """A thousand poses in each of ten arenas with all kinds of geoms."""
    rng = np.random.default_rng(seed)
    scene = arena_of(tmp_path / "arena.xml", rng)
    poses = rng.uniform([-0.6, -0.6, -np.pi], [0.5, 0.6, np.pi], (1000, 3))
    clearance = ClearanceProbe(scene, 1).measure(poses).distance
    poses, clearance = poses[clearance > 0], clearance[clearance > 0]
    assert len(poses) > 400
    expected = MujocoRobots(scene, len(poses), 1).reset(poses).distance
    expected[expected > 1e4] = -1.0
    found = KinematicRobots(scene, len(poses)).reset(poses)
    far = found.distance > 1e4
    np.testing.assert_allclose(np.where(far, -1, found.distance), expected, atol=1e-9)
    assert (found.distance < 0).any()
    assert not found.contact.any()
    # whatever a grid leaves out is out of reach
    plan = plan_of(scene, 0.04, 0.1)
    own = np.zeros((len(poses), N_OWN))
    near = sensed(plan, at_rest(poses), own, 0.04)
    seen = (found.distance >= 0) & (found.distance <= 0.04)
    np.testing.assert_array_equal(near, np.where(seen, found.distance, -1))
    plan = plan_of(scene, ENDLESS, 0.1)
    states = at_rest(poses)
    walls = plan.solid._replace(
        grid=Grid(0.0, 0.0, 1.0, 0, 0),
        first=np.array([0, len(plan.solid.sides) + len(plan.solid.ellipses)]),
        near=np.arange(len(plan.solid.sides) + len(plan.solid.ellipses)),
    )
    own = [distance_to(walls, 0, s[X], s[Y]) - plan.body.shell for s in states]
    close = clearance < CLEARANCE_MAX
    # a lean box is nearer below or above the shell than where the shell can touch it
    off = np.array(own)[close] - clearance[close]
    # MuJoCo's distance of convex shapes is found by iteration, to 1e-9
    assert off.min() > -2e-9
    assert np.quantile(np.abs(off), 0.5) < 1e-9


@pytest.mark.parametrize(
    ("geom", "words"),
    [
        ('<geom name="lean" type="capsule" size=".02 .05" euler="30 0 0"/>', "stands"),
        ('<geom name="lean" type="cylinder" size=".02 .05" euler="30 0 0"/>', "lies"),
        (
            '<geom name="lean" type="ellipsoid" size=".1 .2 .3" euler="9 0 0"/>',
            "upright",
        ),
        ('<body><freejoint/><geom name="lean" size=".02"/></body>', "it moves"),
        ('<geom name="lean" type="hfield" hfield="h"/>', "hfield"),
    ],
)
def test_what_cannot_be_cut_is_refused_by_name(tmp_path, geom, words):
    path = tmp_path / "arena.xml"
    field = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    path.write_text(
        f'<mujoco>{field}<worldbody><geom type="plane" size="1 1 1"/>'
        f"{geom}</worldbody></mujoco>"
    )
    with pytest.raises(UserError) as error:
        robots_in(load_scene(ROBOT, str(path)), 1)
    message = str(error.value)
    assert "geom 'lean'" in message
    assert words in message
    assert "--robot epuck" in message


def test_motion_is_that_of_a_lagging_drive_without_slip(square):
    """Against the equations, integrated in steps of a microsecond's hundredfold."""
    robots, start = KinematicRobots(square, 1), np.array([[0.05, -0.1, 0.4]])
    robots.reset(start)
    plan = plan_of(square, ENDLESS, 0.1)
    x, y, yaw, ahead, around = *start[0], 0.0, 0.0
    dt = 2e-5
    for command in ([5.0, 3.0], [-4.0, 4.0], [6.0, 6.0]):
        robots.step(np.array([command]))
        left, right = command
        for _ in range(round(0.1 / dt)):
            ahead += dt / plan.lag[0] * ((left + right) / 2 - ahead)
            around += dt / plan.lag[1] * ((right - left) / 2 - around)
            speed = plan.body.wheel_radius * ahead
            x += dt * speed * np.cos(yaw)
            y += dt * speed * np.sin(yaw)
            yaw += dt * 2 * plan.body.wheel_radius / plan.body.track * around
    np.testing.assert_allclose(robots.poses()[0], [x, y, yaw], atol=2e-5)


def test_the_path_does_not_depend_on_the_control_step(square):
    """The lag is exact: one step of 0.2 s or ten of 0.02 s."""
    slow = load_scene(ROBOT, "arena", 0.2)
    fast = load_scene(ROBOT, "arena", 0.02)
    one, ten = KinematicRobots(slow, 1), KinematicRobots(fast, 1)
    for robots, n in ((one, 1), (ten, 10)):
        robots.reset(np.zeros((1, 3)))
        for _ in range(n):
            robots.step(np.array([[5.0, 2.0]]))
    np.testing.assert_allclose(one.poses(), ten.poses(), atol=1e-12)
    assert substeps(0.1) == (5, 0.02)
    assert substeps(0.03)[0] == 2


def test_a_touch_within_a_control_step_is_a_crash_and_the_robot_stays_there(square):
    # at full speed it would be 12 mm farther
    start = np.array([[0.5 - 0.035 - 0.006, 0.0, 0.0]])
    robots = KinematicRobots(square, 1)
    robots.reset(start)
    reading = robots.step(np.array([[6.28, 6.28]]))
    assert reading.contact.all()
    assert robots.poses()[0, 0] == pytest.approx(0.465, abs=0.0028)
    # it grazes a wall in the middle of a turn on the way
    robots.reset(np.array([[0.5 - 0.0351, 0.0, np.pi / 2]]))
    assert not robots.step(np.array([[6.0, 6.0]])).contact.any()


def test_states_keep_their_heading(square):
    robots = KinematicRobots(square, 1)
    robots.reset(np.zeros((1, 3)))
    for _ in range(2000):
        robots.step(np.array([[3.0, -2.9]]))
    state = robots._states[0]
    yaw = robots.poses()[0, 2]
    assert abs(yaw) <= np.pi
    np.testing.assert_allclose([state[COS], state[SIN]], [np.cos(yaw), np.sin(yaw)])


def test_heavier_robots_lag_longer_and_larger_wheels_may_turn_faster(square):
    robots = KinematicRobots(square, 2)
    robots.embody(replace(Bodies.own(2), mass=np.array([0.5, 2.0])))
    robots.reset(np.array([[0, 0, 0.0], [0, 0.2, 0.0]]))
    robots.step(np.full((2, 2), 7.0))
    light, heavy = robots.poses()[:, 0]
    assert light > heavy + 1e-4
    robots.disembody()
    robots.reset(np.zeros((1, 3)))
    robots.step(np.full((1, 2), 7.0))
    whole = robots.poses()[0, 0]
    robots.reset(np.zeros((1, 3)))
    robots.step(np.full((1, 2), 6.283185307179586))
    assert robots.poses()[0, 0] == whole


EVOLVED = """
import sys
from tests.test_kinematic import evolved
for robot in sys.argv[1:]:
    print(evolved(robot))
"""

CONFIG = """
robot: {robot}
evaluations: 120
steps: 60
trials: 3
noise: calibrated
optimizer:
  algorithm: differential_evolution
  strategy: best
  population: 30
  scale: 0.7
  crossover: 0.9
"""


def evolved(robot: str) -> str:
    """History of a run."""
    config = ExperimentConfig.from_yaml(CONFIG.format(robot=robot), "config")
    evolution = Evolution(config, threads=1)
    list(evolution.run())
    return evolution.history()


def test_every_processor_gives_the_same_bits():
    """One without any extensions, numpy's own choice of them switched off."""
    plain = {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512_SKX AVX512_ICL",
    }
    there = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", EVOLVED, *ON_WHEELS],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env={**os.environ, **plain},
        cwd=Path(__file__).parent.parent,
        check=True,
    ).stdout
    here = "".join(f"{evolved(robot)}\n" for robot in ON_WHEELS)
    assert here.count("\n") > 3 * len(ON_WHEELS)
    assert there == here


def from_elsewhere(file: Path) -> set[str]:
    """Modules of ours from which compiled functions of a file have names."""
    tree = ast.parse(file.read_text())
    origins = {
        name.asname or name.name: each.module
        for each in tree.body
        if isinstance(each, ast.ImportFrom) and each.module
        for name in each.names
    }
    used = {
        name.id
        for function in tree.body
        if isinstance(function, ast.FunctionDef)
        and any("compiled" in ast.unparse(each) for each in function.decorator_list)
        for name in ast.walk(function)
        if isinstance(name, ast.Name)
    }
    modules = {origins[name] for name in used & set(origins)}
    return {name for name in modules if name.startswith("epuck_mj.")}


def test_compiled_code_is_kept_by_all_that_it_uses():
    """numba keeps the values of constants: a change elsewhere would go unnoticed."""
    package = Path(compiling.__file__).parents[3]
    found = set().union(*map(from_elsewhere, compiling.SOURCES))
    assert "epuck_mj.step.bodies" in found
    files = {package / f"{name.replace('.', '/')}.py" for name in found}
    assert files <= set(compiling.SOURCES)


def test_code_that_cannot_be_kept_is_compiled_again(monkeypatch):
    monkeypatch.setattr(compiling, "FOLDERS", [])
    assert compiling.compiled()(lambda x: x + 1)(2) == 3


@pytest.fixture
def teller():
    """A new one beside the process's own, which may have told already."""
    teller = compiling._Teller()
    event.register("numba:compile", teller)
    yield teller
    event.unregister("numba:compile", teller)


def test_compiling_is_told_once_and_only_where_there_is_some(
    teller, tmp_path, monkeypatch, capsys
):
    def add(x):
        return x + 1

    monkeypatch.setattr(compiling, "FOLDERS", [tmp_path])
    # the process's own may tell as well
    capsys.readouterr()
    for arguments in ((1,), (1.0,)):
        assert compiling.compiled()(add)(*arguments) == 2
    first, last = capsys.readouterr().err.splitlines()[-2:]
    assert first.endswith("simulator, which is done once on this computer ...")
    assert re.fullmatch(r"compiled in \d+\.\d s", last)
    # kept: another process would find it
    again = compiling._Teller()
    event.register("numba:compile", again)
    try:
        assert compiling.compiled()(add)(1) == 2
    finally:
        event.unregister("numba:compile", again)
    assert capsys.readouterr().err == ""


def test_a_cache_that_breaks_costs_time_only(tmp_path, monkeypatch):
    def twice(x):
        return 2 * x

    def breaks(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(compiling, "FOLDERS", [tmp_path])
    monkeypatch.setattr(caching.IndexDataCacheFile, "save", breaks)
    assert compiling.compiled()(twice)(2) == 4
    monkeypatch.undo()
    monkeypatch.setattr(compiling, "FOLDERS", [tmp_path])
    assert compiling.compiled()(twice)(2) == 4
    # what a power cut leaves of an index
    (index,) = tmp_path.rglob("*.nbi")
    index.write_bytes(b"")
    assert compiling.compiled()(twice)(2) == 4
    assert index.stat().st_size > 0
