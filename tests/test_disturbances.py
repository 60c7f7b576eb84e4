"""Disturbances: robots as real ones, the same for everybody, the same at any speed."""

import dataclasses
import json

import numpy as np
import pytest

from epuck_mj.constants import BODY_RADIUS, STEP_RATE_MAX, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.policies.network import Network
from epuck_mj.rungs.disturbed import DisturbedRobots
from epuck_mj.rungs.mujoco_batch import MujocoRobots
from epuck_mj.rungs.table import RUNGS, robots_in
from epuck_mj.rungs.watched_robot import WatchedRobot
from epuck_mj.scene.changed_robots import with_body_radius, with_sensors_set_back
from epuck_mj.scene.model import load_scene
from epuck_mj.scene.robot_parts import ROBOT_BODY
from epuck_mj.step.bodies import Bodies
from epuck_mj.step.calibration import Calibration
from epuck_mj.step.conditions import Conditions
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import (
    ALL_RANGES,
    BOOK,
    NOISE,
    RANGES,
    Disturbances,
    Noise,
    draw_calibrated,
    draw_disturbances,
    with_slipping_start,
)
from epuck_mj.step.motors import STEP_ANGLE, wheel_speeds
from epuck_mj.step.sensors import proximity
from evolution.judging import evaluation
from evolution.judging.evaluation import BatchEngine, DmControlEngine, Work, evaluate
from evolution.run.generation_loop import Evolution, make_engine
from evolution.settings.config import ExperimentConfig

TASK = TaskParameters(steps=40)
STEPS = TASK.steps
QUIET = Noise(counts=0.0, wheels=0.0, age=0.0)
STARTS = np.array([[0.0, 0.0, 0.3], [0.42, 0.1, 1.5], [-0.2, -0.43, 3.0]])
FULL = wheel_speeds(np.array([STEP_RATE_MAX, STEP_RATE_MAX]))


@pytest.fixture(scope="module", params=RUNGS)
def scene(request):
    return load_scene(request.param, "arena", TASK.control_step)


def drawn(n, noise=NOISE["calibrated"], ranges=RANGES, seed=0, **changes):
    assert noise is not None
    found = draw_disturbances(np.random.default_rng(seed), n, STEPS, noise, ranges)
    return dataclasses.replace(found, **changes)


def genomes(n, seed=1):
    return np.random.default_rng(seed).uniform(-5, 5, (n, Network().n_genes))


def robots_on(scene, starts, disturbances) -> DisturbedRobots:
    robots = robots_in(scene, len(starts), 1)
    return DisturbedRobots(robots, disturbances, TASK.control_step)


def driven(scene, starts, disturbances, command, steps=10) -> np.ndarray:
    """Poses `(steps + 1, n, 3)` under one command for all."""
    robots = robots_on(scene, starts, disturbances)
    robots.reset(starts)
    poses = [robots.poses()]
    for _ in range(steps):
        robots.step(np.tile(command, (len(starts), 1)))
        poses.append(robots.poses())
    return np.array(poses)


def test_draws_stay_in_their_ranges_and_come_from_their_seed():
    many = drawn(3000)
    for name, (low, high) in {
        "gains": RANGES.gain,
        "mass": RANGES.mass,
        "friction": RANGES.friction,
        "latency": RANGES.latency,
    }.items():
        values = getattr(many, name)
        assert low <= values.min() < values.max() <= high
    radius, track = many.wheel_gains * WHEEL_RADIUS, TRACK / many.turn_gain
    assert RANGES.wheel_radius[0] <= radius.min() < radius.max()
    assert radius.max() <= RANGES.wheel_radius[1]
    assert RANGES.track[0] <= track.min() < track.max() <= RANGES.track[1]
    assert abs(many.count_noise.std() - 1) < 0.01
    assert abs(many.wheel_noise.std() - 0.03) < 0.001
    # weaker and stronger sensors are as likely
    assert abs(np.median(np.log(many.gains)) - np.log(RANGES.gain).mean()) < 0.02
    for field in dataclasses.fields(Disturbances):
        again, other = drawn(3000), drawn(3000, seed=1)
        value = getattr(many, field.name)
        np.testing.assert_array_equal(getattr(again, field.name), value)
        same = field.name in ("of", "known_gains", "lag", "wider", "set_back")
        assert same or (getattr(other, field.name) != value).any()


