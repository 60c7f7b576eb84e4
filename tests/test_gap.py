"""The reality gap: worlds that cover what may differ, and honest arithmetic on them."""

import csv
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from matplotlib.image import imread
from matplotlib.legend import Legend

from epuck_mj.constants import TRACK, WHEEL_RADIUS
from epuck_mj.errors import UserError
from epuck_mj.policies.file import load_controller
from epuck_mj.policies.wall_follower import WallFollower
from epuck_mj.rungs.table import RUNGS
from epuck_mj.scene.model_files import MODELS
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.motors import Speeds
from evolution.gap import worlds as gap_worlds
from evolution.gap.__main__ import measure_gap
from evolution.gap.figure import kept_figure
from evolution.gap.gap_document import gap_document
from evolution.gap.groups import experiments, labels, peers
from evolution.gap.outcomes import Outcome, abroad, ideal
from evolution.gap.transfer import (
    Gap,
    Transfer,
    between_robots,
    rank_correlations,
    verdict,
)
from evolution.gap.worlds import ARENAS, LATENCY_MAX, WORLD_RANGES, World, met, worlds
from evolution.named_policies import NamedPolicy, named_policies
from evolution.pages.blocks import to_markdown
from evolution.pages.style import LOOKS
from tests import shipped

CHAMPION = shipped.champion_file()
HOME = World(
    arena="arena",
    period=0.1,
    curve=1.0,
    gain_spread=0.0,
    count_noise=0.0,
    wheel_radius=WHEEL_RADIUS,
    bias=0.0,
    track=TRACK,
    slip=0.0,
    latency=0,
    mass=1.0,
    friction=1.0,
)
FOLLOWER = NamedPolicy("wall-follower", WallFollower(), TaskParameters(steps=100))


