"""Changes of the shipped variations in words."""

import re

WORDS = {
    "none": "no bounds",
    "clip": "bounds: clip",
    "reflect": "bounds: reflect",
    "reinit": "bounds: reinit",
    "elite-1": "1 elite",
    "mutation-1-over-l": "mutation 1/L",
    "two-points": "two-point crossover",
    "small-square": "arena 0.5 m",
    "large-square": "arena 1.5 m",
    "literal": "fitness: literal",
    "spaced": "fitness: spaced",
}

PATTERNS = {
    r"gray-(\d+)": r"\1 bits, Gray code",
    r"bits-(\d+)": r"\1 bits",
    r"weights-(\d+)": r"weights within \1",
    r"hidden-(\d+)": r"\1 hidden neurons",
    r"f-([\d.]+)-cr-([\d.]+)": r"F \1, CR \2",
    r"starts-every-(\d+)": r"new starts every \1",
}


def in_words(change: str) -> str:
    """A change as tables and figures say it.

    Args:
        change: as the name of an experiment says it, such as `f-0.5-cr-0.9`.
    """
    for pattern, words in PATTERNS.items():
        if re.fullmatch(pattern, change):
            return re.sub(pattern, words, change)
    return WORDS.get(change, change.replace("-", " "))
