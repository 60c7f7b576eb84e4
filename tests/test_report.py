"""Reports: numbers checked by hand, pages that are sound, clear refusals."""

import csv
import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from markdown_it import MarkdownIt
from scipy import stats

from epuck_mj.errors import UserError
from epuck_mj.host.csv_text import csv_text
from evolution.judging.scores import HeldOut
from evolution.pages import figure_files
from evolution.pages.blocks import (
    STYLE,
    Code,
    Heading,
    Listing,
    Paragraph,
    Picture,
    Table,
    anchor,
    to_html,
    to_markdown,
    with_contents,
)
from evolution.pages.words import numbered, spread
from evolution.report.__main__ import report_study
from evolution.report.measures import BEST_STORED
from evolution.report.page import report_blocks
from evolution.report.report_folder import tables
from evolution.report.run_table import described_columns, run_rows
from evolution.report.samples import TARGET_SHARES
from evolution.report.sections.comparisons import compared, comparisons, comparisons_of
from evolution.report.sections.cost_of_targets import (
    cost_of_targets_section,
    target_costs,
)
from evolution.report.sections.held_out_fitness import held_out_fitness_section
from evolution.report.sections.success import (
    FOLLOWS,
    KEEPS_OFF,
    MATCHES,
    outcomes,
)
from evolution.report.sections.what_stored_fitness_promised import (
    WITH_NOISE,
    what_stored_fitness_promised_section,
)
from evolution.report.sections.what_was_run import scale_of
from evolution.report.summary_json import summary_fields, summary_text
from evolution.statistics.estimates import rank_correlation
from evolution.statistics.significance import holm, stars
from evolution.study.config import seeds_text
from evolution.study.data import load_study
from tests.processes import PATIENCE
from tests.study_on_disk import LEVELS, ROBOTS, history, write_study

NAMES = tuple(LEVELS)
N_OF = (1, 2, 3, 12)


def seeds(n):
    return {name: list(range(1, n + 1)) for name in NAMES}


def rows_of(text):
    return list(csv.DictReader(text.splitlines()))


@pytest.fixture
def bare(monkeypatch):
    """No figures: they take their time and have tests of their own."""
    monkeypatch.setattr("evolution.report.figures.drawn_figures", lambda data: iter(()))


