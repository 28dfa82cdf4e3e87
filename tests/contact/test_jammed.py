"""A wedge that friction holds where it was driven: a load step goes on from the last equilibrium."""

from __future__ import annotations

from functools import cache

import pytest

from fenics_contact import Body, ContactPair, Coulomb, FixedPoint, RigidPlane, Scene, State, Support, Surface
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import FaceNewton, Smalse
from tests.contact.wedges import FRICTION, driven, follow, wedge


def pressed(state: State) -> float:
    return float(state.contact.normal_force.sum())


@cache
def hardly_loaded() -> State:
    return follow(wedge(5.0), (50.0, 25.0, 1e-7))[-1]


SOLVERS = [FaceNewton(1e-8), FixedPoint(FaceNewton(1e-8)), FixedPoint(Smalse(1e-5))]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_wedge_stays_where_it_was_driven_when_nothing_acts(solver: FaceNewton | FixedPoint) -> None:
    *_, nothing = follow(wedge(5.0), (50.0, 25.0, 0.0), solver=solver)
    hardly = hardly_loaded()

    assert pressed(nothing) > 50.0
    same = pytest.approx(hardly.contact.normal_force, abs=100.0 * solver.tolerance * pressed(hardly))
    assert nothing.contact.normal_force == same


def test_a_jammed_wedge_holds_a_pull_up_to_what_friction_bears() -> None:
    scene = wedge(5.0)
    pulled = follow(scene, (50.0, 0.0, -5.0, 0.0, -5.0))
    assert pressed(pulled[-1]) == pytest.approx(pressed(pulled[2]), rel=1e-6)

    with pytest.raises(InfeasibleError, match="every loaded body must be held"):
        follow(scene, (50.0, 0.0, -500.0))


def test_a_wedge_too_blunt_to_jam_is_left_without_any_force() -> None:
    *_, pushed, nothing = follow(wedge(25.0), (50.0, 20.0, 0.0))

    assert pressed(pushed) > 20.0
    assert not nothing.contact.normal_force.any()


def test_a_block_on_a_floor_is_let_go_at_the_cost_of_three_load_steps() -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (9, 5))
    pair = ContactPair(Surface("wedge", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), Coulomb(FRICTION))
    held = [Support("wedge", "x0")]
    scene = Scene({"wedge": Body(mesh, PlaneStrain(1000.0, 0.3))}, held, driven(1.0), [pair])

    pushed, less, nothing = follow(scene, (50.0, 20.0, 0.0))

    assert not nothing.contact.normal_force.any()
    assert nothing.solution.products <= 3 * max(pushed.solution.products, less.solution.products)


@pytest.mark.parametrize("pieces", [1, 2, 5])
def test_the_wedge_stays_however_it_is_cut(pieces: int) -> None:
    """At once from the full load: Newton's method lets go of the wedge in some partitions."""
    *_, nothing = follow(wedge(5.0), (50.0, 0.0), pieces)

    assert pressed(nothing) == pytest.approx(104.5, rel=1e-3)