def test_the_book_has_one_robot():
    found = drawn(5, ranges=BOOK)
    for name in ("gains", "wheel_gains", "turn_gain", "mass", "friction"):
        np.testing.assert_allclose(getattr(found, name), 1, rtol=1e-12)
    assert not any(each.any() for each in (found.latency, found.wider, found.set_back))


def test_robots_that_differ_in_everything():
    """Beyond the ranges of randomised robots, whose draws stay as they are."""
    some, every = drawn(3000), drawn(3000, ranges=ALL_RANGES)
    for name in ("age", "count_noise", "turn_gain", "latency", "mass", "friction"):
        np.testing.assert_array_equal(getattr(every, name), getattr(some, name))
    radius = BODY_RADIUS + every.wider
    light = (every.gains / some.gains)[:, 0]
    battery = (every.wheel_gains / some.wheel_gains)[:, 0]
    for values, (low, high) in (
        (radius, ALL_RANGES.body_radius),
        (every.set_back, ALL_RANGES.set_back),
        (light, ALL_RANGES.light),
        (battery, ALL_RANGES.battery),
    ):
        tenth = 0.1 * (high - low)
        assert low - 1e-12 <= values.min() < low + tenth
        assert high - tenth < values.max() <= high + 1e-12
    # one light for all sensors, one battery for both wheels
    np.testing.assert_allclose(every.gains / some.gains, np.tile(light, (8, 1)).T)
    np.testing.assert_allclose(
        every.wheel_gains[:, 1] / some.wheel_gains[:, 1], battery
    )
    less = (1 + every.wheel_noise) / (1 + some.wheel_noise)
    slips = less[..., 0] < 1 - 1e-9
    most = ALL_RANGES.slipping[1]
    assert set(slips.sum(axis=1)) == set(range(most + 1))
    for late, slipping, grip in zip(some.latency, slips, less, strict=True):
        n = slipping.sum()
        np.testing.assert_array_equal(np.flatnonzero(slipping), late + np.arange(n))
        np.testing.assert_allclose(grip[slipping], grip[late, 0])


def test_a_start_that_slips_is_a_slower_one(scene):
    """One step late, two steps with a half of the speed, then all of it."""
    late, slipping = np.array([1]), np.array([2])
    noise = with_slipping_start(
        np.zeros((1, STEPS, 2)), late, slipping, np.array([0.5])
    )
    met = drawn(1, QUIET, BOOK, latency=late, wheel_noise=noise)
    way = np.diff(driven(scene, STARTS[:1], met, FULL, 6)[:, 0, :2], axis=0)
    whole, *steps = (np.linalg.norm(way, axis=1)[[-1, 0, 2, 4]]).tolist()
    np.testing.assert_allclose(np.array(steps) / whole, [0, 0.5, 1], atol=0.02)


def test_arrays_that_do_not_belong_together_are_refused():
    with pytest.raises(ValueError, match="expected gains"):
        drawn(3, gains=np.ones((3, 7)))


