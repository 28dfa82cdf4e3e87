"""Without OpenGL there is an error that says what to install, not a dead process."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator

import pytest

from fenics_contact.errors import MissingRequirementError
from fenics_contact.viz import check_libraries, check_renderer, renderer


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


@pytest.mark.parametrize("missing", ["pyvista", "matplotlib"])
def test_a_missing_library_is_named(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == missing else found(name))
    with pytest.raises(MissingRequirementError, match=rf"pictures need {missing}, found none: pip install"):
        check_libraries()
