"""A document as blocks, rendered to Markdown and to one self-contained HTML page."""

import base64
import html
import re
from collections.abc import Sequence
from dataclasses import dataclass

FIGURES = "figures"
"""Folder of the pictures, beside the Markdown file."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
  max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; margin-top: 2em; } h1 { margin-top: 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.875rem; margin: 1em 0;
  font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid #ddd; padding: 0.3em 0.7em; text-align: right; }
th { border-bottom: 2px solid #666; vertical-align: bottom; }
.text { text-align: left; }
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


Block = Heading | Paragraph | Listing | Code | Table | Picture


def to_markdown(blocks: Sequence[Block]) -> str:
    """The document in GitHub's Markdown, which links the pictures."""
    return "\n\n".join(_markdown(block) for block in blocks) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"{'#' * level} {_escaped(text)}"
        case Paragraph(text):
            return _begun(text)
        case Listing(items):
            return "\n".join(f"- {_begun(item)}" for item in items)
        case Code(lines):
            return "\n".join(["```", *lines, "```"])
        case Table(columns, rows, texts):
            rule = ["---" if i < texts else "---:" for i in range(len(columns))]
            lines = [map(_escaped, columns), rule, *(map(_escaped, r) for r in rows)]
            return "\n".join(f"| {' | '.join(line)} |" for line in lines)
        case Picture(name, caption):
            link = f"![{_escaped(name)}](<{FIGURES}/{name}.png>)"
            return f"{link}\n\n*{_escaped(caption)}*"


def _escaped(text: str) -> str:
    """Plain text of one line that Markdown shows as it is."""
    text = " ".join(text.split())
    # the others are marks only beside certain neighbours: numbers stay readable
    text = re.sub(r"[\\`*|]|<(?=[\w/!?])|\](?=[(\[:])|~(?=~)|&(?=[\w#])", _mark, text)
    return re.sub(r"(?<!\w)_|_(?!\w)", _mark, text)


def _begun(text: str) -> str:
    """The same where a block begins, and a mark would make it another."""
    return re.sub(r"^[-+#>]", _mark, _escaped(text))


def _mark(found: re.Match[str]) -> str:
    """A mark that only stands for itself."""
    return "\\" + found[0]


def to_html(title: str, blocks: Sequence[Block]) -> str:
    """The document as a page that needs nothing else: no script, no request.

    Args:
        title: of the window.
        blocks: what it shows.
    """
    body = "\n".join(_html(block) for block in blocks)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n"
        f"</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _html(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f"<h{level}>{html.escape(text)}</h{level}>"
        case Paragraph(text):
            return f"<p>{html.escape(text)}</p>"
        case Listing(items):
            lines = [f"<li>{html.escape(item)}</li>" for item in items]
            return "\n".join(["<ul>", *lines, "</ul>"])
        case Code(lines):
            text = "\n".join(lines)
            return f"<pre>{html.escape(text)}</pre>"
        case Table(columns, rows, texts):
            head = _row("th", columns, texts)
            body = "\n".join(_row("td", row, texts) for row in rows)
            return (
                f'<div class="wide"><table>\n<thead>\n{head}\n</thead>\n'
                f"<tbody>\n{body}\n</tbody>\n</table></div>"
            )
        case Picture(name, caption, svg):
            # as an image its names cannot meet those of another figure
            data = base64.b64encode(svg).decode()
            return (
                f'<figure><img alt="{html.escape(name)}" '
                f'src="data:image/svg+xml;base64,{data}">\n'
                f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            )


def _row(tag: str, cells: Sequence[str], texts: int) -> str:
    parts = (
        f'<{tag} class="text">{html.escape(cell)}</{tag}>'
        if i < texts
        else f"<{tag}>{html.escape(cell)}</{tag}>"
        for i, cell in enumerate(cells)
    )
    return f"<tr>{''.join(parts)}</tr>"
