"""MuJoCo, whose import loads the OpenGL back end that MUJOCO_GL names; without its own log."""

import importlib
import os

from poise.errors import ConfigurationError, MissingExtraError, PoiseError

# Debian's package with the library of each back end
_PACKAGES = {"egl": "libegl1", "osmesa": "libosmesa6", "glfw": "libglfw3"}


def refusal() -> PoiseError | None:
    """Import MuJoCo; the error to raise where it or its back end is not there, else None."""
    try:
        importlib.import_module("mujoco")
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "mujoco":
            return MissingExtraError("mujoco", "sim", "Simulation")
        # Each back end fails in its own way: PyOpenGL by an AttributeError, for one.
        asked = os.environ.get("MUJOCO_GL", "").lower().strip()
        if not asked:
            raise
        if asked in _PACKAGES:
            return _missing("MUJOCO_GL", asked)
        return ConfigurationError(
            "MUJOCO_GL is no OpenGL back end of MuJoCo's",
            got=asked,
            wanted="egl (Debian's libegl1), osmesa (Debian's libosmesa6), glfw, or no MUJOCO_GL",
        )
    return None


def asked_platform() -> tuple[str, str] | None:
    """The variable that names a platform to draw on without a screen, and the platform."""
    for variable in ("PYOPENGL_PLATFORM", "MUJOCO_GL"):
        asked = os.environ.get(variable, "").lower().strip()
        if asked in ("egl", "osmesa"):
            return variable, asked
    return None


def missing_library() -> MissingExtraError:
    """The error of a machine that cannot draw without a screen."""
    asked = asked_platform()
    if asked is not None:
        return _missing(*asked)
    install = "apt install libegl1, or apt install libosmesa6 (Debian, Ubuntu)"
    return MissingExtraError("libegl1", "", "Drawing without a screen", install=install)


def silence() -> None:
    """Keep MuJoCo's own log off the screen and out of MUJOCO_LOG.TXT, in this process."""
    config = importlib.import_module("mujoco").MjLogConfig.get()
    config.logto_console = config.logto_file = False
    config.set()


def _missing(variable: str, platform: str) -> MissingExtraError:
    package, doing = _PACKAGES[platform], f"Drawing with {variable}={platform}"
    install = f"apt install {package} (Debian, Ubuntu); or unset {variable}"
    return MissingExtraError(package, "", doing, install=install)