@pytest.fixture(scope="module", params=N_OF, ids=lambda n: f"{n} seeds")
def study(request, tmp_path_factory):
    """A study of so many seeds of each experiment."""
    n = request.param
    return load_study(write_study(tmp_path_factory.mktemp("s") / "study", seeds(n)))


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    return load_study(write_study(tmp_path_factory.mktemp("l") / "study", seeds(12)))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A whole report, figures and all, of a study that lacks a run."""
    place = tmp_path_factory.mktemp("w")
    runs = {"de-best": [1, 2, 3], "ga": [1, 2]}
    path = write_study(place / "study", runs)
    assert report_study([str(path), "--output", str(place / "out"), "--ioh"]) == 0
    return place


# tables


def test_runs_read_back_exactly(study):
    rows = rows_of(tables(study)["runs.csv"])
    assert len(rows) == sum(map(len, study.runs.values()))
    for row in rows:
        run = next(
            r for r in study.runs[row["experiment"]] if r.seed == int(row["seed"])
        )
        assert float(row["epuck_mean"]) == run.held_out("epuck")
        assert float(row["stored"]) == run.scores.stored
        assert int(row["evaluations"]) == 3000
        # a generation that was repeated after a crash counts once
        assert int(row["control_steps"]) == 1900
        assert Path(row["path"]) == run.path
    columns = list(rows[0])
    described = rows_of(tables(study)["runs-columns.csv"])
    assert [row["column"] for row in described] == columns
    assert all(re.fullmatch("[a-z0-9_]+", column) for column in columns)
    assert all(row["meaning"] for row in described)
    fitness = next(row for row in described if row["column"] == "epuck_worst")
    assert fitness["unit"] == "fitness, at most 300"
    assert columns.index("epuck_mean") < columns.index("epuck_kinematic_mean")
    assert columns.index("epuck_kinematic_mean") < columns.index("stored")


def test_a_run_that_says_less_has_empty_cells(tmp_path):
    path = write_study(tmp_path / "study", seeds(2), packed=False)
    champion = path / "running/ga/seed-1/champion.json"
    fields = json.loads(champion.read_text())
    fields["scores"]["held_out"] = {
        robot: {"mean": 100.0, "crash_rate": 0.1, "starts": 1000}
        for robot in fields["scores"]["held_out"]
    }
    del fields["scores"]["best_stored"]
    champion.write_text(json.dumps(fields))
    (path / "running/ga/seed-1/timing.csv").write_text("generation,seconds\n")
    data = load_study(path)
    row = next(r for r in rows_of(tables(data)["runs.csv"]) if r["experiment"] == "ga")
    for column in ("epuck_worst", "epuck_following", "epuck_mean_low", "control_steps"):
        assert row[column] == ""
    # of a criterion that not every run can meet or fail nothing is said
    assert {each.criterion for each in outcomes(data)} == {MATCHES}
    json.loads(summary_text(summary_fields(data, "out", False)))


def test_pairs_by_hand(study):
    rows = rows_of(tables(study)["pairwise.csv"])
    assert len(rows) == 3 * 3
    samples = {n: study.held_out(n, "epuck") for n in NAMES}
    own = [row for row in rows if row["measure"] == "held-out epuck"]
    assert [(row["a"], row["b"]) for row in own] == list(combinations(NAMES, 2))
    p = [
        stats.mannwhitneyu(samples[r["a"]], samples[r["b"]], method="exact").pvalue
        for r in own
    ]
    for row, value, adjusted in zip(own, p, holm(np.array(p)), strict=True):
        a, b = samples[row["a"]], samples[row["b"]]
        wins = np.mean([(x > y) + (x == y) / 2 for x in a for y in b])
        assert float(row["a12"]) == pytest.approx(wins)
        assert float(row["u"]) == pytest.approx(wins * a.size * b.size)
        assert float(row["p"]) == pytest.approx(value)
        assert float(row["p_holm"]) == pytest.approx(adjusted)
        assert float(row["median_a"]) == np.median(a)
        difference = float(row["median_difference"])
        assert difference == np.median(a) - np.median(b)
        assert (int(row["n_a"]), row["family"]) == (a.size, "3")
        low, high = float(row["a12_low"]), float(row["a12_high"])
        if a.size < 5:
            assert math.isnan(low)
            assert math.isnan(high)
            assert math.isnan(float(row["median_difference_low"]))
        else:
            assert low <= wins <= high


def test_disturbed_champions_are_shown_with_their_disturbances(tmp_path):
    path = write_study(tmp_path / "study", seeds(2), packed=False)
    assert "disturbances" not in to_markdown(held_out_fitness_section(load_study(path)))
    for seed in (1, 2):
        champion = path / "running" / "ga" / f"seed-{seed}" / "champion.json"
        fields = json.loads(champion.read_text())
        test = fields["scores"]["held_out"]["epuck"]
        disturbed = {robot: test | {"mean": 40.0 + seed} for robot in ROBOTS}
        fields["scores"]["held_out_as_evolved"] = disturbed
        champion.write_text(json.dumps(fields))
    text = to_markdown(held_out_fitness_section(load_study(path)))
    assert "experiments that evolved with disturbances" in text
    assert "| GA | 2 | 41.5 (41.0, 42.0) |" in text


def test_no_stars_below_ten_runs(study):
    n = len(study.runs["ga"])
    for row in rows_of(tables(study)["pairwise.csv"]):
        assert row["stars"] == stars(float(row["p_holm"]), n)
    pairs = [pair for each in comparisons(study).values() for pair in each]
    for pair in pairs:
        text = compared(pair, "A", "B")
        assert pair.decided == (n >= 10 and pair.p_holm < 0.05)
        assert "significant" not in text
        assert ("no verdict" in text) == (n < 10)
    assert any(pair.decided for pair in pairs) == (n >= 10)


def test_words_name_the_better_one(large):
    pair, *_ = comparisons(large)["held-out epuck"]
    assert (pair.a, pair.b) == ("de-best", "de-rand")
    text = compared(pair, "A", "B")
    assert text.startswith("A beats B in 100% of the pairs of runs: medians ")
    # told from the other side, it is the same sentence
    assert pair.turned().of_a is pair.of_b
    assert compared(pair.turned(), "B", "A") == text
    # and the numbers are those of the test the other way round
    samples = {"de-rand": pair.of_b, "de-best": pair.of_a}
    (other,) = comparisons_of(samples, lambda a, b: True, 10)
    assert (other.a, other.b) == (pair.turned().a, pair.turned().b)
    assert other.a12.value == pytest.approx(pair.turned().a12.value)
    assert other.a12.high == pytest.approx(pair.turned().a12.high)
    assert other.shift.value == pair.turned().shift.value
    assert other.equivalence == pair.turned().equivalence
    assert other.shift.high == pytest.approx(pair.turned().shift.high, abs=5)


def test_equal_samples_are_no_error(tmp_path):
    path = write_study(tmp_path / "study", seeds(3), packed=False)
    for champion in path.glob("running/*/seed-*/champion.json"):
        fields = json.loads(champion.read_text())
        for test in fields["scores"]["held_out"].values():
            test["mean"] = 100.0
        champion.write_text(json.dumps(fields))
    data = load_study(path)
    rows = rows_of(tables(data)["pairwise.csv"])
    found = {
        tuple(float(row[column]) for column in ("p", "p_holm", "a12", "u"))
        for row in rows
        if row["measure"] != BEST_STORED
    }
    assert found == {(1, 1, 0.5, 4.5)}
    assert rank_correlation(np.full(5, 1.0), np.arange(5.0)) is None
    json.loads(summary_text(summary_fields(data, "out", False)))


def test_successes_by_hand(study):
    rows = rows_of(tables(study)["success.csv"])
    n = len(study.runs["ga"])
    assert len(rows) == 3 * 2 * (3 + 3)
    for row in rows:
        robot = row["robot"]
        runs = study.runs[row["experiment"]]
        if row["criterion"] == MATCHES:
            met = [run.held_out(robot) >= 195 for run in runs]
        else:
            shares = [run.scores.held_out[robot].behaviour for run in runs]
            lenient = row["criterion"] == FOLLOWS
            huggers = [s["hugger"] if lenient else 0 for s in shares]
            met = [
                s["wall follower"] + more >= 0.9
                for s, more in zip(shares, huggers, strict=True)
            ]
        assert (int(row["successes"]), int(row["n"])) == (sum(met), n)
        bounds = stats.binomtest(sum(met), n).proportion_ci(method="wilson")
        assert float(row["low"]) == pytest.approx(bounds.low)
        assert float(row["high"]) == pytest.approx(bounds.high)
        if row["other"]:
            other = int(row["other_successes"])
            table = [[sum(met), n - sum(met)], [other, n - other]]
            expected: Any = stats.fisher_exact(table)
            assert float(row["fisher_p"]) == pytest.approx(expected.pvalue)
            assert float(row["fisher_p_holm"]) >= float(row["fisher_p"])
        else:
            assert row["fisher_p"] == ""


def test_without_a_yardstick_nothing_is_measured_by_it(tmp_path, bare):
    path = write_study(tmp_path / "study", seeds(2), yardstick=False)
    assert {each.criterion for each in outcomes(load_study(path))} == {
        FOLLOWS,
        KEEPS_OFF,
    }
    assert report_study([str(path)]) == 0
    text = (path / "report/report.md").read_text()
    assert "not known, the hand-written wall follower was not tested" in text
    assert "- wall-follower: not tested" in text


def test_targets_by_hand(study):
    rows = rows_of(tables(study)["targets.csv"])
    assert len(rows) == 3 * len(TARGET_SHARES)
    for row in rows:
        name, target = row["experiment"], float(row["target"])
        hits, cost = [], 0.0
        for run in study.runs[name]:
            best = history(name, run.seed)[:, 2]
            reached = [i for i, value in enumerate(best) if value >= target]
            spent = run.history["evaluations"]
            hits += [spent[reached[0]]] if reached else []
            cost += spent[reached[0]] if reached else spent[-1]
        assert (int(row["hits"]), row["fitness"]) == (len(hits), "stored")
        assert int(row["n"]) == len(study.runs[name])
        expected = cost / len(hits) if hits else math.inf
        assert float(row["expected_running_time"]) == pytest.approx(expected)
        assert row["median_evaluations"] == (
            repr(float(np.median(hits))) if hits else ""
        )


def test_csv_has_exact_floats_and_quotes():
    rows = [{"a": 0.1 + 0.2, "b": None}, {"a": math.nan, "b": 'x, "y"'}]
    text = csv_text(["a", "b"], rows)
    assert text == 'a,b\n0.30000000000000004,\nnan,"x, ""y"""\n'


