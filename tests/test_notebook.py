"""docs/notebook.ipynb runs from its first cell to its last, and shows what it says."""

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from tests.processes import PATIENCE

NOTEBOOK = Path(__file__).resolve().parent.parent / "docs" / "notebook.ipynb"


def read() -> Any:
    return nbformat.read(NOTEBOOK, as_version=4)


def test_it_is_stored_without_outputs():
    for cell in read().cells:
        if cell.cell_type == "code":
            assert cell.outputs == [] and cell.execution_count is None


@pytest.mark.slow
def test_the_notebook(alone):
    """With few evaluations, on a machine without a network."""
    notebook = read()
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for index, much, little in [
        (0, '"evaluations": 9000', '"evaluations": 450'),
        (2, "starts = 100", "starts = 10"),
    ]:
        assert much in code[index].source
        code[index].source = code[index].source.replace(much, little)
    NotebookClient(notebook, timeout=PATIENCE).execute()

    shown: list[str] = []
    for cell in code:
        for output in cell.outputs:
            assert output.output_type != "error"
            assert output.get("name") != "stderr", output.text
            shown += output.get("data", {})
    assert shown.count("image/png") == 3
    assert shown.count("application/vnd.jupyter.widget-view+json") == 1
    assert shown.count("text/html") == 1
    assert Path("product.rrd").stat().st_size > 10_000
