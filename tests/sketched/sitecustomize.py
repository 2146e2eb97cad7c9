"""With this folder on PYTHONPATH, tltlrl commands and what they start draw sketches for plots, and small films."""

import importlib.util
import sys
from importlib.abc import MetaPathFinder

from sketch import sketch

CHANGED = {
    "tltlrl.reports.plotting": {"picture": sketch},
    "tltlrl.reports.video": {"HEIGHT": 90, "WIDTH": 120},
}


class Sketched(MetaPathFinder):
    """Changes those modules as soon as they are imported, and imports nothing itself."""

    def find_spec(self, name, path, target=None):  # noqa: ARG002
        if name not in CHANGED:
            return None
        changes = CHANGED.pop(name)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def exec_module(module):
            load(module)
            vars(module).update(changes)

        spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, Sketched())