def test_without_disturbances_a_robot_counts_and_steps_and_that_is_all(scene):
    quiet = drawn(len(STARTS), QUIET, BOOK)
    robots, ideal = robots_on(scene, STARTS, quiet), robots_in(scene, 3, 1)
    seen, true = robots.reset(STARTS), ideal.reset(STARTS)
    np.testing.assert_array_equal(seen.truth, true.distance)
    assert seen.proximity is not None
    np.testing.assert_array_equal(seen.proximity, np.rint(proximity(true.distance)))
    near = (true.distance >= 0) & (true.distance < 0.04)
    assert near.any()
    # half a count, where they are fewest, is less than a quarter of a millimetre
    error = np.abs(seen.distance - true.distance)[near]
    assert error.max() < 2.5e-4
    # 1000 steps/s are what the motors can do; 526 is the nearest they make of 510
    for command, speed in ((FULL, 1000), (0.51 * FULL, 10_000 / 19)):
        poses = driven(scene, STARTS[:1], quiet[:1], command)
        way = np.linalg.norm(poses[-1, 0, :2] - poses[2, 0, :2])
        expected = 0.8 * WHEEL_RADIUS * wheel_speeds(np.array(speed))
        np.testing.assert_allclose(way, expected, rtol=0.01)


def test_latency_is_whole_control_steps(scene):
    late = drawn(1, QUIET, BOOK, latency=np.array([3]))
    poses = driven(scene, STARTS[:1], late, FULL)
    way = np.linalg.norm(np.diff(poses[:, 0, :2], axis=0), axis=1)
    assert way[:3].max() < 1e-4
    assert way[4:].min() > 0.01


def test_wheels_and_track_change_the_way(scene):
    plain = driven(scene, STARTS[:1], drawn(1, QUIET, BOOK), FULL)
    larger = drawn(1, QUIET, BOOK, wheel_gains=np.full((1, 2), 1.05))
    way, longer = (
        np.linalg.norm(poses[-1, 0, :2] - poses[0, 0, :2])
        for poses in (plain, driven(scene, STARTS[:1], larger, FULL))
    )
    np.testing.assert_allclose(longer / way, 1.05, rtol=0.005)
    uneven = drawn(1, QUIET, BOOK, wheel_gains=np.array([[1.0, 0.9]]))
    # the weaker right wheel turns the robot right
    assert driven(scene, STARTS[:1], uneven, FULL)[-1, 0, 2] < 0.2
    spin = FULL * [0.2, -0.2]
    wider = drawn(1, QUIET, BOOK, turn_gain=np.array([0.8]))
    turn, less = (
        poses[-1, 0, 2] - poses[0, 0, 2]
        for poses in (
            driven(scene, STARTS[:1], drawn(1, QUIET, BOOK), spin),
            driven(scene, STARTS[:1], wider, spin),
        )
    )
    np.testing.assert_allclose(less / turn, 0.8, rtol=0.02)


def test_readings_have_an_age(scene):
    """A robot that nears a wall believes itself where it was."""
    toward = np.array([[0.4, 0.0, 0.0]])
    old = drawn(1, QUIET, BOOK, age=np.full((1, 8), 0.05))
    robots = robots_on(scene, toward, old)
    before = robots.reset(toward)
    after = robots.step(FULL[None] / 2)
    assert before.truth is not None
    assert after.truth is not None
    expected = (before.truth[0, 0] + after.truth[0, 0]) / 2
    np.testing.assert_allclose(after.distance[0, 0], expected, atol=3e-4)


def test_bodies_are_heavier_and_slide():
    scene = load_scene("epuck", "arena", TASK.control_step)
    robots = MujocoRobots(scene, 2, 1)
    two = np.array([1.0, 2.0])
    own, half = Bodies.own(2), np.array([1.0, 0.5])
    robots.embody(dataclasses.replace(own, mass=two, friction=half, lag=two))
    model = scene.model
    body, wheel = model.body(ROBOT_BODY).id, model.geom("epuck/wheel_left").id
    mass, friction = (
        robots._batch.expand(name) for name in ("body_mass", "geom_friction")
    )
    np.testing.assert_allclose(mass[:, body], model.body_mass[body] * np.array([1, 2]))
    np.testing.assert_allclose(friction[:, wheel, 0], [0.9, 0.45])
    shell = model.geom("epuck/shell").id
    np.testing.assert_allclose(friction[:, shell], [model.geom_friction[shell]] * 2)
    gain = robots._batch.expand("actuator_gainprm")
    np.testing.assert_allclose(gain[1], model.actuator_gainprm / 2)
    # and the next robots have their own again
    robots.embody(own)
    np.testing.assert_array_equal(mass, [model.body_mass] * 2)
    np.testing.assert_array_equal(gain, [model.actuator_gainprm] * 2)


