"""Finding a way to draw without a screen, without touching the user's environment.

MuJoCo's package decides on OpenGL while it is imported, and PyOpenGL does so once for the life of a
process. So each way is tried in a process of its own, and the first that draws is then used here
by its own module, whatever MuJoCo's package has decided.
"""

import importlib
import os
import subprocess
import sys
from functools import cache
from typing import Any

from poise.errors import PoiseError

_WAYS = ("egl", "osmesa")
"""EGL first: it uses a graphics card where there is one."""

_TRIAL = """
import importlib, sys
import mujoco
context = importlib.import_module("mujoco." + sys.argv[1]).GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 50).free()
context.free()
"""

_TRIAL_SECONDS = 60.0
"""A driver that hangs counts as none."""

INSTALL_HINT = (
    "no OpenGL without a screen (neither EGL nor OSMesa): on Debian or Ubuntu install one with "
    "'apt install libegl1' or 'apt install libosmesa6'"
)
"""What to tell somebody whose machine cannot draw."""


class NoOpenGLError(PoiseError):
    """This machine cannot draw without a screen; the message says what to install."""


@cache
def find_opengl() -> str | None:
    """The way to draw without a screen that works here: "egl", "osmesa", or None.

    MUJOCO_GL and PYOPENGL_PLATFORM are obeyed if they name one of the two. The answer is kept for
    the life of the process.
    """
    for way in _candidates():
        try:
            done = subprocess.run(
                [sys.executable, "-c", _TRIAL, way],
                env=os.environ | {"MUJOCO_GL": way, "PYOPENGL_PLATFORM": way},
                capture_output=True,
                timeout=_TRIAL_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            continue
        if done.returncode == 0:
            return way
    return None


def make_context(width: int, height: int) -> Any:
    """Make an OpenGL context without a screen, current in this thread.

    Args:
        width: largest picture [pixel].
        height: largest picture [pixel].

    Returns:
        The context, to be freed with its `free()`.

    Raises:
        NoOpenGLError: this machine cannot draw.
    """
    way = find_opengl()
    if way is None:
        raise NoOpenGLError(INSTALL_HINT)
    context = importlib.import_module(f"mujoco.{way}").GLContext(width, height)
    context.make_current()
    return context


def _candidates() -> tuple[str, ...]:
    for variable in ("PYOPENGL_PLATFORM", "MUJOCO_GL"):
        wanted = os.environ.get(variable, "").lower()
        if wanted in _WAYS:
            return (wanted,)
    return _WAYS
