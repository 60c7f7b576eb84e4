"""Public names: lazy, documented, on the reference page, and clear of the modules."""

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import epuck_mj
import evolution
from tests.test_architecture import OUTSIDE

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {"epuck_mj": epuck_mj, "evolution": evolution}
NAMES = [f"{name}.{each}" for name, it in PACKAGES.items() for each in it.__all__]
FACES = {
    name: ast.parse((ROOT / name / "__init__.py").read_text()) for name in PACKAGES
}


def imported_for_types(face: ast.Module) -> dict[str, str]:
    """Module of each name that type checkers see imported."""
    [block] = [
        node
        for node in face.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    return {
        alias.name: str(node.module)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


@pytest.mark.parametrize("package", PACKAGES)
def test_completion_type_checkers_and_python_know_the_same_names(package):
    face = PACKAGES[package]
    assert set(face.__all__) <= set(dir(face))
    assert imported_for_types(FACES[package]) == face._MODULES
    assert set(face.__all__) == set(face._MODULES)
    assert (ROOT / package / "py.typed").exists()
    with pytest.raises(AttributeError, match=f"'{package}' has no attribute 'nothing'"):
        face.nothing  # noqa: B018


@pytest.mark.parametrize("package", PACKAGES)
def test_no_name_is_a_module_as_well(package):
    """Whatever else was imported, a name means one thing."""
    modules = {path.stem for path in (ROOT / package).iterdir()}
    assert not modules & set(PACKAGES[package].__all__)


@pytest.mark.parametrize("name", NAMES)
def test_each_name_says_what_it_is_in_its_first_line(name):
    package, own = name.split(".")
    found = getattr(PACKAGES[package], own)
    if own == "SUITE":
        # a docstring of data is in the source only
        assert list(found) == ["follow_walls"]
        return
    assert found.__module__ == PACKAGES[package]._MODULES[own]
    first, *more = (inspect.getdoc(found) or "").splitlines()
    assert first.endswith((".", ":")) and not (more and more[0])
    # a dataclass without a docstring is given its signature as one
    assert not first.startswith(f"{own}(")


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_costs_nothing(package):
    costly = {*OUTSIDE, "numba", "numpy"}
    code = (
        f"import sys, {package}; dir({package})\n"
        f"print(*sorted({costly} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("", "")


def test_the_reference_page_has_exactly_these_names():
    page = (ROOT / "docs" / "api.md").read_text()
    listed = re.findall(r"^::: (\S+)$", page, re.M)
    assert len(listed) == page.count(":::")
    assert sorted(listed) == sorted(NAMES)
