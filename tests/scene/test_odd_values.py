"""Constants that are hardly meant are reported, of each once: units of moduli, friction in per cent."""

from __future__ import annotations

import logging

import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    gallery,
    solve_scene,
)
from fenics_contact._scene.plausible import odd_values
from fenics_contact.materials import IsotropicElasticity


def bar(young: float, friction: float = 0.3, length: float = 100.0) -> Scene:
    """A bar of 10 by 10 mm on a floor under 10 N/mm², which strains steel by 5e-5."""
    mesh = gallery.block((0, 0, 0), (length, 10, 10), (2, 1, 1))
    return Scene(
        bodies={"bar": Body(mesh, IsotropicElasticity(young, 0.0))},
        supports=[Support("bar", "x0"), Support("bar", "z1", (None, None, 0.0))],
        loads=[Traction("bar", "x1", (10.0, 0.0, 0.0))],
        contacts=[ContactPair(Surface("bar", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(friction))],
    )


def test_a_modulus_in_pascal_of_a_body_in_millimetres_is_reported() -> None:
    (words,) = odd_values(bar(2.1e11))
    assert words == (
        "odd units in body 'bar'? a Young's modulus of 2.1e+11 is that of a metal in Pa, the body is 100 "
        "long: with it lengths are in metres; in N/mm² it would be 210000"
    )


def test_friction_in_per_cent_is_reported() -> None:
    (words,) = odd_values(bar(2.1e5, friction=30.0))
    assert words.startswith(
        "odd friction in bar z0 on rigid plane? a coefficient of 30 is larger than that of any"
    )
    assert "0.3 if it is meant in per cent" in words


@pytest.mark.parametrize("scene", [bar(2.1e5), bar(2.1e11, length=0.1), bar(2.1e5, friction=1.5), bar(1.0)])
def test_usual_constants_are_not_reported(scene: Scene) -> None:
    assert list(odd_values(scene)) == []


def test_each_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    problem = ContactProblem(bar(2.1e11, friction=30.0), MPI.COMM_SELF)
    with caplog.at_level(logging.WARNING):
        problem.solve()
        problem.solve()
        problem.on(problem.scene).solve()
    assert [record.message.split(" in ")[0] for record in caplog.records] == ["odd units", "odd friction"]


@pytest.mark.parametrize(("young", "strain"), [(0.21, 47.6), (2.1e5, None)])
def test_a_small_strain_of_half_and_more_is_reported(
    caplog: pytest.LogCaptureFixture, young: float, strain: float | None
) -> None:
    """A pull of 10 strains by 10 / E where Poisson's ratio is zero."""
    scene = bar(young)
    with caplog.at_level(logging.WARNING):
        solve_scene(
            Scene(scene.bodies, [Support("bar", "x0", (0.0, None, None)), *free_of_turns()], scene.loads),
            MPI.COMM_SELF,
        )
    found = [record.message for record in caplog.records if "strained by" in record.message]
    assert len(found) == (strain is not None)
    if strain is not None:
        assert float(found[0].split("strained by ")[1].split()[0]) == pytest.approx(strain, rel=0.05)
        assert "are Young's modulus and loads in units that belong together" in found[0]


def free_of_turns() -> list[Support]:
    """Supports that leave a bar free to grow thinner."""
    return [Support("bar", "y0", (None, 0.0, None)), Support("bar", "z0", (None, None, 0.0))]