def test_a_hypercube_covers_every_range_evenly():
    n = 40
    found = worlds(n)
    for name, (low, high) in WORLD_RANGES.items():
        values = np.array([getattr(world, name) for world in found])
        values = np.log(values) if name == "curve" else values
        part = np.floor((values - low) / (high - low) * n).astype(int)
        assert sorted(part) == list(range(n)), name
    for name, choices in (("arena", ARENAS), ("latency", range(LATENCY_MAX + 1))):
        counts = [[getattr(w, name) for w in found].count(c) for c in choices]
        assert counts == [n // len(choices)] * len(choices), name
    assert worlds(n) == found
    assert worlds(n + 1)[:3] != found[:3]


def test_a_world_has_one_robot_and_new_noise_in_each_trial():
    world = worlds(4)[1]
    one, again, other = met(world, 1, 5, 9), met(world, 1, 5, 9), met(world, 2, 5, 9)
    for name in ("gains", "age", "wheel_gains", "turn_gain", "latency", "mass"):
        values = getattr(one, name)
        assert (values == values[0]).all(), name
        np.testing.assert_array_equal(getattr(again, name), values)
    assert (one.count_noise[0] != one.count_noise[1]).any()
    assert (one.gains != other.gains).any()
    np.testing.assert_allclose(
        one.wheel_gains[0].mean() * WHEEL_RADIUS, world.wheel_radius
    )
    left, right = one.wheel_gains[0]
    np.testing.assert_allclose((left - right) / one.wheel_gains[0].mean(), world.bias)
    np.testing.assert_allclose(TRACK / one.turn_gain, world.track)
    assert (one.latency == world.latency).all()


@pytest.mark.parametrize("robot", RUNGS)
def test_a_world_like_home_keeps_everything(robot):
    (home,) = ideal([FOLLOWER], robot, 20, 1)
    ((same,),) = abroad([FOLLOWER], [HOME], robot, 20, 1)
    # counts and whole steps are all that is left
    assert abs(same.fitness / home.fitness - 1) < 0.05
    assert same.collisions_per_minute < 1
    worse = replace(HOME, latency=3, curve=0.7)
    ((hurt,),) = abroad([FOLLOWER], [worse], robot, 20, 1)
    assert hurt.fitness < 0.5 * home.fitness


def test_ideal_robots_in_another_arena():
    (home,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1)
    (same,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1, "arena")
    (small,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1, "small_square")
    assert same == home
    # no wall is far away
    assert small.fitness > 1.1 * home.fitness


def test_threads_and_company_change_nothing():
    other = named_policies(str(CHAMPION))
    places = worlds(3)[:2]
    alone = list(abroad([FOLLOWER], places, "epuck_kinematic", 4, 1))
    both = list(abroad([*other, FOLLOWER], places, "epuck_kinematic", 4, 2))
    assert [outcomes[-1] for outcomes in both] == [outcomes[0] for outcomes in alone]


def test_a_trial_lasts_as_long_in_every_world():
    """Faster control steps are more of them; a mean step is worth the same."""
    for period in (0.075, 0.125):
        ((found,),) = abroad(
            [FOLLOWER], [replace(HOME, period=period)], "epuck_kinematic", 20, 1
        )
        (home,) = ideal([FOLLOWER], "epuck_kinematic", 20, 1)
        assert abs(found.fitness / home.fitness - 1) < 0.2


def outcomes(fitness, collisions):
    return [Outcome(f, c, 0.0) for f, c in zip(fitness, collisions, strict=True)]


TRANSFER = Transfer.of(
    outcomes([0.5, 0.4, 0.1], [0, 0, 0]),
    # in the second world's arena, the second policy would be better than at home
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
    against_home = TRANSFER.mastered_against_home
    # a collision a minute is too many, whatever it is measured against
    assert against_home[:, 1].tolist() == [True, False, False, False]
    kinder = replace(TRANSFER, reference=2 * TRANSFER.reference)
    assert not kinder.mastered[:, 0].any()
    np.testing.assert_array_equal(kinder.mastered_against_home, against_home)
    found = verdict(TRANSFER, 0)
    assert found.home == 0.5
    np.testing.assert_allclose(found.share.value, np.mean([1, 0.82, 0.4, 0.6]))
    np.testing.assert_allclose(found.median_share, 0.71)
    assert found.mastered.value == 0.5
    assert found.mastered.low < 0.5 < found.mastered.high
    # nothing kept of nothing, and no division by it
    nothing = Transfer(np.zeros(1), *[np.zeros((2, 1))] * 3)
    assert not nothing.share.any()
    assert verdict(nothing, 0).mastered.value == 0


def test_rank_correlations_of_hand_made_worlds():
    home = np.array([5.0, 4.0, 3.0, 2.0, 1.0])
    worlds = np.array([home * 2, home**2, [1, 2, 3, 5, 4], np.ones(5)])
    # a sixth is slower, and best everywhere
    all_home = np.append(home, 0.0)
    abroad = np.column_stack([worlds, np.full(4, 99.0)])
    transfer = Transfer(all_home, abroad, abroad, abroad)
    fast = range(5)
    found = rank_correlations(transfer, fast)
    assert found is not None
    # as home, as home, another order; the fourth says nothing
    third = np.corrcoef(home, [1, 2, 3, 5, 4])[0, 1]
    np.testing.assert_allclose(found["home"], (1 + 1 + third) / 3)
    np.testing.assert_allclose(found["worlds"], (1 + third + third) / 3)
    assert between_robots(transfer, transfer, fast) == pytest.approx(1)
    mixed = rank_correlations(transfer, range(6))
    assert mixed is not None
    assert mixed["home"] < found["home"]
    for few in (range(4), [5]):
        assert rank_correlations(transfer, few) is None
        assert between_robots(transfer, transfer, few) is None
    # none at all is a correlation, too
    unrelated = np.array([[2.0, 5.0, 3.0, 1.0, 4.0]] * 2)
    found = rank_correlations(Transfer(home, *[unrelated] * 3), fast)
    assert found == pytest.approx({"home": 0.0, "worlds": 1.0})
    alike = Transfer(np.ones(5), *[np.ones((3, 5))] * 3)
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
    text = to_markdown(
        gap_document(Gap(names, transfers, groups, peers_of, 5, LATENCY))
    )
    assert "3 policies, unchanged, in 4 worlds" in text
    assert "| a | a/seed-1 | 0.500 |" in text
    assert "50% [15%, 85%]" in text
    # kept 70.5 % and 81.25 %, mastered 50 % and 25 %
    assert "| a | 0.1 m/s | epuck | 2 | 0.450 | 76% | 0.2 | 38% | 38% |" in text
    # of three policies, ranks say nothing
    assert "Ranks" not in text
    members = [0, 1, 2, 0, 1]
    more = Transfer(
        *(getattr(TRANSFER, f.name)[..., members] for f in fields(TRANSFER))
    )
    both = {"epuck": more, "epuck_kinematic": more}
    ranked = to_markdown(
        gap_document(
            Gap(list("abcde"), both, groups, {"0.1 m/s": range(5)}, 5, LATENCY)
        )
    )
    assert "- 5 policies of 0.1 m/s, epuck: between home and a world, " in ranked
    assert "by mean fitness over the worlds, 1.00" in ranked
    # late in the second and the third world: shares 0.82, 0.4 and 0.5, 1
    assert "| experiment | robot | n | 0 | 2 |" in text
    assert "| a | epuck | 2 | 84% | 68% |" in text


def test_the_figure_names_experiments_as_reports_do():
    policies = [*named_policies(str(shipped.CHAMPION)), FOLLOWER]
    groups = experiments(policies)
    members = [0, 1]
    transfer = Transfer(
        *(getattr(TRANSFER, f.name)[..., members] for f in fields(TRANSFER))
    )
    names = [policy.name for policy in policies]
    gap = Gap(names, {"epuck": transfer}, groups, {"fast": members}, 5, LATENCY)
    figure = kept_figure(gap, labels(policies, groups))
    (legend,) = figure.legends
    assert isinstance(legend, Legend)
    assert [text.get_text() for text in legend.get_texts()] == [
        "DE/best/1/bin (n = 1)",
        "hand-written wall follower (n = 1)",
    ]
    champion, follower, *_ = figure.axes[0].lines
    assert champion.get_color() == LOOKS["de-best"].color
    assert follower.get_color() == "black"


def test_the_command_writes_what_it_measured(tmp_path, capsys, monkeypatch):
    output = tmp_path / "new" / "gap"
    arguments = ["wall-follower", str(CHAMPION), "--output", str(output)]
    small = ["--worlds", "3", "--starts", "2", "--robot", "epuck_kinematic"]
    assert measure_gap([*arguments, *small]) == 0
    names = {path.name for path in output.iterdir()}
    pictures = {"gap.png", "gap.svg", "gap.pdf"}
    assert names == {"gap.md", "summary.md", "gap.json", "gap.csv", *pictures}
    assert (output / "gap.md").read_text() in capsys.readouterr().out
    record = json.loads((output / "gap.json").read_text())
    assert len(record["worlds"]) == 3
    policies = record["robots"]["epuck_kinematic"]
    assert list(policies) == ["wall-follower", str(CHAMPION)]
    with (output / "gap.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 3
    for row in rows:
        policy, world = policies[row["policy"]], int(row["world"])
        there = policy["abroad"][world]["fitness"]
        share = there / max(policy["home"], policy["ideal"][world])
        assert float(row["share"]) == pytest.approx(share, abs=1e-4)
        assert row["arena"] == record["worlds"][int(row["world"])]["arena"]
    assert imread(output / "gap.png").shape[1] > 1000
    first = (output / "gap.json").read_bytes()
    monkeypatch.setattr("evolution.gap.gap_folder.write_figure", lambda *_: None)
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
        (["wall-follower", "--robot", "tank"], "no robot 'tank'"),
    ],
)
def test_bad_input_is_one_line(arguments, words, tmp_path):
    with pytest.raises(UserError, match=words) as error:
        measure_gap([*arguments, "--output", str(tmp_path / "gap")])
    assert "\n" not in str(error.value)


def test_every_arena_of_the_worlds_is_shipped():
    for arena in gap_worlds.ARENAS:
        ((found,),) = abroad(
            [FOLLOWER], [replace(HOME, arena=arena)], "epuck_kinematic", 2, 1
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