def test_summary_is_strict_json_and_has_everything(study):
    text = summary_text(summary_fields(study, "out", True))
    found = json.loads(text, parse_constant=pytest.fail)
    best = found["experiments"]["de-best"]
    sample = study.held_out("de-best", "epuck")
    fitness = best["held_out"]["epuck"]["fitness"]
    assert fitness["median"] == np.median(sample)
    assert fitness["mean"] == pytest.approx(sample.mean())
    share = sample / study.stored("de-best")
    assert best["held_out"]["epuck"]["share_of_stored"]["median"] == np.median(share)
    assert sum(best["held_out"]["epuck"]["behaviour"].values()) == pytest.approx(1)
    assert found["config_differences"]["optimizer.strategy"] == {
        "de-best": "best",
        "de-rand": "rand",
    }
    assert "steps" not in found["config_differences"]
    assert found["yardstick"]["epuck"]["mean"] == 195
    assert "abc123 and changes" in found["provenance"]["git"]
    assert found["commands"]["this report"].endswith("--output out --ioh")


# words


@pytest.mark.parametrize(
    ("seeds", "text"),
    [([1], "1"), ([1, 2, 3], "1-3"), ([1, 2, 5, 7, 8], "1-2,5,7-8"), ([], "")],
)
def test_seeds(seeds, text):
    assert seeds_text(seeds) == text


