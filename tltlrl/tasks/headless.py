"""Which renderer MuJoCo's Python packages load, chosen before they are imported."""

from __future__ import annotations

import importlib
import os
import sys

VARIABLE = "MUJOCO_GL"


def choose_renderer() -> None:
    """Sets MUJOCO_GL to the first renderer that loads on a machine without a display; rendering off if none does.

    Left alone where the user has set it, or where there is a display. dm_control's own choice would be GLFW, which
    imports without a display but cannot render.
    """
    if VARIABLE in os.environ or sys.platform != "linux" or os.environ.get("DISPLAY"):
        return
    for backend in ("egl", "osmesa", "disable"):
        os.environ[VARIABLE] = backend
        try:
            importlib.import_module("dm_control._render")
        except (ImportError, AttributeError, OSError):  # no library, or no device behind it
            for name in [name for name in sys.modules if name.startswith("dm_control._render")]:
                del sys.modules[name]
        else:
            return
