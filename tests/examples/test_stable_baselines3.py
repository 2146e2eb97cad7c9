"""The example with Stable-Baselines3: its page shows the table of its file. Training takes too long for a test."""

import importlib.util
from pathlib import Path

import pandas as pd

FOLDER = Path(__file__).parents[2] / "examples" / "stable_baselines3"


def test_the_page_shows_the_table_of_its_file():
    module = importlib.util.spec_from_file_location("table", FOLDER / "table.py")
    table = importlib.util.module_from_spec(module)
    module.loader.exec_module(table)
    runs = pd.read_csv(FOLDER / "results.csv")
    assert table.table(table.together(runs, [])) in (FOLDER / "README.md").read_text(encoding="utf-8")
