"""Shapes of bodies of revolution as designs: the adjoint agrees with difference quotients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    Pressure,
    RigidSphere,
    Scene,
    Support,
    Surface,
    ThermalStrain,
    TotalForce,
    Traction,
    Tresca,
)
from fenics_contact._scene.parts import surface_of
from fenics_contact.design import ContactArea, Movement, PressureNorm
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic
from tests.design.aims import aims
from tests.design.deformed_blocks import design_problem, pressed
from tests.design.objectives import objectives
from tests.design.plane_blocks import line_of
from tests.design.quotients import Line, check_adjoint
from tests.scenes import Friction, crowned

RUBBER, PLASTIC = IsotropicElasticity(100.0, 0.3, 1e-3), IsotropicElasticity(300.0, 0.2, 1e-3)
OBJECTIVES = {**objectives("block"), **aims("block", "y0", 2)}


def on_block(friction: Friction, by: str, *, order: int = 1, heat: float = 0.0) -> Scene:
    """A heavy crowned ring on a rounded one, pressed and pushed outwards."""
    inner, warmed = 0.5, [ThermalStrain("block", heat)] if heat else []
    lower = rectangle((inner, -1.0), (inner + 2.0, 0.0), (7, 3))
    r, z = lower.points.T
    lower = lower.moved(np.column_stack([r, z - 0.02 * (r - inner - 1.0) ** 2 * (z + 1.0)]))
    upper = crowned(rectangle((inner + 0.13, 0.0), (inner + 1.87, 0.8), (9, 3)), 0.04)
    if order == 2:
        lower, upper = quadratic(lower), quadratic(upper)
    return Scene(
        {
            "lower": Body(lower, PLASTIC, axisymmetric=True),
            "block": Body(upper, RUBBER, axisymmetric=True),
        },
        [Support("lower", "y0")],
        [
            Traction("block", "y1", (0.6, -2.0)),
            BodyForce("block", (0.1, -1.0)),
            TotalForce("block", "y1", (3.0, -4.0)),
            Pressure("block", "x0", 0.3),
            *warmed,
        ],
        [ContactPair(Surface("block", "y0"), Surface("lower", "y1"), friction, discretisation=by)],
    )


def on_ball() -> Scene:
    """A disc on a rigid ball, which it touches on its axis, with the tip of a flat cone."""
    mesh = rectangle((0.0, 0.0), (1.0, 0.6), (9, 4))
    r, z = mesh.points.T
    mesh = mesh.moved(np.column_stack([r, z + 0.03 * r * (0.6 - z)]))
    return Scene(
        {"block": Body(mesh, RUBBER, axisymmetric=True)},
        loads=[Pressure("block", "y1", 3.0)],
        contacts=[ContactPair(Surface("block", "y0"), RigidSphere((0.0, -6.0), 6.0), Coulomb(0.2))],
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "node": lambda: on_block(Coulomb(0.38), "node"),
    "mortar, warm": lambda: on_block(Coulomb(0.38), "mortar", heat=1.0),
    "tresca": lambda: on_block(Tresca(0.4), "node"),
    "quadratic": lambda: on_block(Coulomb(0.38), "node", order=2),
    "ball": on_ball,
}


@cache
def line(name: str) -> Line:
    return line_of(SCENES[name]())


#: Those that depend on different derivatives: of forces, of areas, of displacements, of stresses.
FEW = ("energy", "friction forces", "pressure norm", "displacement")
CASES = [
    (name, objective)
    for name in SCENES
    for objective in OBJECTIVES
    if name in ("node", "mortar, warm") or objective in FEW
]


@pytest.mark.parametrize(("name", "objective"), CASES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    if (name, objective) != ("mortar, warm", "strain energy"):  # heat stores none
        check_adjoint(line(name), OBJECTIVES[objective], 2e-3)


@pytest.mark.parametrize("master", ["block", "disc"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_adjoint_of_rubber_agrees_with_central_differences(master: str, friction: float) -> None:
    scene = pressed(master, friction, 0.0)
    aside = np.array([0.5 if master == "block" else 0.0, 0.0])
    meshes = {name: body.mesh.moved(body.mesh.points + aside) for name, body in scene.bodies.items()}
    scene = replace(
        scene,
        bodies={
            name: Body(meshes[name], body.material, axisymmetric=True) for name, body in scene.bodies.items()
        },
        supports=[replace(each, value=(None, *each.value[1:])) for each in scene.supports],
        loads=[Pressure("block", "x1", 0.02, dead=True)],
    )
    objective = PressureNorm() + 0.2 * ContactArea() + 0.5 * Movement("block", "x1", (1, 0))
    problem = design_problem(scene, objective, tolerance=1e-12)
    alpha, along = 0.01 * np.sin(np.arange(problem.size)), np.cos(np.arange(problem.size))
    by_adjoint = problem.evaluate(alpha).gradient @ along
    ahead, behind = (problem.value_of(alpha + sign * 3e-5 * along) for sign in (1, -1))
    assert by_adjoint == pytest.approx((ahead - behind) / 6e-5, rel=1e-5)


def test_nodes_stay_on_the_axis() -> None:
    here = line("ball")
    body = here.problem.scene_of(here.alpha + here.direction * 0.01).bodies["block"]
    before = here.problem.scene.bodies["block"]
    tip = surface_of(here.problem.scene, Surface("block", "y0"), "faceted")
    np.testing.assert_array_equal(tip.normals[tip.points[:, 0] == 0.0], [[0.0, -1.0]])
    assert np.array_equal(body.on_axis, before.on_axis)
    assert np.abs(body.mesh.points - before.mesh.points)[before.on_axis, 1].max() > 0.0


def test_volume_is_that_of_the_whole_body_with_its_gradient() -> None:
    here = line("node")
    volume, gradient = here.problem.volume(here.alpha)
    ahead, behind = (here.problem.volume(here.alpha + s * 1e-5 * here.direction)[0] for s in (1, -1))
    assert gradient @ here.direction == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)
    assert volume == pytest.approx(
        sum(np.pi * (o**2 - i**2) * h for i, o, h in ((0.5, 2.5, 1.0), (0.63, 2.37, 0.8))), rel=0.05
    )