SHAPES = {"wider": [0.002, -0.001, 0.0], "set_back": [0.0, 0.002, 0.001]}


def shaped():
    wider, set_back = (np.array(each) for each in SHAPES.values())
    return drawn(3, QUIET, BOOK, wider=wider, set_back=set_back)


def test_readings_are_from_where_the_sensors_are(scene):
    """As those of a robot that is so in its MJCF; and of the next ideal ones."""
    robots = robots_in(scene, 3, 1)
    met = DisturbedRobots(robots, shaped(), TASK.control_step)
    found, clearance = met.reset(STARTS), met.clearances()
    for i, (wider, back) in enumerate(zip(*SHAPES.values(), strict=True)):
        other = with_body_radius(scene, BODY_RADIUS + wider)
        other = with_sensors_set_back(other, back - wider)
        one = robots_in(other, 1, 1)
        expected = one.reset(STARTS[i : i + 1])
        assert found.truth is not None
        np.testing.assert_allclose(found.truth[i], expected.distance[0], atol=1e-12)
        np.testing.assert_allclose(clearance[i], one.clearances()[0], atol=1e-9)
    robots.disembody()
    ideal = robots.reset(STARTS).distance
    np.testing.assert_array_equal(ideal, robots_in(scene, 3, 1).reset(STARTS).distance)
    assert (np.abs(ideal - found.truth) > 5e-4).any()


def test_a_wider_body_touches_sooner(scene):
    """With 1.5 mm from the shell to a wall, one of 2 mm more is a crash."""
    beside = np.tile([0.5 - BODY_RADIUS - 0.0015, 0.0, np.pi / 2], (3, 1))
    robots = robots_on(scene, beside, shaped())
    robots.reset(beside)
    reading = robots.step(np.zeros((3, 2)))
    np.testing.assert_array_equal(reading.contact, [True, False, False])


def test_nothing_of_the_robot_is_seen_by_its_own_sensors(tmp_path):
    """However far they are set back: MuJoCo's rays meet wheels."""
    floor = '<geom type="plane" size="2 2 1"/>'
    arena = tmp_path / "nothing.xml"
    arena.write_text(f"<mujoco><worldbody>{floor}</worldbody></mujoco>")
    far = ALL_RANGES.set_back[1] + BODY_RADIUS - ALL_RANGES.body_radius[0]
    robots = MujocoRobots(load_scene("epuck", str(arena)), 1, 1)
    robots.embody(dataclasses.replace(Bodies.own(1), set_back=np.array([1.5 * far])))
    assert (robots.reset(np.zeros((1, 3))).distance == -1).all()


def test_a_watched_robot_moves_and_senses_as_in_a_batch():
    scene = load_scene("epuck", "arena", TASK.control_step)
    met, start = drawn(1, ranges=ALL_RANGES), STARTS[:1]
    watched = DisturbedRobots(WatchedRobot(scene), met, TASK.control_step)
    batch = robots_on(scene, start, met)
    for robots in (watched, batch):
        robots.reset(start)
    for _ in range(5):
        one, other = (robots.step(FULL[None]) for robots in (watched, batch))
        np.testing.assert_array_equal(one.distance, other.distance)
        np.testing.assert_array_equal(watched.clearances(), batch.clearances())


@pytest.mark.parametrize("robot", RUNGS)
def test_ideal_robots_have_nothing_of_the_disturbed_ones_before_them(robot):
    engine = BatchEngine(load_scene(robot, "arena", TASK.control_step), TASK, 1)
    met, population = drawn(3, ranges=ALL_RANGES), genomes(5)

    def trials(disturbances):
        return evaluate(
            engine, Network(), population, STARTS, disturbances=disturbances
        ).trial_fitness

    ideal, disturbed = trials(None), trials(met)
    assert (ideal != disturbed).any()
    np.testing.assert_array_equal(trials(None), ideal)
    np.testing.assert_array_equal(trials(met), disturbed)


