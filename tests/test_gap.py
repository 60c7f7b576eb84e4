"""The reality gap: worlds that cover what may differ, and honest arithmetic on them."""

import json
import re
from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread
from matplotlib.legend import Legend

from epuck_mj.constants import BODY_RADIUS, TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model_files import MODELS
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.disturbances import ALL_RANGES
from epuck_mj.step.motors import Speeds
from evolution.gap import worlds as gap_worlds
from evolution.gap.__main__ import measure_gap
from evolution.gap.figure import gap_figure
from evolution.gap.gap_document import gap_document
from evolution.gap.groups import experiments, labels, peers
from evolution.gap.outcomes import Outcome, ideal, in_worlds
from evolution.gap.slowed import with_slowed
from evolution.gap.transfer import (
    Gap,
    Transfer,
    between_robots,
    rank_correlations,
    verdict,
)
from evolution.gap.worlds import (
    KINDS,
    LOGARITHMS,
    WHOLE,
    WORLD_RANGES,
    World,
    met,
    worlds,
)
from evolution.named_policies import NamedPolicy, named_policies
from evolution.pages.blocks import to_markdown
from tests import shipped

CHAMPION = shipped.champion_file()
NOMINAL = World(
    kind="usual",
    number=0,
    arena="arena",
    period=0.1,
    curve=1.0,
    gain_spread=0.0,
    light=1.0,
    count_noise=0.0,
    wheel_radius=WHEEL_RADIUS,
    bias=0.0,
    battery=1.0,
    track=TRACK,
    slip=0.0,
    slipping=0,
    grip=1.0,
    latency=0,
    mass=1.0,
    friction=1.0,
    body_radius=BODY_RADIUS,
    set_back=0.0,
)
FOLLOWER = NamedPolicy("wall-follower", WallFollower(), TaskParameters(steps=100))


