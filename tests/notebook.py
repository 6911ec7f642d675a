"""Executes notebooks, each in an empty folder of its own, and fails at the first error.

    notebook.py FILE.ipynb...

Needs nbclient and ipykernel. Nothing is written beside the notebooks.
"""

import sys
import tempfile

import nbformat
from nbclient import NotebookClient

CELL_TIMEOUT_S = 300

for file in sys.argv[1:]:
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=CELL_TIMEOUT_S, resources={"metadata": {"path": folder}}).execute()
    cells = sum(cell.cell_type == "code" for cell in notebook.cells)
    pictures = sum(
        any(mime.startswith("image/") for mime in output.get("data", {}))
        for cell in notebook.cells
        for output in cell.get("outputs", [])
    )
    print(f"{file}: {cells} cells, {pictures} pictures")
