"""A run loads what it needs: small scenes take as long as their imports."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable
from types import ModuleType

import pytest

import fenics_contact
from fenics_contact import ContactPair, Surface, design
from fenics_contact._base.form_language import without_setuptools
from fenics_contact._dolfinx.loading import old
from tests.conftest import ROOT, launch
from tests.house.public import rooms

SOLVING = """
import sys
before = set(sys.modules)  # what this installation of Python loads itself
from mpi4py import MPI
{first}
from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface, Traction
from fenics_contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results import ContactResult
mesh = block((0, 0, 0), (2, 1, 1), (2, 2, 2))
plane = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -0.02), (0, 0, 1)), Coulomb(0.3))
scene = Scene(
    {{"block": Body(mesh, IsotropicElasticity(1.0, 0.3))}},
    [Support("block", "x0")],
    [Traction("block", "z1", (0.0, 0.0, -0.05))],
    [plane],
)
state = solve_scene(scene, MPI.COMM_SELF)
assert isinstance(state.contact, ContactResult)
assert state.contact.normal_force.sum() > 0.01
sys.stdout.write(" ".join(set(sys.modules) - before))
"""

#: What newer libraries load whoever imports them: ufl reads its own metadata, scipy loads numpy.testing.
LIBRARIES = """
import sys
before = set(sys.modules)
import mpi4py.MPI, ufl, basix, scipy.linalg, scipy.sparse.csgraph, scipy.sparse.linalg, scipy.spatial
import dolfinx, dolfinx.fem.petsc, dolfinx.io, dolfinx.mesh
sys.stdout.write(" ".join(set(sys.modules) - before))
"""

#: Modules that a solution of a linear scene does not need; each takes more than a millisecond.
NEVER = {
    "IPython", "email", "gmsh", "h5py", "html", "importlib.metadata", "importlib.resources", "matplotlib",
    "meshio", "numba", "numpy.testing", "pandas", "pkg_resources", "pydantic", "pyvista", "requests",
    "scipy.interpolate", "scipy.optimize", "setuptools", "sympy", "unittest", "vtkmodules", "xml",
}  # fmt: skip
#: Rooms and modules of the package that it does not need either.
NOT_OURS = {
    "design", "gallery.bolted", "gallery.links", "gallery.ring", "materials.orthotropic", "output",
    "pictures", "qp.compliance", "readers", "shapes.profile", "shapes.rounded", "shapes.triangulation",
    "study",
}  # fmt: skip


def _theirs(mpirun: Callable[..., str]) -> set[str]:
    """Return the modules that libraries load by themselves."""
    # The oldest dolfinx asks setuptools for versions, which the package prevents.
    return set() if old() else set(mpirun(LIBRARIES, 1, fresh=True).split())


def test_a_linear_scene_loads_what_it_needs(mpirun: Callable[..., str]) -> None:
    loaded = set(mpirun(SOLVING.format(first=""), 1, fresh=True).split())
    assert {"fenics_contact.feti.factor", "dolfinx", "ufl", "scipy.sparse"} <= loaded
    theirs = _theirs(mpirun)
    assert (loaded - theirs) & NEVER == set()
    assert loaded & {f"fenics_contact.{name}" for name in NOT_OURS} == set()
    # 687 with Python 3.11 and dolfinx 0.5; 925 before names were loaded late.
    assert len(loaded - theirs) < 800


def test_all_names_at_once_load_neither_pictures_nor_models_of_files(mpirun: Callable[..., str]) -> None:
    loaded = set(mpirun(SOLVING.format(first="from fenics_contact import *"), 1, fresh=True).split())
    theirs = _theirs(mpirun)
    assert {f"fenics_contact.{entry}" for entry in ("_page.entry", "_scene_file.entry", "decks")} <= loaded
    late = {
        "IPython", "gmsh", "matplotlib", "pandas", "pkg_resources", "plotly", "pydantic", "pyvista", "rich",
        "tomlkit", "typer", "vtkmodules",
    }  # fmt: skip
    assert (loaded - theirs) & late == set()
    # 909 with Python 3.11 and dolfinx 0.5, without what draws and without the models of scene files' keys.
    assert len(loaded - theirs) < 1050


def test_a_scene_file_loads_what_it_needs() -> None:
    scene = ROOT / "demos" / "scenes" / "two_blocks.toml"
    code = f"""
        import sys
        from fenics_contact.__main__ import main
        assert main(["run", {str(scene)!r}, "--dry-run"]) == 0
        sys.stdout.write(" ".join(["loaded", *sys.modules]))
    """
    answer = launch(1, "-c", inspect.cleandoc(code))
    loaded = set(answer.stdout.rpartition("loaded ")[2].split())
    assert "fenics_contact._scene_file" in loaded, answer.stderr
    late = {"gmsh", "IPython", "matplotlib", "pyvista", "scipy.interpolate", "scipy.optimize"}
    assert loaded & late == set()


@pytest.mark.parametrize("room", rooms(), ids=lambda room: room.__name__.partition(".")[2])
def test_public_names_are_no_submodules_whatever_is_loaded_first(room: ModuleType) -> None:
    for found in pkgutil.iter_modules(getattr(room, "__path__", [])):
        importlib.import_module(f"{room.__name__}.{found.name}")
    assert len(room.__all__) > 3
    hidden = [name for name in room.__all__ if isinstance(getattr(room, name), ModuleType)]
    assert hidden == (["figures"] if room.__name__ == "fenics_contact.study" else [])
    assert set(dir(room)) >= set(room.__all__)


def test_a_name_that_a_room_does_not_have_is_refused() -> None:
    with pytest.raises(AttributeError, match=r"'fenics_contact\.qp' has no attribute 'solve_everything'"):
        fenics_contact.qp.solve_everything  # type: ignore[attr-defined]


def test_a_library_finds_its_version_without_setuptools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "pkg_resources", raising=False)
    with without_setuptools():
        versions = importlib.import_module("pkg_resources")
        assert versions.get_distribution("numpy").version == importlib.metadata.version("numpy")
    assert "pkg_resources" not in sys.modules


def test_a_library_that_needs_more_of_setuptools_gets_it(monkeypatch: pytest.MonkeyPatch) -> None:
    true = ModuleType("pkg_resources")
    monkeypatch.setitem(sys.modules, "pkg_resources", true)
    with without_setuptools():
        assert importlib.import_module("pkg_resources") is true  # whoever has loaded it keeps it
    monkeypatch.delitem(sys.modules, "pkg_resources")
    true.resource_filename = "of the true one"  # type: ignore[attr-defined]
    true.get_distribution = str.upper  # type: ignore[attr-defined]
    with without_setuptools():
        versions = importlib.import_module("pkg_resources")
        monkeypatch.setattr("fenics_contact._base.form_language.import_module", {"pkg_resources": true}.get)
        assert versions.resource_filename == "of the true one"
        assert versions.get_distribution("never-installed") == "NEVER-INSTALLED"


def test_old_names_warn_and_are_the_new_ones() -> None:
    with pytest.warns(DeprecationWarning, match="PressureUnevenness is now PressureNonuniformity"):
        assert design.PressureUnevenness is design.PressureNonuniformity
    pair = ContactPair(Surface("a", "x0"), Surface("a", "x1"))
    with pytest.warns(DeprecationWarning, match="within_body is now is_self_contact"):
        assert pair.within_body
    assert not set(design.__all__) & {"PressureUnevenness", "Pieced"}
