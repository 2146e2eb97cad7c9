"""Chooses the renderer that MuJoCo's Python packages load, before they are imported."""

from __future__ import annotations

import importlib
import os
import sys
import warnings

VARIABLE = "MUJOCO_GL"
OFF = "disable"


def choose_renderer() -> None:
    """Sets MUJOCO_GL to the first renderer that loads, the user's own choice before any other; off if none does.

    Without a choice dm_control takes GLFW, which imports but cannot render without a display, or with a DISPLAY that no
    server answers. With a choice that does not load, nothing can be imported at all.
    """
    asked = os.environ.get(VARIABLE)
    if not asked and sys.platform != "linux":
        return
    windowed = ["glfw"] if os.environ.get("DISPLAY") else []
    backends = dict.fromkeys([*([asked] if asked else windowed), "egl", "osmesa", OFF])
    taken = next(backend for backend in backends if _loads(backend))
    if asked and taken != asked:
        warnings.warn(f"{VARIABLE}={asked} cannot be used on this machine; {taken} is taken", stacklevel=2)


def _loads(backend: str) -> bool:
    os.environ[VARIABLE] = backend
    if backend == OFF:
        return True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW warns of a display that does not answer
            importlib.import_module("dm_control._render")
            if backend != "glfw" or importlib.import_module("glfw").init():
                return True
    except (ImportError, AttributeError, OSError, RuntimeError):  # no library, no device behind it, or no such word
        pass
    for name in [name for name in sys.modules if name.startswith(("dm_control._render", "OpenGL"))]:
        del sys.modules[name]
    os.environ.pop("PYOPENGL_PLATFORM", None)  # the attempt set it, and it would bind the next attempt
    return False