def test_spread_of_few_runs_has_no_quartiles():
    assert spread(np.array([3.14])) == "3.1 (n = 1)"
    assert spread(np.array([])) == "-"
    assert spread(np.array([3.0, 1, 2])) == "2.0 (1.0, 2.0, 3.0)"
    assert spread(np.array([3.0, 1, 2, 5, 4])) == "3.0 [2.0, 4.0]"


# documents


class Soundness(HTMLParser):
    """Every tag closed, in order; nothing loaded from elsewhere."""

    VOID = ("meta", "img")

    def __init__(self):
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag, attrs):
        if tag not in self.VOID:
            self.open.append(tag)
        assert tag not in ("script", "link", "iframe")
        for name, value in attrs:
            assert not name.startswith("on")
            if name == "href":
                self.links.append((value or "").removeprefix("#"))
                assert (value or "").startswith("#")
            if name == "id":
                self.ids.append(value or "")
            if name == "src":
                assert (value or "").startswith("data:image/svg+xml;base64,")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def check_html(text):
    parser = Soundness()
    parser.feed(text)
    parser.close()
    assert parser.open == []
    assert len(set(parser.ids)) == len(parser.ids)
    assert set(parser.links) <= set(parser.ids)
    assert not re.search(r"https?:|//[a-z]|url\(|@import", text)
    return " ".join("".join(parser.text).split())


