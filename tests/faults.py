"""Faults that are surely ones, at random: of values, texts and arrays."""

import io
import json
import random
import zipfile
from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml

Fault = tuple[bytes, str]
"""What a file is to hold, and what is wrong with it."""


# --- values


def leaves(value: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of all values in mappings and lists, itself included."""
    yield path
    if isinstance(value, dict | list):
        inside = value.items() if isinstance(value, dict) else enumerate(value)
        for key, each in inside:
            yield from leaves(each, (*path, key))


def wrong_for(value: Any, path: tuple, rng: random.Random) -> Any:
    """A value that cannot stand where this one does."""
    if isinstance(value, bool):
        return rng.choice(["true", "yes", 1, 0.5, [], None, [value]])
    if isinstance(value, int | float):
        kinds = [str(value), "x", True, None, [value], {"a": value}]
        kinds += [float("nan"), float("inf"), 1e300, -1e300]
        # a gene or a score may be large or negative
        if not {"genome", "scores"} & set(path):
            kinds += [10**30, -1, 10**400]
        return rng.choice(kinds)
    if isinstance(value, str):
        return rng.choice([3, 1.5, True, None, [value], {"a": value}])
    return rng.choice(["text", 3, True, [[1]]])


# what no command reads, or what may be left out
FREE = {"engine", "threads", "platform", "started", "machine", "model", "finished"}


def value_fault(text: str, form: str, rng: random.Random, free: set[str]) -> Fault:
    """A text of YAML or JSON with a wrong value.

    Args:
        text: that is sound.
        form: yaml or json.
        rng: chooses.
        free: keys whose values may be anything.
    """
    content = [yaml.safe_load(text) if form == "yaml" else json.loads(text)]
    paths = [path for path in leaves(content) if path and not free & set(path)]
    *parents, key = path = rng.choice(paths)
    place: Any = content
    for each in parents:
        place = place[each]
    place[key] = wrong_for(place[key], path, rng)
    what = f"{path[1:]} = {place[key]!r:.60}" if place[key] != 10**400 else f"{path}"
    if form == "yaml":
        return yaml.safe_dump(content[0], sort_keys=False).encode(), what
    return json.dumps(content[0]).encode(), what


# --- texts


def text_fault(text: str, rng: random.Random) -> Fault:
    """The bytes of a text that is none any more, whatever its form."""
    content, where = text.encode(), rng.randrange(1, max(2, len(text) // 2))
    kinds = {
        "byte": content[:where] + b"\xff\xfe\xfa" + content[where:],
        "nul": content[:where] + b"\0" + content[where:],
        "utf-16 without a mark": text.encode("utf-16-le"),
        "utf-32": text.encode("utf-32"),
        "latin-1": b"# \xe4\n" + content,
        "empty": b"",
        "noise": rng.randbytes(200),
        "huge": b" " * 17_000_000,
        "deep": b"[" * rng.choice([30, 900, 100_000]),
        "entity": b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
    }
    kind = rng.choice(list(kinds))
    return kinds[kind], kind


def yaml_fault(text: str, rng: random.Random) -> Fault:
    """A text of a YAML mapping with a fault beside its values."""
    bomb = ["a0: &a0 [x, x, x]"]
    bomb += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    key = rng.choice([line for line in text.splitlines() if line[:1].isalpha()])
    word = rng.choice(["yes", "No", "on", "OFF", "010", "1:30", "1_000", "2026-01-01"])
    kinds = {
        "twice": f"{text}\n{key.partition(':')[0]}: 1\n",
        "word": f"{text}\nmore: {word}\n",
        "unknown": f"{text}\nmore: [3]\n",
        "merge": f"<<: {{a: 1}}\n{text}",
        "tab": f"{text}\nmore:\n\t- 1\n",
        "open": f"{text}\nmore: [1\n",
        "alias": f"{text}\nmore: *nobody\n",
        "python": f"{text}\nmore: !!python/object/apply:os.getcwd []\n",
        "bomb": "\n".join([*bomb, text]),
        "two": f"{text}\n---\n{text}",
    }
    kind = rng.choice(list(kinds))
    return kinds[kind].encode(), kind


def json_fault(text: str, rng: random.Random) -> Fault:
    """A text of a JSON object with a fault beside its values."""
    inside = text.rstrip().removesuffix("}").rstrip()
    kinds = {
        "cut": text[: rng.randrange(1, len(inside))],
        "twice": inside + ', "more": "a", "more": "a"}',
        "NaN": inside + ', "more": NaN}',
        "infinite": inside + ', "more": [-Infinity]}',
        "overflow": inside + ', "more": 1e999}',
        "digits": inside + f', "more": {"9" * 5000}}}',
        "deep": inside + f', "more": {"[" * 30}{"]" * 30}}}',
        "comma": inside + ",}",
        "list": f"[{text}]",
    }
    kind = rng.choice(list(kinds))
    return kinds[kind].encode(), kind


def csv_fault(text: str, rng: random.Random) -> Fault:
    """A history.csv that is none."""
    header, *rows = text.splitlines()
    kinds = {
        "header": [header.replace("best", "worst"), *rows],
        "no rows": [header],
        "text": [header, *rows, "2,12,x,1,1"],
        "nan": [header, *rows, "2,12,nan,1,1"],
        "infinite": [header, *rows, "2,12,inf,1,1"],
        "short": [header, *rows, "2,12"],
        "long": [header, *rows, "2,12,1,1,1,1"],
        "falls": [header, *rows, "2,1,1,1,1"],
    }
    kind = rng.choice(list(kinds))
    return "\n".join(kinds[kind]).encode(), kind


def xml_fault(text: str, rng: random.Random) -> Fault:
    """An MJCF text that is no arena."""
    geom = '<geom type="box" size="0.01 0.01 0.03"'
    kinds = {
        "element": "<gem/>",
        "attribute": f'{geom} colour="red"/>',
        "number": geom.replace("0.03", "x") + "/>",
        "numbers": '<geom type="box" size="0.01"/>',
        "negative": geom.replace("0.03", "-1") + "/>",
        "type": geom.replace("box", "cone") + "/>",
        "twice": f'{geom} name="east"/>',
        "material": f'{geom} material="gold"/>',
        "mesh": '<geom type="mesh" mesh="nobody"/>',
        "include": '<include file="nowhere.xml"/>',
        "itself": '<include file="arena.xml"/>',
    }
    kinds = {k: text.replace("</world", f"{each}</world") for k, each in kinds.items()}
    kinds |= {
        "cut": text[: rng.randrange(1, len(text) - 12)],
        "tag": text.replace("</worldbody>", "</wordlbody>"),
        "root": text.replace("mujoco", "urdf"),
        "encoding": '<?xml version="1.0" encoding="klingon"?>' + text,
        "two": text + text,
        "words": "an arena",
    }
    kind = rng.choice(list(kinds))
    return kinds[kind].encode(), kind


# --- arrays


def npz_fault(content: bytes, rng: random.Random) -> Fault:
    """The bytes of an .npz that is damaged, or of other arrays."""
    with np.load(io.BytesIO(content)) as file:
        arrays = dict(file)
    name = rng.choice(list(arrays))
    array, first = arrays[name], content.index(b"PK\x01\x02")
    other = rng.choice([complex, "<M8[s]", np.float16])
    shape = rng.choice([(10**13,), (-1,), (2, 10**18), (10**30,)])
    header = io.BytesIO()
    fields = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, fields)
    size = (2 * 10**9).to_bytes(4, "little")
    kinds = {
        "cut": content[: rng.randrange(len(content) - 1)],
        "noise": rng.randbytes(300),
        "bomb": content[: first + 24] + size + content[first + 28 :],
        "header": archive({f"{name}.npy": header.getvalue()}),
        "lacks": packed({n: each for n, each in arrays.items() if n != name}),
        "type": packed(arrays | {name: np.zeros(array.shape, other)}),
        "shape": packed(arrays | {name: np.stack([array, array])}),
    }
    kind = rng.choice(list(kinds))
    return kinds[kind], f"{kind} {name}"


def parquet_fault(content: bytes, rng: random.Random) -> Fault:
    """A table that is cut, something else, or has a bit turned in its first values."""
    kind = rng.choice(["emptied", "cut", "text", "a bit"])
    if kind == "cut":
        n = rng.randrange(len(content))
        return content[:n], f"{n} of {len(content)} bytes"
    if kind == "a bit":
        # of the texts of the first column, behind the header of its page
        i = content.index(b"mine") + rng.randrange(4)
        return content[:i] + bytes([content[i] ^ 1]) + content[i + 1 :], f"bit of {i}"
    return (b"" if kind == "emptied" else b"PAR1 of old\n"), kind


def archive(members: dict[str, bytes]) -> bytes:
    """The bytes of a zip archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, content in members.items():
            file.writestr(name, content)
    return buffer.getvalue()


def packed(arrays: dict[str, np.ndarray]) -> bytes:
    """The bytes of an .npz of arrays."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    return buffer.getvalue()
