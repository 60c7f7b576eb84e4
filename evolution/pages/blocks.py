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
  max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; margin-top: 2em; } h1 { margin-top: 0; }
table { border-collapse: collapse; font-size: 0.875rem; margin: 1em 0;
  font-variant-numeric: tabular-nums; display: block; overflow-x: auto; }
th, td { border-bottom: 1px solid #ddd; padding: 0.3em 0.7em; text-align: left; }
th { border-bottom: 2px solid #666; vertical-align: bottom; }
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
    """Plain text escaped for the beginning of a block in Markdown."""
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
    body = "".join(
        _figure(each) if isinstance(each, Picture) else markdown.render(_markdown(each))
        for each in blocks
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>{STYLE}</style>\n"
        f"</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _figure(picture: Picture) -> str:
    # as an image its names cannot meet those of another figure
    data = base64.b64encode(picture.svg).decode()
    return (
        f'<figure><img alt="{html.escape(picture.name)}" '
        f'src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption>{html.escape(picture.caption)}</figcaption></figure>\n"
    )
