"""YAML and JSON that are none: one line each."""

import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.yaml_and_json import parse_yaml, read_json, read_yaml, to_yaml
from tests.refusals import refused as one_line


def refused(read, path, content: bytes) -> str:
    path.write_bytes(content)
    message = one_line(read, path)
    assert f"'{path}'" in message
    return message


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "a: !!float ''",
        "a: !python/object:os.system x",
        "[" * 900,
        "? [a, b]\n: 1\n",
        "--- a\n--- b",
    ],
)
def test_what_is_not_yaml(text, tmp_path):
    assert " is not YAML: " in refused(read_yaml, tmp_path / "a.yaml", text.encode())
    with pytest.raises(UserError, match="the text is not YAML: "):
        parse_yaml(text, "the text")


@pytest.mark.parametrize("text", ["", "{", '{"a": }', "[" * 100_000, "9" * 5000])
def test_what_is_not_json(text, tmp_path):
    assert " is not JSON: " in refused(read_json, tmp_path / "a.json", text.encode())


@pytest.mark.parametrize("read", [read_yaml, read_json])
def test_what_is_no_mapping(read, tmp_path):
    path = tmp_path / "a"
    for content, kind in ((b"[1, 2]", "list"), (b"3", "int"), (b'"a"', "str")):
        assert refused(read, path, content).endswith(f"values, got {kind}")
    assert "cannot read" in refused(read, path, b"\xff\xfe\x00")


def test_mappings_come_back_in_their_order(tmp_path):
    content = {"z": 1, "a": {"b": [1.5, None, True]}}
    path = tmp_path / "a.yaml"
    path.write_text(to_yaml(content))
    back = read_yaml(path)
    assert back == content
    assert list(back) == ["z", "a"]
    path.write_text('{"z": 1, "a": {"b": [1.5, null, true]}}')
    assert read_json(path) == content


def strictly(text: str) -> str:
    """What is said of a text that could be parsed, but is not read."""
    with pytest.raises(UserError) as error:
        parse_yaml(text, "'a.yaml'")
    assert str(error.value).startswith("'a.yaml': ")
    return str(error.value)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("seed: 3\nsteps: 1\nseed: 4\n", "1 and 3"),
        ("{a: 1, a: 2}", "1"),
        ("a:\n  b: 1\n  'b': 1\n", "2 and 3"),
        ("- 1: a\n  1.0: b\n", "1 and 2"),
    ],
)
def test_a_repeated_key_is_refused_with_its_lines(text, lines):
    assert strictly(text).endswith(f" appears twice, in line {lines}")


@pytest.mark.parametrize(
    "value",
    [
        *(
            "010",
            "-07",
            "1:30",
            "190:20:30",
            "1:30.5",
            "1_000",
            "0b11",
            "0x1F",
            "1_0.5",
        ),
        *("yes", "No", "on", "OFF", "2026-01-01", "2026-13-45", "!!bool 1", "!!int ''"),
    ],
)
def test_what_has_several_meanings_is_refused_with_its_line(value):
    said = strictly(f"a: 1\nb: {value}\n")
    assert " in line 2 has several meanings in YAML: expected true, false, " in said
    if not value.startswith("!"):
        assert parse_yaml(f"b: '{value}'", "") == {"b": value}


def test_what_means_the_same_in_every_version_is_read():
    text = "[0, -3, +4, 1.5, .5, 5., 1.0e+3, true, False, ~, '010', 1e5, 0o17, y]"
    expected = [0, -3, 4, 1.5, 0.5, 5.0, 1000.0, True, False, None]
    assert parse_yaml(text, "") == [*expected, "010", "1e5", "0o17", "y"]


def test_aliases_are_read_as_far_as_there_are_not_too_many():
    assert parse_yaml("a: &a [1]\nb: *a", "") == {"a": [1], "b": [1]}
    bomb = "a0: &a0 [x, x]\n" + "".join(
        f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)
    )
    merged = "a: &a {x: 1}\nb:\n  <<: *a\n"
    assert "expected at most 500000 values" in strictly(bomb)
    assert "in at most 20 mappings" in strictly("a: &a [*a]")
    assert "'<<' in line 3 is not allowed" in strictly(merged)


def test_what_is_nested_deep_or_long_is_refused(tmp_path):
    assert parse_yaml("- " * 20 + "a", "")
    assert "in at most 20 mappings" in strictly("- " * 21 + "a")
    assert "expected at most 250000 characters" in strictly("#" * 250_001)
    path = tmp_path / "a"
    assert "at most 0.25 MB, got 0.3" in refused(read_yaml, path, b"#" * 300_000)
    assert "at most 8 MB, got 8.0" in refused(read_json, path, b" " * 8_000_001)
    listed = b'{"a": %s}' % (b"[" * 21 + b"]" * 21)
    assert "in at most 20 mappings" in refused(read_json, path, listed)
    assert "nested too deep" in refused(read_json, path, b"[" * 1_000_000)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"a": 1, "b": 2, "a": 1}', "key 'a' appears twice"),
        ('{"a": {"b": 1, "b": 1}}', "key 'b' appears twice"),
        ('{"a": NaN}', "expected a finite number, got NaN"),
        ('{"a": [-Infinity]}', "expected a finite number, got -Infinity"),
        ('{"a": 1e999}', "expected a finite number, got 1e999"),
        ('{"a": 1' + "0" * 1000 + "}", "expected at most 1000 digits, got 1001"),
    ],
)
def test_json_is_read_strictly(text, said, tmp_path):
    assert said in refused(read_json, tmp_path / "a.json", text.encode())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_encoding_that_a_text_says_is_read(encoding, tmp_path):
    path = tmp_path / "a"
    path.write_bytes('{"ä": "ö"}\r\n'.encode(encoding))
    assert read_yaml(path) == read_json(path) == {"ä": "ö"}
    path.write_bytes('{"ä": "ö"}'.encode("latin-1"))
    for read in (read_yaml, read_json):
        assert "cannot read" in refused(read, path, path.read_bytes())