@pytest.mark.parametrize("kind", KINDS)
def test_a_hypercube_covers_every_range_evenly(kind):
    n, own = 60, KINDS[kind]
    found = worlds(n, kind)
    choices: dict = {"arena": own.arenas}
    for name, (low, high) in own.ranges.items():
        if name in WHOLE:
            choices[name] = range(int(low), int(high) + 1)
            continue
        values = np.array([getattr(world, name) for world in found])
        ends = np.array([low, high])
        if low == high:
            assert (values == low).all(), name
            continue
        if name in LOGARITHMS:
            values, ends = np.log(values), np.log(ends)
        part = np.floor((values - ends[0]) / np.ptp(ends) * n).astype(int)
        assert sorted(part) == list(range(n)), name
    for name, each in choices.items():
        counts = [[getattr(w, name) for w in found].count(c) for c in each]
        assert counts == [n // len(each)] * len(each), name
    assert worlds(n, kind) == found
    assert worlds(n + 1, kind)[:3] != found[:3]


def test_ranges_half_as_wide_again_are_those_of_robots_that_can_be():
    """About the same middle, but nothing below 0, no battery above its full speed."""
    wider = KINDS["beyond"].ranges
    assert set(wider) == set(WORLD_RANGES)
    for name, expected in {
        "track": (0.0495, 0.0585),
        "body_radius": (0.03325, 0.03775),
        "count_noise": (0.0, 4.5),
        "battery": (0.85, 1.0),
        "latency": (0, 4),
        "grip": (0.0, 1.0),
        "curve": (1.5**-1.5, 1.5**1.5),
    }.items():
        assert wider[name] == pytest.approx(expected), name
    # what worlds share with robots that evolution randomises
    for name in ("body_radius", "set_back", "light", "battery", "slipping", "grip"):
        assert WORLD_RANGES[name] == getattr(ALL_RANGES, name)


def test_calibrated_gains_differ_from_the_published_ones_by_about_a_tenth():
    places = worlds(100, "calibrated-gains")
    factors = np.log([met(world, 2, 1).gains[0] for world in places])
    common = factors.mean(axis=1)
    # eight sensors' own gains do not cancel each other
    assert np.log(1.1) / 2 < np.abs(common).max() < 2 * np.log(1.1)
    assert np.log(1.1) / 4 < np.std(factors - common[:, None]) < np.log(1.1)
    for world in places:
        assert abs(np.log(world.curve * world.light)) <= np.log(1.1)
        assert world.gain_spread <= np.log(1.1)
    same = set(WORLD_RANGES) - {"curve", "light", "gain_spread"}
    for name in same:
        assert KINDS["calibrated-gains"].ranges[name] == WORLD_RANGES[name], name


def test_starts_differ_from_world_to_world(monkeypatch):
    seen = []
    starts = gap_worlds.starts_in
    monkeypatch.setattr(
        "evolution.gap.outcomes.starts_in",
        lambda *given: seen.append(starts(*given)) or seen[-1],
    )
    places = [NOMINAL, replace(NOMINAL, number=1), replace(NOMINAL, kind="beyond")]
    for _ in range(2):
        list(in_worlds([FOLLOWER], places, "epuck_kinematic", 3, 1))
    for i in range(3):
        np.testing.assert_array_equal(seen[i], seen[i + 3])
        assert (seen[i] != seen[i - 1]).any()


def test_a_world_has_one_robot_and_new_noise_in_each_trial():
    world = replace(worlds(4)[1], slipping=2, grip=0.25, slip=0.0, latency=1)
    one, again = met(world, 5, 9), met(world, 5, 9)
    other = met(replace(world, number=2), 5, 9)
    shared = ("gains", "age", "wheel_gains", "turn_gain", "latency", "mass")
    for name in (*shared, "wider", "set_back", "wheel_noise"):
        values = getattr(one, name)
        assert (values == values[0]).all(), name
        np.testing.assert_array_equal(getattr(again, name), values)
    assert (one.count_noise[0] != one.count_noise[1]).any()
    assert (one.gains != other.gains).any()
    radius = one.wheel_gains[0].mean() * WHEEL_RADIUS / world.battery
    np.testing.assert_allclose(radius, world.wheel_radius)
    np.testing.assert_allclose(BODY_RADIUS + one.wider, world.body_radius)
    np.testing.assert_allclose(one.set_back, world.set_back)
    np.testing.assert_allclose(1 + one.wheel_noise[0, :, 0], [1, 0.25, 0.25, *[1] * 6])
    brighter = met(replace(world, light=2 * world.light), 5, 9)
    np.testing.assert_allclose(brighter.gains, 2 * one.gains)
    left, right = one.wheel_gains[0]
    np.testing.assert_allclose((left - right) / one.wheel_gains[0].mean(), world.bias)
    np.testing.assert_allclose(TRACK / one.turn_gain, world.track)
    assert (one.latency == world.latency).all()


@pytest.mark.parametrize("robot", RUNGS)
def test_a_nominal_world_keeps_everything(robot):
    (nominal,) = ideal([FOLLOWER], robot, 20, 1)
    ((same,),) = in_worlds([FOLLOWER], [NOMINAL], robot, 20, 1)
    # counts and whole steps are all that is left
    assert abs(same.fitness / nominal.fitness - 1) < 0.05
    assert same.collisions_per_minute < 1
    worse = replace(NOMINAL, latency=3, curve=0.7)
    ((hurt,),) = in_worlds([FOLLOWER], [worse], robot, 20, 1)
    assert hurt.fitness < 0.5 * nominal.fitness
    # so wide that its sensors are farther out: walls seem nearer
    thick = replace(NOMINAL, body_radius=0.037)
    ((wide,),) = in_worlds([FOLLOWER], [thick], robot, 20, 1)
    assert wide.fitness != same.fitness


def test_a_slowed_policy_is_itself_at_another_speed():
    """In a world without noise, three times as slow, it keeps off walls as well."""
    at_speeds = with_slowed([FOLLOWER], (0.04, 0.5 * 0.04, 0.04, 0.13))
    assert [each.name for each in at_speeds] == [
        "wall-follower",
        "wall-follower at 0.04 m/s",
        "wall-follower at 0.02 m/s",
    ]
    own, slow = (each.task.speeds for each in at_speeds[:2])
    assert slow.turn / own.turn == pytest.approx(slow.forward / own.forward)
    assert all(each.policy is FOLLOWER.policy for each in at_speeds)
    assert with_slowed([FOLLOWER], ()) == [FOLLOWER]
    late = replace(NOMINAL, latency=2)
    ((fast, slower, _),) = in_worlds(at_speeds, [late], "epuck_kinematic", 20, 1)
    assert slower.crash_rate < fast.crash_rate


def test_ideal_robots_in_another_arena():
    (nominal,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1)
    (same,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1, "arena")
    (small,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1, "small_square")
    assert same == nominal
    # no wall is far away
    assert small.fitness > 1.1 * nominal.fitness


def test_threads_and_company_change_nothing():
    other = named_policies(str(CHAMPION))
    places = worlds(3)[:2]
    alone = list(in_worlds([FOLLOWER], places, "epuck_kinematic", 4, 1))
    both = list(in_worlds([*other, FOLLOWER], places, "epuck_kinematic", 4, 2))
    assert [outcomes[-1] for outcomes in both] == [outcomes[0] for outcomes in alone]


def test_a_trial_lasts_as_long_in_every_world():
    """Faster control steps are more of them; a mean step is worth the same."""
    for period in (0.075, 0.125):
        ((found,),) = in_worlds(
            [FOLLOWER], [replace(NOMINAL, period=period)], "epuck_kinematic", 20, 1
        )
        (nominal,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1)
        assert abs(found.fitness / nominal.fitness - 1) < 0.2


def outcomes(fitness, collisions):
    pairs = zip(fitness, collisions, strict=True)
    return [Outcome(f, c, c / 4) for f, c in pairs]


TRANSFER = Transfer.of(
    outcomes([0.5, 0.4, 0.1], [0, 0, 0]),
    # in the second world's arena, the second policy would be better
    [outcomes([0.5, 0.6 if world == 1 else 0.3, 0.1], [0] * 3) for world in range(4)],
    [
        outcomes([0.5, 0.4, 0.1], [0.0, 0.5, 2.0]),
        outcomes([0.41, 0.3, 0.0], [0.0, 0.0, 0.0]),
        outcomes([0.2, 0.4, 0.3], [0.0, 1.0, 0.0]),
        outcomes([0.3, 0.3, 0.3], [0.0, 0.0, 0.0]),
    ],
)


LATENCY = np.array([0, 2, 2, 0])


def test_shares_and_mastered_worlds():
    np.testing.assert_allclose(TRANSFER.share[:, 0], [1, 0.82, 0.4, 0.6])
    np.testing.assert_allclose(TRANSFER.share[:, 1], [1, 0.5, 1, 0.75])
    np.testing.assert_array_equal(
        TRANSFER.mastered,
        [
            [True, True, False],
            [True, False, False],
            [False, False, True],
            [False, False, True],
        ],
    )
    against_nominal = TRANSFER.mastered_against_nominal
    # a collision a minute is too many, whatever it is measured against
    assert against_nominal[:, 1].tolist() == [True, False, False, False]
    kinder = replace(TRANSFER, reference=2 * TRANSFER.reference)
    assert not kinder.mastered[:, 0].any()
    np.testing.assert_array_equal(kinder.mastered_against_nominal, against_nominal)
    found = verdict(TRANSFER, 0)
    assert found.nominal == 0.5
    np.testing.assert_allclose(found.share.value, np.mean([1, 0.82, 0.4, 0.6]))
    np.testing.assert_allclose(found.median_share, 0.71)
    assert found.mastered.value == 0.5
    assert found.mastered.low < 0.5 < found.mastered.high
    # nothing kept of nothing, and no division by it
    nothing = Transfer(np.zeros(1), *[np.zeros((2, 1))] * 4)
    assert not nothing.share.any()
    assert verdict(nothing, 0).mastered.value == 0


def test_rank_correlations_of_hand_made_worlds():
    nominal = np.array([5.0, 4.0, 3.0, 2.0, 1.0])
    worlds = np.array([nominal * 2, nominal**2, [1, 2, 3, 5, 4], np.ones(5)])
    # a sixth is slower, and best everywhere
    all_nominal = np.append(nominal, 0.0)
    in_worlds = np.column_stack([worlds, np.full(4, 99.0)])
    transfer = Transfer(all_nominal, *[in_worlds] * 4)
    fast = range(5)
    found = rank_correlations(transfer, fast)
    assert found is not None
    # as nominal, as nominal, another order; the fourth says nothing
    third = np.corrcoef(nominal, [1, 2, 3, 5, 4])[0, 1]
    np.testing.assert_allclose(found["nominal"], (1 + 1 + third) / 3)
    np.testing.assert_allclose(found["worlds"], (1 + third + third) / 3)
    assert between_robots(transfer, transfer, fast) == pytest.approx(1)
    mixed = rank_correlations(transfer, range(6))
    assert mixed is not None
    assert mixed["nominal"] < found["nominal"]
    for few in (range(4), [5]):
        assert rank_correlations(transfer, few) is None
        assert between_robots(transfer, transfer, few) is None
    # none at all is a correlation, too
    unrelated = np.array([[2.0, 5.0, 3.0, 1.0, 4.0]] * 2)
    found = rank_correlations(Transfer(nominal, *[unrelated] * 4), fast)
    assert found == pytest.approx({"nominal": 0.0, "worlds": 1.0})
    alike = Transfer(np.ones(5), *[np.ones((3, 5))] * 4)
    assert rank_correlations(alike, fast) is between_robots(alike, alike, fast) is None


def test_policies_are_grouped_by_experiment_and_by_speed():
    slow = TaskParameters(speeds=Speeds(0.04))
    policies = [
        NamedPolicy("runs/paper/de-best/seed-1", WallFollower(), TaskParameters()),
        NamedPolicy("runs/paper/de-best/seed-2", WallFollower(), slow),
        NamedPolicy("runs/wheels/de-best/seed-1", WallFollower(), TaskParameters()),
        NamedPolicy("runs/paper/ga/seed-1", WallFollower(), slow),
        NamedPolicy("a/champion.json", WallFollower(), TaskParameters()),
        NamedPolicy("b/champion.json", WallFollower(), TaskParameters()),
        FOLLOWER,
    ]
    assert experiments(policies) == {
        "runs/paper/de-best": [0, 1],
        "runs/wheels/de-best": [2],
        "ga": [3],
        "a/champion.json": [4],
        "b/champion.json": [5],
        "wall-follower": [6],
    }
    both = with_slowed([policies[0], policies[2], FOLLOWER], (0.04,))
    slowly = experiments(both)
    assert slowly == {
        "runs/paper/de-best": [0],
        "runs/paper/de-best at 0.04 m/s": [1],
        "runs/wheels/de-best": [2],
        "runs/wheels/de-best at 0.04 m/s": [3],
        "wall-follower": [4],
        "wall-follower at 0.04 m/s": [5],
    }
    assert labels(both, slowly)["wall-follower at 0.04 m/s"] == (
        "hand-written wall follower at 0.04 m/s"
    )
    assert peers(both) == {"0.129 m/s": [0, 2, 4], "0.04 m/s": [1, 3, 5]}
    # a run that says nothing of its config has no other name
    assert list(labels(policies, experiments(policies)).values())[-2:] == [
        "b/champion.json",
        "hand-written wall follower",
    ]
    assert peers(policies) == {"0.129 m/s": [0, 2, 4, 5, 6], "0.04 m/s": [1, 3]}


def test_the_document_says_who_kept_what():
    names = ["a/seed-1", "a/seed-2", "b"]
    groups = {"a": [0, 1], "b": [2]}
    transfers, peers_of = {"epuck": TRANSFER}, {"0.1 m/s": [0, 1, 2]}
    gap = Gap("usual", names, transfers, groups, peers_of, 5, LATENCY)
    text = to_markdown(gap_document([gap, replace(gap, kind="corners")]))
    assert "3 policies, unchanged, in 4 worlds" in text
    titles = "| n | usual worlds | outer corners and posts | nominal | kept |"
    assert titles in text
    # fitness 0.3525 and 0.35, crashes in none and in 9.4 % of the trials
    there = "0.351, 4.7%"
    assert f"| a | 0.1 m/s | epuck | 2 | {there} | {there} | 0.450 | 76% |" in text
    (first, *_) = re.findall(r"\| a \| a/seed-1 \| .*", text)
    assert re.match(r"\| a \| a/seed-1 \| 0\.352 \[.*\] \| 0\.0% \[0", first)
    assert "50% [15%, 85%]" in text
    # kept 70.5 % and 81.25 %, mastered 50 % and 25 %
    assert "| a | epuck | 2 | 0.450 | 76% | 0.2 | 38% | 38% |" in text
    # of three policies, ranks say nothing
    assert "Ranks" not in text
    members = [0, 1, 2, 0, 1]
    more = Transfer(
        *(getattr(TRANSFER, f.name)[..., members] for f in fields(TRANSFER))
    )
    both = {"epuck": more, "epuck_kinematic": more}
    ranked = to_markdown(
        gap_document(
            [Gap("usual", [*"abcde"], both, groups, {"0.1 m/s": range(5)}, 5, LATENCY)]
        )
    )
    assert (
        "- 5 policies of 0.1 m/s, epuck: between nominal fitness and a world, "
        in ranked
    )
    assert "by mean fitness over the worlds, 1.00" in ranked
    # late in the second and the third world: fitness 0.305 and 0.35, crashes 0, 12.5 %
    assert "| experiment | robot | n | 0 | 2 |" in text
    assert "| a | epuck | 2 | 0.375, 3.1% | 0.328, 6.2% |" in text


def test_the_figure_names_experiments_as_reports_do():
    policies = [*named_policies(str(shipped.CHAMPION)), FOLLOWER]
    groups = experiments(policies)
    members = [0, 1]
    transfer = Transfer(
        *(getattr(TRANSFER, f.name)[..., members] for f in fields(TRANSFER))
    )
    names = [policy.name for policy in policies]
    gaps = [
        Gap(kind, names, {"epuck": transfer}, groups, {"fast": members}, 5, LATENCY)
        for kind in KINDS
    ]
    figure = gap_figure(gaps, labels(policies, groups))
    (legend,) = figure.legends
    assert isinstance(legend, Legend)
    titles = [text.get_text() for text in legend.get_texts()]
    assert titles == [kind.title for kind in KINDS.values()]
    fitness, crashes = figure.axes
    assert [text.get_text() for text in fitness.get_yticklabels()] == [
        "DE/best/1/bin (1)",
        "hand-written wall follower (1)",
    ]
    for axes, values in ((fitness, transfer.fitness), (crashes, transfer.crash_rate)):
        assert len(axes.lines) == len(KINDS)
        drawn = np.asarray(axes.lines[0].get_xdata())
        np.testing.assert_allclose(drawn, values.mean(axis=0))


def test_the_command_writes_what_it_measured(tmp_path, capsys, monkeypatch):
    output = tmp_path / "new" / "gap"
    arguments = ["wall-follower", str(CHAMPION), "--output", str(output)]
    small = ["--worlds", "3", "--starts", "2", "--robot", "epuck_kinematic"]
    small += ["--speeds", "0.04"]
    seen: dict[tuple[str, int], list[Outcome]] = {}
    seen_ideal: dict[str | None, list[Outcome]] = {}

    def watched(policies, places, *others):
        each = zip(places, in_worlds(policies, places, *others), strict=True)
        for place, found in each:
            seen[place.kind, place.number] = found
            yield found

    def watched_ideal(policies, robot, n, threads, arena=None):
        seen_ideal[arena] = ideal(policies, robot, n, threads, arena)
        return seen_ideal[arena]

    with monkeypatch.context() as patch:
        patch.setattr("evolution.gap.gap_folder.in_worlds", watched)
        patch.setattr("evolution.gap.gap_folder.ideal", watched_ideal)
        assert measure_gap([*arguments, *small]) == 0
    names = {path.name for path in output.iterdir()}
    pictures = {"gap.png", "gap.svg", "gap.pdf"}
    assert names == {"gap.md", "summary.md", "gap.json", "gap.parquet", *pictures}
    assert (output / "gap.md").read_text() in capsys.readouterr().out
    record = json.loads((output / "gap.json").read_text())
    assert {
        kind: len(each) for kind, each in record["worlds"].items()
    } == dict.fromkeys(KINDS, 3)
    kinds_of = record["robots"]["epuck_kinematic"]
    slow = "wall-follower at 0.04 m/s"
    assert list(kinds_of["usual"])[:3] == ["wall-follower", slow, str(CHAMPION)]
    rows = pd.read_parquet(output / "gap.parquet").to_dict("records")
    assert len(rows) == 4 * 3 * len(KINDS)
    for row in rows:
        kind, world = row["kind"], row["number"]
        i = list(kinds_of[kind]).index(row["policy"])
        there = seen[kind, world][i]
        assert row["fitness"] == there.fitness
        assert row["crash_rate"] == there.crash_rate
        assert row["collisions_per_minute"] == there.collisions_per_minute
        # `ideal` is asked for where all evolved, and then for each arena
        home, own = seen_ideal[None][i], seen_ideal[row["arena"]][i]
        assert row["reference"] == max(home.fitness, own.fitness)
        assert row["arena"] == record["worlds"][kind][world]["arena"]
    frame = pd.DataFrame(rows)
    frame["share"] = frame.fitness / frame.reference
    for group, own in frame.groupby(["kind", "policy"]):
        assert isinstance(group, tuple)
        told = kinds_of[group[0]][group[1]]
        for column in ("fitness", "crash_rate", "share"):
            assert told[column]["value"] == pytest.approx(own[column].mean())
        assert told["collisions"]["value"] == pytest.approx(
            own.collisions_per_minute.mean()
        )
    assert imread(output / "gap.png").shape[1] > 1000
    first = (output / "gap.json").read_bytes()
    monkeypatch.setattr("evolution.gap.gap_folder.write_figure", lambda *_: None)
    some = tmp_path / "some"
    kinds = ["--kinds", "calibrated-gains", "corners", "calibrated-gains"]
    assert measure_gap([*arguments[:3], str(some), *small, *kinds]) == 0
    fewer = json.loads((some / "gap.json").read_text())["robots"]["epuck_kinematic"]
    assert fewer == {kind: kinds_of[kind] for kind in ("calibrated-gains", "corners")}
    page = (some / "gap.md").read_text()
    assert "Worlds with calibrated gains have" in page
    assert "sual worlds" not in page
    assert "Worlds: gains calibrated to 10 %. " in page
    assert measure_gap([*arguments, *small]) == 0
    assert (output / "gap.json").read_bytes() == first


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "expected run or study directories"),
        (["nowhere"], "no champion in 'nowhere'"),
        (
            ["wall-follower", "--worlds", "1"],
            "from 2 to 1,000, got 1",
        ),
        (
            ["wall-follower", "--starts", "0"],
            "from 2 to 1,000, got 0",
        ),
        (["wall-follower", "--threads", "-1"], "threads"),
        (
            ["wall-follower", "--kinds", "usual", "odd"],
            "no kind of worlds 'odd'; available: usual, .*, calibrated-gains",
        ),
        (["wall-follower", "--speeds", "0.04", "-1"], "--speeds.*, got -1"),
        (["wall-follower", "--speeds", "3"], "--speeds.*got 3"),
        (["wall-follower", "--robot", "tank"], "no robot 'tank'"),
    ],
)
def test_bad_input_is_one_line(arguments, words, tmp_path):
    with pytest.raises(UserError, match=words) as error:
        measure_gap([*arguments, "--output", str(tmp_path / "gap")])
    assert "\n" not in str(error.value)