@pytest.mark.parametrize(
    "ranges", [BOOK, RANGES, ALL_RANGES], ids=["book", "randomised", "all"]
)
def test_threads_chunks_and_company_change_nothing(scene, ranges, monkeypatch):
    met, population = drawn(3, ranges=ranges), genomes(7)

    def trials(threads):
        engine = BatchEngine(scene, TASK, threads)
        return evaluate(
            engine, Network(), population, STARTS, disturbances=met
        ).trial_fitness

    expected = trials(1)
    np.testing.assert_array_equal(trials(2), expected)
    # chunks that break individuals up
    monkeypatch.setattr(evaluation, "CAPACITY", 4)
    np.testing.assert_array_equal(trials(1), expected)
    alone = evaluate(
        BatchEngine(scene, TASK, 1), Network(), population[4:5], STARTS, None, met
    )
    np.testing.assert_array_equal(alone.trial_fitness, expected[4:5])


def test_fitness_is_judged_by_the_truth(scene):
    """Sensors that see walls everywhere earn nothing by it."""
    blind = drawn(1, QUIET, BOOK, gains=np.full((1, 8), 1e3))
    middle = np.zeros((1, 3))
    engine = BatchEngine(scene, TASK, 1)
    found = evaluate(engine, Network(), genomes(5), middle, disturbances=blind)
    # what lies within the range of a wall at last, and no more
    ideal = evaluate(engine, Network(), genomes(5), middle)
    assert found.fitness.max() <= max(5.0, ideal.fitness.max())


CONFIG = ExperimentConfig.from_yaml(
    "{noise: calibrated, randomise: true, evaluations: 60, steps: 25, trials: 2, "
    "optimizer: {algorithm: differential_evolution, strategy: best, "
    "population: 12, scale: 0.8, crossover: 0.9}}",
    "test",
)


CALIBRATION = Calibration((0.7,) * 4 + (1.3,) * 4, (0.0201, 0.0204), 0.055, 1, 1.5)


def test_a_config_keeps_the_calibration_not_its_path(tmp_path):
    CALIBRATION.save(tmp_path / "robot.yaml")
    path = json.dumps(str(tmp_path / "robot.yaml"))
    text = CONFIG.to_yaml().replace("randomise: true", "randomise: false")
    text = text.replace("calibration: null", f"calibration: {path}")
    config = ExperimentConfig.from_yaml(text, "test")
    assert config.calibration == CALIBRATION
    kept = config.to_yaml()
    assert str(tmp_path) not in kept
    (tmp_path / "robot.yaml").unlink()
    assert ExperimentConfig.from_yaml(kept, "test") == config


def test_a_known_robot_differs_from_one_whose_gains_nobody_knows(scene):
    known = draw_calibrated(CALIBRATION, np.random.default_rng(0), 3, STEPS, QUIET)
    robots = robots_on(scene, STARTS, known)
    deceived = robots_on(
        scene, STARTS, dataclasses.replace(known, known_gains=np.ones((3, 8)))
    )
    reading, other = robots.reset(STARTS), deceived.reset(STARTS)
    np.testing.assert_array_equal(reading.proximity, other.proximity)
    assert reading.truth is not None
    near = (reading.truth > 0) & (reading.truth < 0.04)
    assert near.any()
    np.testing.assert_allclose(reading.distance[near], reading.truth[near], atol=2e-3)
    assert np.abs(other.distance - reading.truth)[near].min() > 1e-3


