"""The notebook's cells, as written and in order."""

import json
from pathlib import Path

NOTEBOOK = Path(__file__).parents[2] / "examples" / "learn.ipynb"


def test_every_cell_runs_and_the_spec_is_learned():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    codes = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") for cell in cells)
    names = {}
    for code in codes:
        exec(code, names)
    assert names["learned"].robustness > 0
    assert names["learned"].picture().size[0] > 300
