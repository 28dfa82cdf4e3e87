"""Test whether this machine can render, in a separate process, as VTK without OpenGL dies by a signal."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache

from fenics_contact.errors import MissingRequirementError
from fenics_contact.launching import clean_environment

#: Renders a window of four pixels. The result depends only on environment and shared libraries.
_PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderWindow
import vtkmodules.vtkRenderingOpenGL2
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(2, 2)
window.Render()
"""

#: Environment variables that decide where VTK looks for OpenGL.
_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
_DECIDING = (_CHOICE, "VTK_DEFAULT_EGL_DEVICE_INDEX", "DISPLAY", "LD_LIBRARY_PATH")
_EGL = "vtkEGLRenderWindow"


@contextmanager
def rendering() -> Iterator[None]:
    """Let VTK use EGL within the block if there is no display and no other choice is set.

    VTK itself tries X first and warns if there is none. The environment is restored afterwards.

    Raises:
        MissingRequirementError: If this machine cannot render.
    """
    check_renderer()
    if not _chooses_egl():
        yield
        return
    os.environ[_CHOICE] = _EGL
    try:
        yield
    finally:
        del os.environ[_CHOICE]


def _chooses_egl() -> bool:
    if any(os.environ.get(name) for name in (_CHOICE, "DISPLAY", "WAYLAND_DISPLAY")):
        return False
    return not _probe((_EGL, *_deciding()[1:]))


def _deciding() -> tuple[str | None, ...]:
    return tuple(os.environ.get(name) for name in _DECIDING)


def check_renderer() -> None:
    """Make sure that pyvista can draw, with or without a display; takes half a second, once.

    Raises:
        MissingRequirementError: If there is neither EGL nor OSMesa nor an X server to draw with.
    """
    if _chooses_egl():
        return
    ending = _probe(_deciding())
    if ending:
        window = os.environ.get(_CHOICE, "not set")
        raise MissingRequirementError(
            f"pictures need EGL, OSMesa or an X server to draw with, but a trial rendering {ending} "
            f"(VTK_DEFAULT_OPENGL_WINDOW is {window}): install EGL (Debian: apt-get install libegl1; "
            "elsewhere what brings libEGL.so.1) and set VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow",
            name="libegl1",
        )


@lru_cache(maxsize=4)
def _probe(environment: tuple[str | None, ...]) -> str:
    """Return how a trial rendering failed, empty if it succeeded; the other entries are keys of the cache."""
    variables = {name: value for name, value in clean_environment().items() if name != _CHOICE}
    if environment[0]:
        variables[_CHOICE] = environment[0]
    try:
        ending = subprocess.run(
            [sys.executable, "-c", _PROBE], env=variables, capture_output=True, timeout=120.0, check=False
        )
    except subprocess.TimeoutExpired:
        return "did not end within two minutes"
    if ending.returncode < 0:
        return f"died by signal {-ending.returncode}"
    return f"ended with exit status {ending.returncode}" if ending.returncode else ""