def check_markdown(text):
    """Tables have as many cells in every line."""
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    for table in tables:
        cells = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(cells) == 1
        assert set(table.splitlines()[1]) <= set("|-: ")
    return tables


NASTY = (
    '<b> a|b *c* `d` [e](f) & "g" _h_ epuck_kinematic',
    "__a__ _b c_d_ &amp; &#35; ~~e~~ ![f](g) <mailto:a@b> \\* \\",
    "[a]: /b",
    *("- a", "+ a", "1. a", "23) a", "# a #", "> a", "***", "___", "```", "    a"),
)


@pytest.mark.parametrize("nasty", NASTY)
def test_text_stands_for_itself(nasty):
    code = [nasty, "a < b && c", "``` x", "*d*"]
    blocks = [
        Heading(nasty, 1),
        Paragraph(nasty),
        Listing([nasty, "x"]),
        Code(code),
        Table(("x", nasty), [("1", nasty)]),
        Picture("p", nasty, b"<svg/>"),
    ]
    page = to_html(nasty, blocks)
    words = " ".join(nasty.split())
    plain = " ".join(" ".join(code).split())
    style = " ".join(STYLE.split())
    texts = (words, style, words, words, words, "x", plain, "x", *[words, "1"], words)
    assert check_html(page) == " ".join([*texts, words])
    text = to_markdown(blocks)
    assert len(check_markdown(text)) == 1
    # in one piece it is the same document
    whole = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    for part in re.findall(r"<(h1|ul|pre|table)>(.*?)</\1>", page, re.DOTALL):
        assert "<{0}>{1}</{0}>".format(*part) in whole


def test_numbers_stay_readable():
    plain = "1 [2, 3] p < 0.1 & so, 3-5 runs of epuck_kinematic (#1)."
    assert to_markdown([Paragraph(plain)]) == f"{plain}\n"


def test_report_of_a_partial_study(written, capsys):
    out = written / "out"
    text = (out / "report.md").read_text()
    headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert headings[:3] == ["What is missing", "What was run", "Held-out fitness"]
    assert "- ga: no finished run of seed 3" in text
    # held-out first, on wheels first, then what evolution believes
    head = next(line for line in text.splitlines() if ": best run" in line)
    order = [head.index(w) for w in ("wheeled robot", "kinematic robot", "best stored")]
    assert order == sorted(order)
    assert "no verdict" in text
    assert not re.search(r"significan|\\\*", text)
    assert len(check_markdown(text)) > 8
    page = (out / "report.html").read_text()
    words = check_html(page)
    assert "ga: no finished run of seed 3" in words
    assert "A <fast> processor" in words
    assert len(page) < 5e6


def test_contents_link_every_section(written):
    text = (written / "out/report.md").read_text()
    page = (written / "out/report.html").read_text()
    sections = re.findall(r"^## (.*)$", text, re.MULTILINE)
    links = re.findall(r"^- \[(.*)\]\(#(.*)\)$", text, re.MULTILINE)
    assert [title for title, _ in links] == sections
    # before all of them
    assert text.index("](#") < text.index("\n## ")
    for title, target in links:
        assert target == anchor(title)
        assert f'<h2 id="{target}">{title}</h2>' in page
        assert f'href="#{target}"' in page
    # as GitHub makes them
    assert anchor("How, (to) get-it: 2 x_y?") == "how-to-get-it-2-x_y"


def test_sections_of_one_name_have_no_contents():
    with pytest.raises(ValueError, match="different names"):
        with_contents([Heading("A b"), Heading("a b")])


def test_tables_have_columns_of_different_names_and_units(study):
    found = [b for b in report_blocks(study, {}, "out", False) if isinstance(b, Table)]
    assert len(found) > 8
    for table in found:
        assert all(table.columns)
        assert len(set(table.columns)) == len(table.columns)
    heads = {column for table in found for column in table.columns}
    assert {
        "wheeled robot: crashes [%]",
        "kinematic robot: best run [of 300]",
        "clearance [mm]",
        "to 50 [evaluations]",
        "control steps [k]",
    } <= heads


