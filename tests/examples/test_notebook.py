"""The notebook's cells, as written and in order."""

import json
from pathlib import Path

import numpy as np

NOTEBOOK = Path(__file__).parents[2] / "examples" / "learn.ipynb"


def test_every_cell_runs_and_the_spec_is_learned():
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    codes = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") for cell in cells)
    names = {}
    for code in codes:
        exec(code, names)
    assert names["learned"].robustness > 0
    learned = names["learned"]
    assert learned.picture().size[0] > 300
    velocities = [learned.signals(policy)["velocities"] for policy in (None, learned.calm)]
    assert np.abs(np.diff(velocities[1], axis=0)).mean() < np.abs(np.diff(velocities[0], axis=0)).mean() / 2
