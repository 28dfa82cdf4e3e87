"""Contact and ties of periodic bodies: edges that equations move alike carry one force."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ConstraintTerm,
    ContactPair,
    ContactProblem,
    Coulomb,
    LinearConstraint,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tie,
    solve_scene,
    solve_steps,
)
from fenics_contact.design.contact_derivatives import contact_by_shape
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic
from tools.hard_cases.transform import renumbered_mesh

LAWS = {"low": IsotropicElasticity(1.0, 0.3), "up": IsotropicElasticity(2.0, 0.2)}
SUNK, DRAWN = 0.02, 0.01


def cell(body: str, at: float, seed: int | None, second: bool) -> BodyMesh:
    """A periodic cell of one or two cells along each side, numbered at random."""
    mesh = block((0.0, 0.0, at), (1.0, 1.0, at + 1.0), (1, 1, 1) if second else (2, 2, 1))
    mesh = mesh if seed is None else renumbered_mesh(mesh, seed + len(body))[0]
    return quadratic(mesh) if second else mesh


def alike(body: str, value: float = 0.0) -> list[LinearConstraint]:
    """Opposite sides of a body move alike but for a mean strain along x."""
    return [
        LinearConstraint(
            [ConstraintTerm(body, f"{a}1", w), ConstraintTerm(body, f"{a}0", w, -1.0)],
            value if a == w == "x" else 0.0,
            f"{body}{a}{w}",
            "translation",
        )
        for a in "xy"
        for w in "xyz"
    ]


def stack(seed: int | None = None, *, second: bool = True, mu: float = 0.05, kind: str = "mortar") -> Scene:
    """A periodic layer pressed on another one."""
    bodies = {
        name: Body(cell(name, at, seed, second), LAWS[name]) for name, at in (("low", 0.0), ("up", 1.0))
    }
    pair = ContactPair(Surface("up", "z0"), Surface("low", "z1"), Coulomb(mu), kind)  # type: ignore[arg-type]
    held = [Support("low", "z0"), Support("up", "z1", (0.0, 0.0, -SUNK))]
    return Scene(bodies, held, contacts=[pair], constraints=[*alike("low"), *alike("up")])


def stiffness(part: str) -> float:
    """Of both layers in series, against compression without lateral strain or shear."""
    parts = [law.young_modulus / (1.0 + law.poisson_ratio) for law in LAWS.values()]
    if part == "normal":
        parts = [E * (1.0 - law.poisson_ratio) / (1.0 - 2.0 * law.poisson_ratio)
                 for E, law in zip(parts, LAWS.values(), strict=True)]  # fmt: skip
    else:
        parts = [0.5 * E for E in parts]
    return 1.0 / sum(1.0 / E for E in parts)


@pytest.mark.parametrize(("second", "kind"), [(True, "mortar"), (False, "mortar"), (False, "node")])
@pytest.mark.parametrize("mu", [0.05, 0.9])
def test_periodic_layers_rub_evenly_whatever_the_numbers_of_nodes(second: bool, kind: str, mu: float) -> None:
    for seed in (None, 1):
        scene = stack(seed, second=second, mu=mu, kind=kind)
        drawn = [Support("low", "z0"), Support("up", "z1", (DRAWN, 0.0, -SUNK))]
        steps = [LoadStep("pressed"), LoadStep("drawn", supports=drawn)]
        contact = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), steps)[-1].contact
        assert contact.points.count == 4
        assert contact.points.area == pytest.approx(np.full(4, 0.25))
        pressure = SUNK * stiffness("normal")
        np.testing.assert_allclose(contact.normal_force, 0.25 * pressure, rtol=1e-7)
        shear = min(mu * pressure, DRAWN * stiffness("shear"))
        friction = np.linalg.norm(contact.friction_force, axis=1)
        np.testing.assert_allclose(friction, 0.25 * shear, rtol=1e-6)


def test_tied_periodic_layers_are_one() -> None:
    scene = stack(1)
    tie = Tie(scene.contacts[0].slave, scene.contacts[0].master)  # type: ignore[arg-type]
    state = solve_scene(replace(scene, contacts=[], ties=[tie]), MPI.COMM_SELF, tolerance=1e-10)
    assert state.torn.ties.count == 4
    below = state.reactions()["low z0"].force
    assert below[2] == pytest.approx(SUNK * stiffness("normal"), rel=1e-7)


def on_other_cells(scene: Scene, count: int, cells: Literal["hexahedron", "tetrahedron"]) -> Scene:
    finer = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (count, count, 1), cells)
    return replace(scene, bodies={**scene.bodies, "low": Body(finer, LAWS["low"])})


@pytest.mark.parametrize(("count", "cells"), [(2, "tetrahedron"), (3, "hexahedron"), (5, "tetrahedron")])
@pytest.mark.parametrize("mu", [0.05, 0.9])
def test_points_at_periodic_edges_are_means_over_both_sides_where_meshes_differ(
    count: int, cells: Literal["hexahedron", "tetrahedron"], mu: float
) -> None:
    """By mortar their rows differ, as facets at both edges do, and yet depend on each other."""
    other = on_other_cells(stack(3, second=False, mu=mu), count, cells)
    held = [Support("low", "z0"), Support("up", "z1", (DRAWN, 0.0, -SUNK))]
    contact = solve_scene(replace(other, supports=held), MPI.COMM_SELF, tolerance=1e-10).contact
    assert contact.points.count == 4
    pressure = SUNK * stiffness("normal")
    np.testing.assert_allclose(contact.normal_force, 0.25 * pressure, rtol=1e-7)
    shear = min(mu * pressure, DRAWN * stiffness("shear"))
    np.testing.assert_allclose(np.linalg.norm(contact.friction_force, axis=1), 0.25 * shear, rtol=1e-6)


def test_derivatives_of_means_over_different_facets_are_refused() -> None:
    state = solve_scene(on_other_cells(stack(second=False), 3, "hexahedron"), MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match="meet alike at both periodic edges, got means"):
        contact_by_shape(state.torn, None, np.zeros(4), 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("periodic", ["up", "low"])
def test_edges_of_a_periodic_body_on_one_that_is_not_are_two_places(periodic: str) -> None:
    for kind in ("mortar", "node"):
        scene = stack(2, second=False, kind=kind)
        scene = replace(scene, constraints=alike(periodic))
        assert solve_scene(scene, MPI.COMM_SELF).contact.points.count == 9


@pytest.mark.parametrize("law", [None, Coulomb(0.3)])
def test_edges_that_strain_apart_are_one_place_unless_they_rub(law: Coulomb | None) -> None:
    floor = ContactPair(Surface("low", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), law)
    held = [Support("low", "z1", (None, None, -SUNK)), Support("low", "corner", (0.0, 0.0, None))]
    mesh = cell("low", 0.0, 3, False)
    corner = np.flatnonzero(np.abs(mesh.points - (0.0, 0.0, 1.0)).max(axis=1) < 1e-9)
    mesh, strain = replace(mesh, node_sets={"corner": corner}), 0.01
    scene = Scene({"low": Body(mesh, LAWS["low"])}, held, contacts=[floor], constraints=alike("low", strain))
    contact = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10).contact
    assert contact.points.count == (4 if law is None else 6)
    if law is None:
        soft = LAWS["low"]
        nu, factor = soft.poisson_ratio, soft.young_modulus / (1.0 + soft.poisson_ratio)
        pressure = factor / (1.0 - 2.0 * nu) * ((1.0 - nu) * SUNK - nu * strain)
        np.testing.assert_allclose(contact.normal_force, 0.25 * pressure, rtol=1e-7)