def test_few_and_many_are_written_as_they_are_spoken(written):
    text = (written / "out/report.md").read_text()
    assert "5 finished runs of 2 experiments" in text
    assert not re.search(r"\b1 (?:pairs|runs|experiments)\b", text)
    # 1,900 of each run
    assert "| 3,000 | 5 | 1.9 (1.9, 1.9, 1.9) |" in text
    assert "in thousands" in text
    assert [numbered(n, "run") for n in (0, 1, 2000)] == [
        "0 runs",
        "1 run",
        "2,000 runs",
    ]


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([40, 9e6], (1.0, "", "")),
        ([], (1.0, "", "")),
        ([6e3, 9e6], (1e3, "k", "thousands")),
        ([2e5, 9e6], (1e6, "M", "millions")),
    ],
)
def test_no_run_has_zero_thousands(steps, expected):
    assert scale_of(np.array(steps, float)) == expected


def test_wide_tables_say_that_they_can_be_moved(written):
    page = (written / "out/report.html").read_text()
    assert page.count("<table>") == page.count('class="scroll" tabindex="0"')
    assert page.count('class="table wide"') > 0
    narrow, wide = (to_html("", [Table(["a"] * n, [["1"] * n])]) for n in (2, 30))
    assert '"table wide"' in wide
    assert '"table wide"' not in narrow
    # an interval stays in one line
    cells = to_html("", [Table(["a", "b"], [["x [y]", "1.0 [-2.5, 3]"]])])
    assert ">x [y]</td>" in cells
    assert ">1.0 <span>[-2.5, 3]</span></td>" in cells


def test_columns_of_a_robot_of_ones_own_have_plain_names(large):
    robots = {"epuck": "/a b/My Robot-2.xml", "epuck_kinematic": "/c/my_robot_2.xml"}
    runs = tuple(
        replace(
            run,
            scores=run.scores.model_copy(
                update={
                    "held_out": {
                        robots[robot]: test
                        for robot, test in run.scores.held_out.items()
                    }
                }
            ),
        )
        for run in large.runs["ga"]
    )
    data = replace(
        large,
        runs={"ga": runs},
        configs={"ga": large.configs["ga"]},
        robots=tuple(robots.values()),
        yardstick={},
    )
    (row, *_) = run_rows(data)
    assert row["my_robot_2_mean"] == runs[0].held_out("/a b/My Robot-2.xml")
    assert row["my_robot_2_1_mean"] == runs[0].held_out("/c/my_robot_2.xml")
    assert list(row) == [each["column"] for each in described_columns(data)]


def test_figures_are_shown_and_there(written):
    out = written / "out"
    text, page = (out / "report.md").read_text(), (out / "report.html").read_text()
    links = re.findall(r"!\[.*\]\(<(.*)>\)", text)
    assert page.count("<figure>") == len(links) == len(set(links)) >= 9
    for link in links:
        for form in ("png", "svg", "pdf"):
            assert 0 < (out / link).with_suffix(f".{form}").stat().st_size < 300_000
    assert {(out / link).stem for link in links} == {
        path.stem for path in (out / "figures").iterdir()
    }


def test_the_same_study_gives_the_same_bytes(written, monkeypatch):
    def content():
        files = sorted(p for p in (written / "out").rglob("*") if p.is_file())
        return {path: path.read_bytes() for path in files}

    before = content()
    # other formats of the same figures are compared where figures are tested
    monkeypatch.setattr(figure_files, "FORMATS", {"svg": figure_files.FORMATS["svg"]})
    argv = [str(written / "study"), "--output", str(written / "out"), "--ioh"]
    assert report_study(argv) == 0
    assert content() == before
    assert {p.name for p in before} >= {
        "report.md",
        "report.html",
        "summary.json",
        "runs.csv",
        "pairwise.csv",
        "success.csv",
        "targets.csv",
    }


