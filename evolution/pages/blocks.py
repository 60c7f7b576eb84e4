"""A document as blocks, written as Markdown and as one self-contained HTML page."""

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass

FIGURES_FOLDER = "figures"
"""Folder of the pictures, beside the Markdown file."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 60rem; margin: 2rem auto; padding: 0 1rem; overflow-wrap: break-word; }
h1, h2, h3 { line-height: 1.2; margin-top: 2em; } h1 { margin-top: 0; }
table { border-collapse: separate; border-spacing: 0; font-size: 0.875rem;
  font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid #ddd; padding: 0.3em 0.7em; text-align: left; }
th { border-bottom: 2px solid #666; vertical-align: bottom; }
th:first-child, td:first-child { position: sticky; left: 0; background: #fff;
  padding-left: 0; }
td span { white-space: nowrap; }
.table { margin: 1em 0; }
.scroll { overflow-x: auto; }
@media (max-width: 40rem) {
  table { font-size: 0.8125rem; }
  th:first-child, td:first-child { min-width: 6.5rem; max-width: 8rem;
    overflow-wrap: anywhere; border-right: 1px solid #ddd; }
  .wide::before { content: "\\2194  swipe the table sideways"; display: block;
    font-size: 0.8125rem; color: #444; margin-bottom: 0.3em; }
  .wide .scroll { border-right: 3px dotted #999; }
}
figure { margin: 1.5em 0; } figure img { max-width: 100%; height: auto; }
figcaption { font-size: 0.875rem; color: #444; max-width: 46rem; }
pre { background: #f4f4f4; padding: 0.8em; overflow-x: auto; font-size: 0.8125rem; }
"""


@dataclass(frozen=True)
class Heading:
    """A title; level 1 is the document's own."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Listing:
    """Items, each a plain text."""

    items: Sequence[str]


@dataclass(frozen=True)
class Contents:
    """Links to the headings with these texts."""

    headings: Sequence[str]


@dataclass(frozen=True)
class Code:
    """Lines to be typed."""

    lines: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Cells of plain text.

    Attributes:
        columns: their titles.
        rows: as many cells each.
        texts: how many leading columns are words; the others are numbers.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: int = 1


@dataclass(frozen=True)
class Picture:
    """A figure.

    Attributes:
        name: of its files.
        caption: plain text.
        svg: content of the SVG file.
    """

    name: str
    caption: str
    svg: bytes


Block = Heading | Paragraph | Listing | Contents | Code | Table | Picture

SECTION = 2
"""Level of the headings that a list of contents names."""

BOUNDS = r"[\[(][\d.,% -]+[\])]"
"""Pattern of an interval or a sample after a number, which stays in one line."""

WIDE = 54
"""Width in letters above which a table does not fit the screen of a phone."""

GAP = 3
"""Room between two columns, in letters."""


def with_contents(blocks: Sequence[Block]) -> list[Block]:
    """The document with a list of its sections before the first of them.

    Raises:
        ValueError: if two sections have the same heading.
    """
    sections = {
        i: block.text
        for i, block in enumerate(blocks)
        if isinstance(block, Heading) and block.level == SECTION
    }
    titles = list(sections.values())
    if len({anchor(title) for title in titles}) < len(titles):
        raise ValueError(f"expected sections of different names, got {titles}")
    first = min(sections)
    return [*blocks[:first], Contents(titles), *blocks[first:]]


def anchor(heading: str) -> str:
    """The name by which GitHub links a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def to_markdown(blocks: Sequence[Block]) -> str:
    """The document in GitHub's Markdown, with links to the pictures."""
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {_escaped(text)}"
        case Paragraph(text):
            return _begun(text)
        case Listing(items):
            return "\n".join(f"- {_begun(item)}" for item in items)
        case Contents(headings):
            return "\n".join(f"- [{_escaped(h)}](#{anchor(h)})" for h in headings)
        case Code(lines):
            # longer than any inside
            fence = max(re.findall("`+", "\n".join(["``", *lines])), key=len) + "`"
            return "\n".join([fence, *lines, fence])
        case Table(columns, rows, texts):
            rule = ["---" if i < texts else "---:" for i in range(len(columns))]
            lines = [map(_escaped, columns), rule, *(map(_escaped, r) for r in rows)]
            return "\n".join(f"| {' | '.join(line)} |" for line in lines)
        case Picture(name, caption):
            link = f"![{_escaped(name)}](<{FIGURES_FOLDER}/{name}.png>)"
            return f"{link}\n\n*{_escaped(caption)}*"


def _escaped(text: str) -> str:
    """Plain text of one line, escaped for Markdown."""
    text = " ".join(text.split())
    # the others are marks only beside certain neighbours: numbers stay readable
    marks = r"[\\`*|]|<(?=[\w/!?])|\](?=[(\[:])|~(?=~)|&(?=[\w#])|#(?=#*$)"
    inside = r"(?<![^\W_])_|_(?![^\W_])"
    return re.sub(f"{marks}|{inside}", r"\\\g<0>", text)


def _begun(text: str) -> str:
    """Plain text escaped for the beginning of a block, where more marks count."""
    marks = r"^(?=[-+#>])|^\d+(?=[.)](?: |$))"
    return re.sub(marks, r"\g<0>\\", _escaped(text))


def to_html(title: str, blocks: Sequence[Block]) -> str:
    """The document as a page in one file, without scripts and requests.

    Args:
        title: of the window.
        blocks: what it shows, made from their Markdown but for the pictures.
    """
    from markdown_it import MarkdownIt

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")

    def shown(block: Block) -> str:
        if isinstance(block, Picture):
            return _figure(block)
        made = markdown.render(_markdown(block))
        match block:
            case Heading(text, level) if level == SECTION:
                name = html.escape(anchor(text))
                return made.replace("<h2>", f'<h2 id="{name}">', 1)
            case Table():
                kind = "table wide" if _letters(block) > WIDE else "table"
                made = re.sub(f"(?<= ){BOUNDS}(?=</td>)", r"<span>\g<0></span>", made)
                # scrolling elements can be reached with the keyboard
                scroll = f'<div class="scroll" tabindex="0">\n{made}</div>'
                return f'<div class="{kind}">{scroll}</div>\n'
        return made

    body = "".join(map(shown, blocks))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n"
        f"</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _letters(table: Table) -> int:
    """Least width of a table, with its cells wrapped, in letters."""
    columns = zip(table.columns, *table.rows, strict=True)
    return sum(
        GAP + max(len(word) for cell in cells for word in _words(cell))
        for cells in columns
    )


def _words(cell: str) -> list[str]:
    """Parts of a cell that stay in one line."""
    return re.findall(f"{BOUNDS}|\\S+", cell) or [""]


def _figure(picture: Picture) -> str:
    # as images, figures cannot clash by equal names inside
    data = base64.b64encode(picture.svg).decode()
    return (
        f'<figure><img alt="{html.escape(picture.name)}" '
        f'src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption>{html.escape(picture.caption)}</figcaption></figure>\n"
    )
