"""YAML and JSON that are none: one line each."""

import pytest

from epuck_mj.errors import UserError
from epuck_mj.host.yaml_and_json import parse_yaml, read_json, read_yaml, to_yaml


def refused(read, path, content: bytes) -> str:
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        read(path)
    message = str(error.value)
    assert "\n" not in message
    assert f"'{path}'" in message
    return message


@pytest.mark.parametrize(
    "text",
    [
        "a: [1",
        "a: !!bool x",
        "a: !!int ''",
        "a: !!float ''",
        "a: !!timestamp x",
        "a: 2026-13-45",
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
