"""The site: built strictly, structured as the pages are, and strict about links."""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
import yaml
from markdown_it import MarkdownIt

import epuck_mj
import evolution
from tests.processes import PATIENCE

ROOT = Path(__file__).resolve().parent.parent
PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING")),
    *ROOT.glob("docs/*.md"),
    ROOT / "results/REPRODUCTION.md",
    ROOT / "results/report-paper/report.md",
]

pytestmark = pytest.mark.slow


def build(repository: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """Build the site of a repository as `make docs` does."""
    # --quiet would hide warnings from --strict, too
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    return subprocess.run(
        [*command, "--site-dir", str(site)],
        cwd=repository,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def article(site: Path, page: Path) -> str:
    """What the site shows of a page, without menus."""
    path = page.relative_to(ROOT).with_suffix("")
    at = path.parent if path.name == "README" else path
    html = (site / at / "index.html").read_text()
    return html[html.index("<article") : html.index("</article>")]


def elements(html: str) -> Counter:
    kinds = {"ol", "ul", "li", "table", "td", "pre", "blockquote", "img", "h2", "h3"}
    return Counter(each for each in re.findall(r"<(\w+)", html) if each in kinds)


def test_the_site(tmp_path):
    done = build(ROOT, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stdout + done.stderr

    # lists and blocks are the same here and where the repository is read
    commonmark = MarkdownIt("commonmark").enable("table")
    reference = ROOT / "docs" / "api.md"
    for page in PAGES:
        if page != reference:
            expected = elements(commonmark.render(page.read_text()))
            assert elements(article(tmp_path, page)) == expected, page

    # every public name can be linked to
    shown = article(tmp_path, reference)
    for package in (epuck_mj, evolution):
        for name in package.__all__:
            assert f'id="{package.__name__}.{name}"' in shown

    # nothing is loaded from elsewhere
    for file in tmp_path.rglob("*.html"):
        loaded = r'<(?:script|img)[^>]*src="https?:|<link[^>]*href="https?:'
        assert not re.search(loaded, file.read_text()), file


def test_a_link_that_leads_nowhere_fails(tmp_path):
    """The checks of mkdocs.yml, on two pages of another repository."""
    config = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    del config["not_in_nav"], config["watch"], config["plugins"]
    config["nav"] = ["README.md", "docs/one.md"]
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(config))
    (tmp_path / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "site.py", tmp_path / "docs")
    start, one = tmp_path / "README.md", tmp_path / "docs" / "one.md"
    start.write_text("# Start\n\n[one](docs/one.md#two), [licence](LICENSE)\n")
    one.write_text("# One\n\n## Two\n\n[start](../README.md#start)\n")
    (tmp_path / "LICENSE").write_text("free\n")
    done = build(tmp_path, tmp_path / "site")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "LICENSE").read_text() == "free\n"
    one.write_text("# One\n\n[a](../README.md#three) [b](two.md) [c](../LICENCE)\n")
    done = build(tmp_path, tmp_path / "site")
    assert done.returncode == 1
    for nowhere in ("#three", "docs/two.md", "LICENCE", "one.md#two"):
        assert nowhere in done.stderr, done.stderr
