# SPDX-License-Identifier: BSD-3-Clause
"""Executes the notebooks of examples/python, as Jupyter does; the outputs are not kept in the repository."""
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

# Of Jupyter's own modules.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "examples" / "python").glob("*.ipynb"))


def execute(notebook, folder):
    NotebookClient(notebook, timeout=250, kernel_name="python3", resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def outputs(notebook):
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_from_beginning_to_end(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    assert not outputs(notebook), f"{path.name} is kept without outputs"
    shown = outputs(execute(notebook, tmp_path))
    text = "".join(output.text for output in shown if output.output_type == "stream")
    pictures = [output for output in shown if output.output_type == "display_data" and "image/png" in output.data]
    assert text.count("converged, chi2") == 3 and "absolute trajectory error" in text
    assert len(pictures) == 3


def test_a_notebook_that_fails_is_found(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("assert 1 > 2")])
    with pytest.raises(CellExecutionError):
        execute(notebook, tmp_path)