def test_one_seed_says_so(tmp_path, bare):
    path = write_study(tmp_path / "study", seeds(1))
    assert report_study([str(path)]) == 0
    text = (path / "report/report.md").read_text()
    assert "Only one run of DE/best/1/bin, DE/rand/1/bin, GA" in text
    assert "too few runs for an interval" in text
    assert "nan" not in text
    check_markdown(text)
    check_html((path / "report/report.html").read_text())


def test_one_experiment_has_nothing_to_compare(tmp_path, bare):
    path = write_study(tmp_path / "study", {"ga": [1, 2]})
    assert report_study([str(path)]) == 0
    assert "nothing to compare" in (path / "report/report.md").read_text()
    assert rows_of((path / "report/pairwise.csv").read_text()) == []


def test_an_experiment_without_runs_is_named(tmp_path, bare, capsys):
    path = write_study(tmp_path / "study", {"de-best": [1, 2], "ga": []})
    assert report_study([str(path)]) == 0
    assert "missing: ga: no finished run" in capsys.readouterr().err
    assert "| GA | ga | - | 0 |" in (path / "report/report.md").read_text()


def test_a_corrupt_history_is_named_and_left_out(tmp_path, bare, capsys):
    path = write_study(tmp_path / "study", seeds(3), packed=False)
    damaged = path / "running/ga/seed-2/history.csv"
    damaged.write_text(damaged.read_text()[:-40] + "what")
    assert report_study([str(path)]) == 0
    assert "missing: ga seed 2:" in capsys.readouterr().err
    rows = rows_of((path / "report/runs.csv").read_text())
    assert [row["seed"] for row in rows if row["experiment"] == "ga"] == ["1", "3"]
    text = (path / "report/report.md").read_text()
    assert text.index("is damaged") < text.index("## What was run")


def test_figures_that_cannot_be_drawn_do_not_stop_the_report(tmp_path, monkeypatch):
    def fail(data):
        yield from ()
        raise UserError("no such arena")

    monkeypatch.setattr("evolution.report.figures.drawn_figures", fail)
    path = write_study(tmp_path / "study", seeds(2))
    assert report_study([str(path)]) == 0
    text = (path / "report/report.md").read_text()
    note = "- not all figures could be drawn: no such arena"
    assert text.index(note) < text.index("## What was run")


