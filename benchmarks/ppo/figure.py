"""Draw and compare PPO and DE/best: `python -m benchmarks.ppo.figure`.

The line of PPO is fitness on validation starts, which training did not use. Of DE/best
a study has stored fitness by generation, which includes luck; what its champions are
worth on test starts is drawn as points. All these starts are those of evolution.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import tyro
from matplotlib.figure import Figure

import evolution
from benchmarks.ppo import CURVE, TEST
from epuck_mj.scene.model_files import KINEMATIC_ROBOT
from epuck_mj.show import colors
from epuck_mj.show.colors import fraction
from epuck_mj.show.pictures import save_figure
from epuck_mj.step.control import TaskParameters
from evolution.pages.style import COLUMN, PRINT, legend_below

EXPERIMENT = "de-best"
MILLION = 1e6
N_POINTS = 200


@dataclass(frozen=True)
class Options:
    """Draw fitness against control steps, and print what champions are worth.

    Attributes:
        ppo: folder that `python -m benchmarks.ppo` wrote.
        study: directory of a study with runs of DE/best.
        output: picture to write (.png).
    """

    ppo: Path = Path("results/ppo")
    study: Path = Path("results/paper")
    output: Path = Path("docs/ppo.png")


def growth(history: Any, grid: np.ndarray) -> np.ndarray:
    """Best stored fitness so far of each run at control steps `grid`, `(runs, grid)`.

    Args:
        history: data frame with a row per run and generation.
        grid: control steps of all trials so far; a run that has ended keeps its best.
    """
    rows = []
    for _, run in history.groupby("seed"):
        spent = run.control_steps.cumsum().to_numpy()
        best = np.append(-np.inf, run.best.cummax().to_numpy())
        rows.append(best[np.searchsorted(spent, grid, side="right")])
    return np.array(rows)


@matplotlib.rc_context(PRINT)
def figure_of(curve: dict, fitness: float, study: evolution.Study) -> Figure:
    """The curve of PPO, the growth of DE/best, and champions of both on test starts.

    Args:
        curve: that `benchmarks.ppo` wrote.
        fitness: of its champion on test starts, on the kinematic robot.
        study: with runs of DE/best.
    """
    history: Any = study.history[study.history.experiment == EXPERIMENT]
    champions: Any = study.champions[study.champions.experiment == EXPERIMENT]
    spent = history.groupby("seed").control_steps.sum()
    first = history[history.generation == 0].control_steps.max()
    looks = pd.DataFrame(curve["looks"])
    last = max(spent.max(), looks.steps.max())
    figure = Figure(figsize=(COLUMN, 3.2), layout="constrained")
    axes, handles = figure.add_subplot(), {}
    blue, red = fraction(colors.BLUE), fraction(colors.VERMILION)
    grid = np.linspace(first, spent.median(), N_POINTS)
    low, middle, high = np.quantile(growth(history, grid), (0.25, 0.5, 0.75), axis=0)
    axes.fill_between(grid / MILLION, low, high, color=blue, alpha=0.2, lw=0)
    (line,) = axes.plot(grid / MILLION, middle, color=blue, ls="--", lw=1.2)
    handles[f"DE/best, stored (n = {len(spent)})"] = line
    handles["DE/best, champions, test starts"] = axes.scatter(
        champions.control_steps / MILLION,
        champions[f"{KINEMATIC_ROBOT}_mean"],
        s=9,
        color=blue,
        zorder=3,
    )
    (line,) = axes.plot(looks.steps / MILLION, looks.fitness, color=red, lw=1.2)
    handles["PPO, validation starts (n = 1)"] = line
    best = looks.fitness.idxmax()
    handles["PPO, champion, test starts"] = axes.scatter(
        looks.steps[best] / MILLION,
        fitness,
        s=60,
        marker="*",
        color=red,
        edgecolor="black",
        lw=0.5,
        zorder=4,
    )
    most = TaskParameters().steps
    axes.set(xlabel="control steps [million]", ylabel=f"fitness (max {most})")
    axes.set(xlim=(0, last / MILLION * 1.02), ylim=(0, most))
    legend_below(figure, handles)
    return figure


def comparison(curve: dict, tests: list[dict], study: evolution.Study) -> str:
    """Lines with the control steps of both and the fitness of champions by robot."""
    looks = curve["looks"]
    last, best = looks[-1], max(looks, key=lambda look: look["fitness"])
    champions: Any = study.champions[study.champions.experiment == EXPERIMENT]
    spent = champions.control_steps / MILLION
    lines = [
        f"PPO, seed {curve['seed']}: {last['steps'] / MILLION:.1f} million steps in "
        f"{last['seconds'] / 60:.1f} minutes, best at {best['steps'] / MILLION:.1f}",
        f"DE/best, {len(champions)} runs: {spent.median():.1f} million steps, "
        f"{spent.min():.1f} to {spent.max():.1f}",
    ]
    for test in tests:
        theirs = champions[f"{test['robot']}_mean"]
        lines.append(
            f"{test['robot']}, test starts: PPO {test['mean']:.1f}, crashes in "
            f"{test['crash_rate']:.1%}; DE/best {theirs.median():.1f} (median), "
            f"{theirs.min():.1f} to {theirs.max():.1f}"
        )
    return "\n".join(lines)


def main(options: Options) -> None:
    """Read, draw, write, print."""
    curve, tests = (
        json.loads((options.ppo / name).read_text()) for name in (CURVE, TEST)
    )
    [fitness] = [test["mean"] for test in tests if test["robot"] == KINEMATIC_ROBOT]
    study = evolution.load(options.study)
    save_figure(figure_of(curve, fitness, study), options.output, dpi=200)
    print(comparison(curve, tests, study))


if __name__ == "__main__":
    main(tyro.cli(Options))
