"""Files of the site, for mkdocs: the same paths as in the repository.

The README is the start page, pages of docs/ stay in docs/, and each file that a page
links comes along. So every link works on the site and in the repository as it is.
"""

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent

START = "README.md"

LINK = re.compile(r"\]\(<?([^)\s<>#]+)")
"""Path of a Markdown link or picture, without its anchor."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The theme's files, and all that can be reached from the README and docs/."""
    docs = Path(config.docs_dir)
    for file in [*files.documentation_pages(), *files.media_files()]:
        files.remove(file)
    pages = [START, *(f"docs/{page.name}" for page in sorted(docs.glob("*.md")))]
    for path in reached_from(pages):
        files.append(File(path, str(ROOT), config.site_dir, config.use_directory_urls))
    return files


def reached_from(pages: list[str]) -> list[str]:
    """These pages and all files of the repository that they link, one after another.

    Paths are relative to the repository. Links that lead nowhere are left to mkdocs,
    which warns of them.
    """
    found = dict.fromkeys(pages)
    waiting = list(pages)
    while waiting:
        page = ROOT / waiting.pop()
        for link in LINK.findall(page.read_text(encoding="utf-8")):
            file = (page.parent / link).resolve()
            if not file.is_file() or not file.is_relative_to(ROOT):
                continue
            path = file.relative_to(ROOT).as_posix()
            if path not in found:
                found[path] = None
                waiting += [path] if file.suffix == ".md" else []
    return list(found)