def test_bad_input_ends_a_process_with_one_line_and_status_2(tmp_path):
    path = write_study(tmp_path / "study", {"ga": []})
    result = subprocess.run(
        [sys.executable, "-m", "evolution.report", str(path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 2
    assert result.stdout == ""
    assert re.fullmatch(r"error: .+\n", result.stderr)


@pytest.mark.parametrize("kind", ["no runs", "nothing", "file as output"])
def test_bad_input_is_one_line(kind, tmp_path, bare, capfd):
    path, argv = tmp_path / "study", []
    if kind == "no runs":
        write_study(path, {"ga": []})
    elif kind == "file as output":
        write_study(path, {"ga": [1]})
        (tmp_path / "file").write_text("")
        argv = ["--output", str(tmp_path / "file")]
    with pytest.raises(UserError, match=r".") as caught:
        report_study([str(path), *argv])
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_target_and_run_rows_follow_the_study_order(large):
    costs = target_costs(large)
    assert list(dict.fromkeys(cost.experiment for cost in costs)) == [*NAMES]
    assert list(dict.fromkeys(row["experiment"] for row in run_rows(large))) == [*NAMES]


def test_best_stored_fitness_after_fixed_budgets(tmp_path):
    data = load_study(write_study(tmp_path / "study", {"ga": [1], "de-best": [1]}))
    spent = np.array([1000, 3000, 6001, 9000])
    history = {"evaluations": spent, "best": np.array([10.0, 50.0, 40.0, 90.0])}
    runs = {
        name: tuple(replace(run, history=history) for run in each)
        for name, each in data.runs.items()
    }
    text = to_markdown(cost_of_targets_section(replace(data, runs=runs)))
    assert "after 15,000" not in text
    assert "| experiment | after 3,000 | after 6,000 | after 9,000 |" in text
    assert "| GA | 50.0 (n = 1) | 50.0 (n = 1) | 90.0 (n = 1) |" in text


def test_luck_with_noise_is_held_against_starts_with_noise(tmp_path):
    path = write_study(tmp_path / "study", {"de-best": [1, 2, 3], "ga": [1, 2, 3]})
    data = load_study(path)
    assert WITH_NOISE not in to_markdown(what_stored_fitness_promised_section(data))
    noisy = data.configs["ga"].model_copy(update={"noise": "calibrated"})
    data = replace(data, configs={**data.configs, "ga": noisy})

    def row():
        text = to_markdown(what_stored_fitness_promised_section(data))
        assert WITH_NOISE in text
        (found,) = (line for line in text.splitlines() if line.startswith("| GA |"))
        return [cell.strip() for cell in found.strip("|").split("|")]

    # tested on ideal robots only: stored fitness is another quantity
    _, _, _, *cells = row()
    assert cells == ["-"] * 6
    text = to_markdown(what_stored_fitness_promised_section(data))
    assert re.search(r"\| DE/best/1/bin \| 3 \| \d[^|]*\| \d[^|]*\| -?\d", text)
    experiment = summary_fields(data, "out", False)["experiments"]["ga"]
    assert experiment["held_out"]["epuck"]["share_of_stored"] is None
    assert experiment["best_stored"] == {"fitness": None, "held_out": None}
    runs = []
    for run in data.runs["ga"]:
        test = HeldOut(mean=run.scores.stored - 7.0, crash_rate=0.0, starts=1000)
        tested = {"held_out_as_evolved": {"epuck": test}}
        runs.append(replace(run, scores=run.scores.model_copy(update=tested)))
    data = replace(data, runs={**data.runs, "ga": tuple(runs)})
    _, _, _, held_out, found, *best = row()
    assert held_out[0].isdigit()
    assert found == "7.0 (7.0, 7.0, 7.0)"
    assert best == ["-"] * 4


def test_experiments_of_other_budgets_are_not_compared(tmp_path):
    path = write_study(tmp_path / "study", seeds(12))
    config = path / "study.yaml"
    fields = yaml.safe_load(config.read_text())
    fields["de-rand"]["trials"] += 1
    config.write_text(yaml.safe_dump(fields, sort_keys=False))
    data = load_study(path)
    assert (
        "comparisons with de-best of de-rand, whose number of trials (evaluations "
        "times trials) is another"
    ) in data.missing
    pairs = [pair for each in comparisons(data).values() for pair in each]
    assert {(pair.a, pair.b) for pair in pairs} == {("de-best", "ga")}
    # a champion's fitness on fresh starts is still held against the follower's
    assert data.yardstick


def test_experiments_of_other_settings_are_not_compared(tmp_path):
    path = write_study(tmp_path / "study", seeds(12))
    config = path / "study.yaml"
    fields = yaml.safe_load(config.read_text())
    fields["de-rand"]["v_max"] = 0.04
    config.write_text(yaml.safe_dump(fields, sort_keys=False))
    data = load_study(path)
    assert (
        "comparisons with de-best of de-rand, whose arena, task or start clearance is "
        "another"
    ) in data.missing
    pairs = [pair for each in comparisons(data).values() for pair in each]
    assert {(pair.a, pair.b, pair.family) for pair in pairs} == {("de-best", "ga", 1)}
    # the follower drives in the setting of one of them
    assert not data.yardstick
    found = outcomes(data)
    assert {each.criterion for each in found} == {FOLLOWS, KEEPS_OFF}
    others = {(pair.a, pair.b) for each in found for pair in each.pairs}
    assert others == {("de-best", "ga")}
