"""docs/porting.md: its code prints what the page says, as simulation does."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from epuck_mj import constants
from epuck_mj.step.control import TaskParameters
from epuck_mj.step.motors import command
from epuck_mj.step.sensors import observe
from evolution.study.addresses import champion_at

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "porting.md").read_text()
ADDRESS = "results/paper/openai-es/seed-5"


def test_the_worked_example(tmp_path):
    (tmp_path / "champion.json").write_text(champion_at(ROOT / ADDRESS).to_json())
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    said = PAGE.split(code)[1].split("```")[2].strip()
    # nothing of this project is needed
    done = subprocess.run(
        [sys.executable, "-I", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == said
    assert f"evolution.export {ADDRESS} champion.json" in PAGE


def test_the_example_is_what_simulation_does():
    champion = champion_at(ROOT / ADDRESS)
    assert champion.task == TaskParameters()
    distance = np.array([0.0312, 0.0121, 0.0058, -1, -1, -1, -1, 0.0385])
    seen = observe(distance, champion.task.sensor_range)
    v, w = champion.controller(seen)
    left, right = command(np.array([v, w]), champion.task.speeds)
    assert f"observation {seen.round(4).tolist()}" in PAGE
    assert f"v, w {v:.4f} {w:.4f}" in PAGE
    assert f"wheels [rad/s] {left:.4f} {right:.4f}" in PAGE


def test_the_robot_is_as_the_page_says():
    angles = " | ".join(f"{angle:.1f}" for angle in constants.PROXIMITY_ANGLES)
    assert f"| {angles} |" in PAGE
    for value, text in (
        (constants.BODY_RADIUS, "35 mm radius"),
        (constants.WHEEL_RADIUS, "radius of 20.5 mm"),
        (constants.TRACK, "distance of 53 mm"),
        (constants.PROXIMITY_HEIGHT, "33 mm above"),
    ):
        assert text in PAGE and f"{1000 * value:g} mm" in text
    fields = json.loads(champion_at(ROOT / ADDRESS).to_json())
    for key in re.findall(r"^\| `([a-z_.]+)`", PAGE, re.M):
        part = fields
        for name in key.split("."):
            part = part[name]
        assert part is not None, key
