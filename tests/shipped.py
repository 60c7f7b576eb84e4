"""What is shipped: the paper's three optimisers and the baselines, and a champion."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from evolution.settings.config_files import find_config, load_config
from evolution.study.addresses import champion_at

CHAMPION = Path(__file__).resolve().parent.parent / "results/paper/de-best/seed-1"
"""Address of a champion in a table."""

PAPERS = ("de-best", "de-rand", "ga")
BASELINES = (
    "random-search",
    "one-plus-one-es",
    "cma-es",
    "lra-cma-es",
    "l-shade",
    "openai-es",
    "ssshc",
)
HYBRIDS = (
    "de-best-then-cma-es",
    "imitators-then-cma-es",
    "memetic-de",
    "lifetime-learning",
)
"""Hybrids; without lessons their individuals do not learn."""
OPTIMIZERS = {
    name: load_config(find_config(name)).optimizer
    for name in (*PAPERS, *BASELINES, *HYBRIDS)
}


@cache
def champion_file() -> Path:
    """A file with the first champion of DE/best in results/paper."""
    folder = Path(tempfile.mkdtemp(prefix="champion-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path = folder / "champion.json"
    path.write_text(champion_at(CHAMPION).to_json())
    return path
