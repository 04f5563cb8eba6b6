"""The notebooks in `examples/` run from the first cell to the last, and are stored without what
they print."""

import json
from pathlib import Path

import pytest

nbclient = pytest.importorskip("nbclient", reason="needs nbclient")
nbformat = pytest.importorskip("nbformat", reason="needs nbformat")

EXAMPLES = Path(__file__).parent.parent / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def executed(book, folder):
    client = nbclient.NotebookClient(
        book, timeout=120, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    )
    return client.execute()


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda f: f.stem)
def test_a_notebook_runs_and_shows_pictures(file):
    book = executed(nbformat.read(file, as_version=4), EXAMPLES)
    shown = [
        kind for cell in book.cells for out in cell.get("outputs", ())
        for kind in out.get("data", {})
    ]  # fmt: skip
    assert {"image/png", "image/svg+xml", "text/html"} & set(shown)
    warned = [
        out["text"] for cell in book.cells for out in cell.get("outputs", ())
        if out.get("name") == "stderr"
    ]  # fmt: skip
    assert not warned


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda f: f.stem)
def test_a_notebook_is_stored_without_outputs(file):
    cells = json.loads(file.read_text())["cells"]
    code = [c for c in cells if c["cell_type"] == "code"]
    assert code
    assert not any(c["outputs"] or c["execution_count"] for c in code)


def test_there_are_the_notebooks_that_the_pages_name():
    assert {f.stem for f in NOTEBOOKS} >= {
        "first-tour", "own-solver", "two-solvers", "tether-in-space", "map-to-mission",
        "with-surprises",
    }  # fmt: skip


def test_a_cell_that_fails_is_seen(tmp_path):
    """The check itself."""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1 / 0")])
    with pytest.raises(nbclient.exceptions.CellExecutionError, match="ZeroDivisionError"):
        executed(book, tmp_path)
