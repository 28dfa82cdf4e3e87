"""Building a link leaves the caller's gmsh, terminal and interrupt handler as they were."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from types import ModuleType

import pytest

from fenics_contact import clean_environment
from fenics_contact.gallery import LinkShape, chain_link
from fenics_contact.readers import gmsh_model
from tests.house.source import ROOT

SMALL = LinkShape(n_around=12, n_a=1, n_b=2)


@pytest.fixture
def gmsh() -> Iterator[ModuleType]:
    """A session of the caller's own with two models and an option changed."""
    handler = signal.getsignal(signal.SIGINT)
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.model.add("other")
    gmsh.model.add("mine")
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.setCurrent("other")
    yield gmsh
    gmsh.finalize()
    signal.signal(signal.SIGINT, handler)


def test_the_callers_models_and_options_are_kept(gmsh: ModuleType) -> None:
    models = list(gmsh.model.list())
    assert chain_link(SMALL).mesh.cells.shape == (24, 8), "not the caller's quadratic elements"
    assert list(gmsh.model.list()) == models
    assert gmsh.model.getCurrent() == "other"
    assert gmsh.option.getNumber("Mesh.ElementOrder") == 2
    gmsh.model.setCurrent("mine")
    assert len(gmsh.model.getEntities(3)) == 1


def test_a_model_of_the_same_name_is_kept(gmsh: ModuleType) -> None:
    gmsh.model.setCurrent("mine")
    with gmsh_model("mine"):
        assert gmsh.model.getEntities() == []
    assert gmsh.model.getCurrent() == "mine"
    assert len(gmsh.model.getEntities(3)) == 1


def test_an_error_inside_leaves_the_session_as_it_was(gmsh: ModuleType) -> None:
    models = list(gmsh.model.list())
    with pytest.raises(RuntimeError, match="inside"), gmsh_model("fleeting"):
        raise RuntimeError("inside")
    assert list(gmsh.model.list()) == models
    assert gmsh.option.getNumber("Mesh.ElementOrder") == 2


def test_the_interrupt_handler_is_kept_and_nothing_is_written() -> None:
    code = """
import signal, sys
handler = lambda *_: None
signal.signal(signal.SIGINT, handler)
from fenics_contact.gallery import LinkShape, chain_link
assert "gmsh" not in sys.modules, "gmsh is imported where it is used only"
for _ in range(3):
    chain_link(LinkShape(n_around=12, n_a=1, n_b=2))
    assert signal.getsignal(signal.SIGINT) is handler
import gmsh
gmsh.initialize()
assert list(gmsh.model.list()) == [""]
assert gmsh.option.getNumber("General.Terminal") == 1
gmsh.finalize()
"""
    answer = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=clean_environment(),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")
