"""Where no accuracy is reached because cells lock, the reason names that."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_contact import AccurateResult, Body, Limits, Scene, Support, Traction, solve_to
from fenics_contact._adaptive.locking import locking_in_words, locks
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke, PlaneStrain, PlaneStress
from fenics_contact.mesh import quadratic


def bent(poisson: float, share: float) -> AccurateResult:
    """A strip of triangles that is bent, to an accuracy on three meshes at most."""
    body = Body(rectangle((0.0, 0.0), (4.0, 1.0), (8, 2), "triangle"), PlaneStrain(1000.0, poisson))
    scene = Scene({"strip": body}, [Support("strip", "x0")], [Traction("strip", "x1", (0.0, 1.0))])
    return solve_to(scene, "strain_energy", share, MPI.COMM_SELF, limits=Limits(levels=3))


def test_the_reason_names_locking_where_no_accuracy_is_reached() -> None:
    locked = bent(0.4999, 0.01)
    assert not locked.reached
    assert "; linear cells of strip lock" in locked.reason
    assert "take quadratic cells" in locked.reason
    assert not bent(0.3, 1e-4).reached
    assert "lock" not in bent(0.3, 1e-4).reason


def test_cells_lock_where_each_point_keeps_its_volume() -> None:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (2, 2))
    assert locks(Body(mesh, PlaneStrain(1.0, 0.496)))  # K/G = 125
    assert not locks(Body(mesh, PlaneStrain(1.0, 0.494)))  # K/G = 83
    assert not locks(Body(quadratic(mesh), PlaneStrain(1.0, 0.4999)))
    assert not locks(Body(mesh, PlaneStress(1.0, 0.4999)))
    assert locks(Body(mesh, NeoHooke(1.0, 0.4999)))
    assert not locks(Body(mesh, NeoHooke(1.0, 0.4999, mean_dilatation=True)))


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_the_bodies_that_lock_are_named(poisson: float) -> None:
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (2, 2))
    bodies = {"soft": Body(mesh, PlaneStrain(1.0, poisson)), "steel": Body(mesh, PlaneStrain(2e5, 0.3))}
    supports = [Support(name, "x0") for name in bodies]
    words = locking_in_words(Scene(bodies, supports))
    assert words.startswith("linear cells of soft lock") == (poisson > 0.4)
    assert "steel" not in words