@pytest.mark.parametrize("lag", [0.5, 2.0])
def test_a_slower_drive_is_behind_by_its_lag(scene, lag):
    """Once at speed, it is its way in what its time constant is longer behind."""
    ahead = np.array([200, 200]) * STEP_ANGLE
    ends = []
    for each in (1.0, lag):
        own = draw_calibrated(
            Calibration(lag=each), np.random.default_rng(0), 1, 10, QUIET
        )
        robots = robots_on(scene, np.array([[-0.3, 0.0, 0.0]]), own)
        robots.reset(np.array([[-0.3, 0.0, 0.0]]))
        for _ in range(10):
            robots.step(ahead[None])
        ends.append(robots.poses()[0, 0])
    behind = (lag - 1) * 0.0175 * 200 * STEP_ANGLE * WHEEL_RADIUS
    assert ends[0] - ends[1] == pytest.approx(behind, rel=0.15)


def histories(config, **settings):
    experiment = Evolution(config, threads=1, **settings)
    steps = sum(record.control_steps for record in experiment.run())
    return experiment.history(), steps


def test_racing_and_seed_under_noise():
    raced, fewer = histories(CONFIG)
    lived, all_of_them = histories(CONFIG, racing=False)
    assert raced == lived
    assert fewer < all_of_them
    own = {"randomise": False, "calibration": CALIBRATION}
    other = {"randomise_all": True}
    for change in ({"seed": 2}, {"noise": "strong"}, {"randomise": False}, own, other):
        changed = CONFIG.model_copy(update=change)
        assert histories(changed)[0] != raced


def test_noise_of_generations_differs():
    first, second = (
        draw_disturbances(np.random.default_rng(seed), 2, 25, NOISE["strong"] or QUIET)
        for seed in (1, 2)
    )
    assert not np.array_equal(first.count_noise, second.count_noise)


@pytest.mark.parametrize("keys", [{}, {"randomise": True}])
def test_an_unknown_level_is_refused_at_once(keys):
    with pytest.raises(ValueError, match=r"^unknown noise 'loud'; available: none,"):
        Conditions("loud", **keys)


def test_what_makes_no_sense_is_refused():
    for keys, message in {
        "randomise: true": "^test: randomise needs noise: .* or strong, got none$",
        "randomise_all: true": "^test: randomise_all needs noise: .*, got none$",
        "calibration: {}, noise: strong, randomise_all: true": "got both",
        "calibration: {track: 0.05}": "calibration needs noise: calibrated or strong",
        "calibration: {}, noise: strong, randomise: true": "got both",
        "calibration: {tracks: 0.05}": "calibration: unknown tracks; available: prox",
        "calibration: {track: -1}": "track: expected a number above 0, .*, got -1",
        "calibration: {track: 53}": "lengths are metres.*, got 53",
        "calibration: {track: true}": "at most 1 m .*, got True",
        f"calibration: {{track: {'9' * 400}}}": "at most 1 m .*, got 9{57}[.]{3}",
        "calibration: {proximity_gains: [.nan, 1, 1, 1, 1, 1, 1, 1]}": "got nan",
        "calibration: [1, 2]": "expected keys of proximity_gains, wheel_radii, track",
        "calibration: {wheel_radii: 0.02}": "expected 2 wheel_radii, got 0.02",
        "calibration: no.yaml": "^test: calibration: cannot read 'no.yaml'",
    }.items():
        text = f"{{{keys}, optimizer: {{algorithm: random_search}}}}"
        with pytest.raises(UserError, match=message) as caught:
            ExperimentConfig.from_yaml(text, "test")
        assert "\n" not in str(caught.value)
    scene = load_scene("epuck", "arena")
    with pytest.raises(UserError, match=r"ideal robots only.*calibrated"):
        make_engine("dm_control", scene, CONFIG, 1)
    with pytest.raises(ValueError, match="no disturbances"):
        work = Work(Network().decode(genomes(1)), STARTS[:1], None, drawn(1))
        DmControlEngine(scene, TASK).run(work)
    robots = robots_on(scene, STARTS, drawn(2))
    with pytest.raises(ValueError, match="expected 2 starts, got 3"):
        robots.reset(STARTS)
