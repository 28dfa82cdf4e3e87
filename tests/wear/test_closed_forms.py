"""Wear against theory: punches that turn, bars and balls on plates, and a cylinder that frets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    RigidSurface,
    Scene,
    Surface,
    Wear,
    wear_to,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))
RADIUS, SLID = 6.0, 4e4


def pressed(mesh: Any, body: Any, force: float, wear: Wear, round_: bool = True, **pair: Any) -> Scene:
    """Return a body of which one surface stays rigid and is pressed down; `round_`: with a round foot."""
    height = float(mesh.points[:, 1].max())
    holder = RigidSurface("body", "y1", (0.0, height), **body[1], force=(0.0, -force))
    if round_:
        pair["gap"] = lambda x: x[:, 0] ** 2 / (2.0 * RADIUS)
    touching = ContactPair(Surface("body", "y0"), FLOOR, wear=wear, **pair)
    return Scene({"body": Body(mesh, **body[0])}, [holder], contacts=[touching])


REVOLVED: Any = {"axisymmetric": True}, {}
FLAT: Any = {}, {"displacement": (0.0, None), "rotation": 0.0}


def of(kind: Any, material: Any) -> Any:
    """Return the arguments of a body of a material, and those of its holder."""
    return {"material": material, **kind[0]}, kind[1]


def problem_of(scene: Scene) -> ContactProblem:
    """Return a problem whose states are much more accurate than jumps."""
    return ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)


def test_a_ring_that_turns_wears_in_to_a_pressure_that_falls_with_the_radius() -> None:
    """p r = F / (2π (R₂ − R₁)) where the holder is rigid, whatever E is, and p ~ r^(-1/m) with p^m."""
    inner, outer, force = 10.0, 30.0, 1000.0
    mesh = rectangle((inner, 0.0), (outer, 15.0), (32, 16))
    for exponent in (1.0, 2.0):
        turned = Wear(1e-5, exponent=exponent, sliding=lambda x: 2.0 * np.pi * x[:, 0])
        scene = pressed(mesh, of(REVOLVED, IsotropicElasticity(2e3, 0.3)), force, turned, round_=False)
        history = wear_to(problem_of(scene), 2e4, tolerance=0.02)
        contact = history.state.contact
        r, power = scene.points[contact.points.slave, 0], 1.0 - 1.0 / exponent
        moment = (outer ** (power + 1) - inner ** (power + 1)) / (power + 1)
        exact = force / (2.0 * np.pi * moment) * r ** (-1.0 / exponent)
        np.testing.assert_allclose(contact.pressure, exact, rtol=2e-3)
        assert history.depth.max() - history.depth.min() < 1e-2 * history.depth.max() + 1e-2


def test_a_bar_on_a_plate_wears_as_wide_as_its_volume_says() -> None:
    """A segment: k F s = 2 a³ / (3 R), its depth a² / (2 R), its pressure F / (2 a)."""
    force, k = 5.0, 1e-6
    mesh = rectangle((-1.5, 0.0), (1.5, 1.5), (100, 24))
    scene = pressed(mesh, of(FLAT, PlaneStrain(2e5, 0.3)), force, Wear(k, sliding=1.0))
    history = wear_to(problem_of(scene), SLID, tolerance=0.02)
    width = (1.5 * RADIUS * k * force * SLID) ** (1.0 / 3.0)
    contact = history.state.contact
    x = np.abs(scene.points[contact.points.slave, 0])
    assert history.volume[0] == pytest.approx(k * force * SLID, rel=1e-9)
    assert history.depth.max() == pytest.approx(width**2 / (2.0 * RADIUS), rel=2e-4)
    assert x[history.depth > 0.0].max() == pytest.approx(width, abs=0.03)
    pressure = contact.pressure[x < 0.7 * width]
    assert np.ptp(pressure) < 1e-3 * pressure.max(), "worn in, it is even"
    assert pressure.mean() == pytest.approx(force / (2.0 * width), rel=3e-3)


def test_a_ball_on_a_disc_has_a_scar_as_wide_as_its_volume_says() -> None:
    """A cap: k F s = π a⁴ / (4 R)."""
    force, k = 10.0, 1e-6
    mesh = rectangle((0.0, 0.0), (1.5, 1.5), (60, 24))
    scene = pressed(mesh, of(REVOLVED, IsotropicElasticity(2e5, 0.3)), force, Wear(k, sliding=1.0))
    history = wear_to(problem_of(scene), SLID, tolerance=0.02)
    width = (4.0 * RADIUS * k * force * SLID / np.pi) ** 0.25
    contact = history.state.contact
    r = scene.points[contact.points.slave, 0]
    assert history.volume[0] == pytest.approx(k * force * SLID, rel=1e-9)
    assert history.depth.max() == pytest.approx(width**2 / (2.0 * RADIUS), rel=2e-4)
    pressure = contact.pressure[r < 0.7 * width]
    assert np.ptp(pressure) < 1e-3 * pressure.max()
    assert pressure.mean() == pytest.approx(force / (np.pi * width**2), rel=2e-2)


def test_a_cylinder_that_frets_loses_its_force_times_its_slip() -> None:
    """The case of McColl, Ding and Leen (2004): 18.5 N/mm, ±25 µm, 18 000 cycles; k is 1e-8 mm²/N here."""
    force, k, cycles = 18.5, 1e-8, 18_000.0
    mesh = rectangle((-0.3, 0.0), (0.3, 0.3), (40, 12))
    stiffness = PlaneStrain(1e5, 0.3)  # of two equal bodies of steel together
    scene = pressed(mesh, of(FLAT, stiffness), force, Wear(k), friction=Coulomb(0.8))

    def moved(x: float) -> LoadStep:
        top = RigidSurface("body", "y1", (0.0, 0.3), (x, None), 0.0, force=(0.0, -force))
        return LoadStep(f"to {x}", supports=[top])

    history = wear_to(
        ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-7), cycles,
        steps=[moved(0.025), moved(-0.025)], first=[LoadStep("press")], tolerance=0.05,
    )  # fmt: skip
    contact = history.state.contact
    slip = np.linalg.norm(contact.slip, axis=1)[contact.normal_force > 0.0]
    assert 0.98 * 0.05 < slip.min() <= slip.max() < 0.05, "it slides as a whole, less what bodies give way"
    assert history.volume[0] / (k * force * cycles) == pytest.approx(2.0 * slip.mean(), rel=2e-3)
    width = (1.5 * RADIUS * history.volume[0]) ** (1.0 / 3.0)
    assert width == pytest.approx(0.143, rel=0.01)
    assert history.depth.max() == pytest.approx(width**2 / (2.0 * RADIUS), rel=0.02)
    assert history.jumps[-1].depth_error < 0.05 * history.depth.max()