def test_every_arena_of_the_worlds_is_shipped():
    for arena in (*gap_worlds.ARENAS, *gap_worlds.CORNERS):
        ((found,),) = in_worlds(
            [FOLLOWER], [replace(NOMINAL, arena=arena)], "epuck_kinematic", 2, 1
        )
        assert 0 <= found.fitness <= 1


def test_where_the_kinematic_robot_cannot_drive_wheels_are_enough(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("evolution.gap.gap_folder.write_gap", lambda *told: asked(told))
    driven: list[str] = []

    def asked(told: tuple) -> None:
        driven.extend(told[2])
        (told[0] / "gap.md").write_text("")

    arena = tmp_path / "leaning.xml"
    leaning = '<geom name="mast" type="cylinder" size=".02 .1" euler="20 0 0"/>'
    square = (MODELS / "arena.xml").read_text()
    arena.write_text(square.replace("</worldbody>", f"{leaning}</worldbody>"))
    known = load_controller(CHAMPION)
    there = replace(known, origin=replace(known.origin, arena=str(arena)))
    (tmp_path / "champion.json").write_text(there.to_json())
    arguments = [str(tmp_path / "champion.json"), "--output", str(tmp_path / "gap")]
    assert measure_gap(arguments) == 0
    assert driven == ["epuck"]
    said = capsys.readouterr().err
    assert said.startswith("not driven on epuck_kinematic: arena '")
    assert said.count("\n") == 1
    with pytest.raises(UserError, match="'mast' has no exact outline"):
        measure_gap([*arguments, "--robot", "epuck_kinematic"])
