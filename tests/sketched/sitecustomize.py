"""With this folder on PYTHONPATH, the pictures of every tltlrl command are sketches, also in what a command starts."""

import importlib.util
import sys
from importlib.abc import MetaPathFinder

from sketch import sketch

PLOTTING = "tltlrl.reports.plotting"


class Sketched(MetaPathFinder):
    """Replaces `picture` as soon as its module is imported, and imports nothing itself."""

    def find_spec(self, name, path, target=None):  # noqa: ARG002
        if name != PLOTTING:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def exec_module(module):
            load(module)
            module.picture = sketch

        spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, Sketched())
