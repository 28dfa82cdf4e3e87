"""Without OpenGL there is an error that says what to install, not a dead process."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Iterator

import pytest

from fenics_contact import clean_environment
from fenics_contact.errors import MissingRequirementError
from fenics_contact.pictures import canvas as renderer
from fenics_contact.pictures._libraries import check_libraries
from fenics_contact.pictures.canvas import check_renderer

#: Draws a ball, and tells whether the environment is changed afterwards.
DRAWN = """
import os
import numpy as np
from fenics_contact.pictures.canvas import Layer, balls, render
from fenics_contact.pictures.canvas import Frame, face_on
layers = [Layer(balls(np.zeros((1, 3)), 0.5))]
frame = Frame(np.array([-2.0, -1.0]), np.array([2.0, 1.0]))
image = render(layers, face_on(np.array([0.0, 0.0, 1.0])), frame, 40)
print(image.shape, "VTK_DEFAULT_OPENGL_WINDOW" in os.environ)
"""


@pytest.fixture
def fresh_probe() -> Iterator[None]:
    renderer._probe.cache_clear()
    yield
    renderer._probe.cache_clear()


def test_this_machine_can_render() -> None:
    check_renderer()


@pytest.mark.parametrize(
    ("probe", "ending"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "died by signal 11"),
        ("raise SystemExit(3)", "ended with exit status 3"),
    ],
)
@pytest.mark.usefixtures("fresh_probe")
def test_a_dying_renderer_is_reported_with_the_remedy(
    probe: str, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(renderer, "_PROBE", probe)
    with pytest.raises(MissingRequirementError) as error:
        check_renderer()
    for words in (ending, "libegl1", "VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow"):
        assert words in str(error.value)


@pytest.mark.usefixtures("fresh_probe")
def test_another_environment_is_probed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    check_renderer()
    monkeypatch.setattr(renderer, "_PROBE", "raise SystemExit(1)")
    check_renderer()
    monkeypatch.setenv("DISPLAY", ":77")
    with pytest.raises(MissingRequirementError):
        check_renderer()


def test_without_a_display_pictures_are_drawn_without_complaints(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "VTK_DEFAULT_OPENGL_WINDOW"):
        monkeypatch.delenv(name, raising=False)
    done = subprocess.run(
        [sys.executable, "-c", DRAWN], env=clean_environment(), capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "(40, 80, 3) False\n", "")


@pytest.mark.parametrize("missing", ["pyvista", "matplotlib"])
def test_a_missing_library_is_named(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == missing else found(name))
    with pytest.raises(MissingRequirementError, match=rf"pictures need {missing}: pip install"):
        check_libraries()
