"""Heat of friction: shares of both bodies, conservation, and temperatures known by formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import RigidPlane, Surface
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    FrictionHeat,
    HeatProblem,
    HeatScene,
    HeldTemperature,
    TemperatureTable,
    ThermalContact,
    effusivity_share,
    solve_heat,
)
from fenics_contact.heat.assembly import Rate
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quadratic import quadratic

UPPER, LOWER = Surface("upper", "y0"), Surface("lower", "y1")
Cells: TypeAlias = Callable[[BodyMesh], BodyMesh]


def same(mesh: BodyMesh) -> BodyMesh:
    """Return a mesh as it is."""
    return mesh


PAD, DISC = Conductor(2.0, 3.0), Conductor(50.0, 4.0)


def brake(
    friction: FrictionHeat, *, conductance: float = 30.0, cells: Cells = same, **more: Any
) -> HeatScene:
    """Return two bars of height 1 whose far ends are held at zero, pressed by a pressure of 5."""
    bodies = {
        "upper": ConductingBody(cells(rectangle((0.0, 1.0), (2.0, 2.0), (5, 4))), PAD),
        "lower": ConductingBody(cells(rectangle((0.0, 0.0), (2.0, 1.0), (3, 3))), DISC),
    }
    held = [HeldTemperature("upper", "y1", 0.0), HeldTemperature("lower", "y0", 0.0)]
    rubbed = ThermalContact(UPPER, LOWER, conductance, pressure=5.0, friction=friction, **more)
    return HeatScene(bodies, held, contacts=[rubbed])


def ends(heat: float, share: float, conductance: float) -> tuple[float, float]:
    """Return the temperatures of both sides of the contact of two bars of height 1 that share some heat."""
    k, m = 2.0, 50.0
    matrix = np.array([[k + conductance, -conductance], [-conductance, m + conductance]])
    upper, lower = np.linalg.solve(matrix, [share * heat, (1.0 - share) * heat])
    return float(upper), float(lower)


@pytest.mark.parametrize("share", [0.5, 1.0, 0.2])
def test_both_bodies_get_their_share_of_the_work(share: float):
    heat = 0.9 * 0.4 * 5.0 * 7.0
    state = solve_heat(brake(FrictionHeat(0.4, 7.0, part=0.9, share=share)), MPI.COMM_SELF)
    (rubbed,) = state.contacts
    upper, lower = ends(heat, share, 30.0)
    assert rubbed.slave == pytest.approx(upper, rel=1e-9)
    assert rubbed.master == pytest.approx(lower, rel=1e-9)
    assert rubbed.friction.sum() == pytest.approx(2.0 * heat, rel=1e-12)
    assert state.heat_through("upper", "y0") == pytest.approx(2.0 * 2.0 * upper, rel=1e-9)
    assert state.heat_through("lower", "y1") == pytest.approx(2.0 * 50.0 * lower, rel=1e-9)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("cells", [same, quadratic])
def test_no_heat_of_friction_is_lost_between_meshes_that_do_not_match(discretisation: str, cells: Cells):
    law = FrictionHeat(0.4, lambda x: 1.0 + x[:, 0] ** 2, share=0.3)
    state = solve_heat(brake(law, cells=cells, discretisation=discretisation), MPI.COMM_SELF)
    (rubbed,), parts = state.contacts, state.balance.by_part
    (work,) = (heat for name, heat in parts.items() if name.startswith("FrictionHeat"))
    out = sum(heat for name, heat in parts.items() if name.startswith("HeldTemperature"))
    assert work == pytest.approx(rubbed.friction.sum(), rel=1e-13)
    assert abs(work + out) < 1e-12 * work
    assert work == pytest.approx(2.0 * (2.0 + 8.0 / 3.0), rel=0.02)


def test_friction_that_falls_with_the_temperature_finds_its_balance():
    # q = μ(T) p v with μ = 0.5 − T/100, both sides at T = q / (k₁ + k₂).
    law = FrictionHeat(TemperatureTable((0.0, 40.0), (0.5, 0.1)), 20.0, share=2.0 / 52.0)
    (rubbed,) = solve_heat(brake(law), MPI.COMM_SELF).contacts
    assert rubbed.slave == pytest.approx(0.5 * 100.0 / (52.0 + 1.0), rel=1e-9)


def test_an_obstacle_keeps_its_share():
    block = ConductingBody(rectangle((0.0, 0.0), (1.0, 1.0), (2, 2)), Conductor(2.0))
    law = FrictionHeat(0.5, 4.0, share=0.25)
    floor = ThermalContact(
        Surface("block", "y0"), RigidPlane((0, 0), (0, 1)), 1e-9, temperature=0.0, pressure=3.0, friction=law
    )
    scene = HeatScene({"block": block}, [HeldTemperature("block", "y1", 0.0)], contacts=[floor])
    state = solve_heat(scene, MPI.COMM_SELF)
    assert state.contacts[0].slave == pytest.approx(0.25 * 6.0 / 2.0, rel=1e-8)
    assert state.balance.by_part["FrictionHeat block y0 - RigidPlane"] == pytest.approx(1.5)


@pytest.mark.claim
def test_large_bodies_share_by_effusivities_from_the_first_moment():
    # 2 q √(t/π) / (e₁ + e₂) on both sides (Carslaw and Jaeger, 2.9): forty steps of Euler's rule.
    share, heat, steps = effusivity_share(PAD, DISC), 0.4 * 5.0 * 7.0, 40
    assert share == pytest.approx(np.sqrt(6.0) / (np.sqrt(6.0) + np.sqrt(200.0)))
    scene = brake(FrictionHeat(0.4, 7.0, share=share), conductance=1e-6)
    graded = {
        name: replace(body, mesh=rectangle(*corners, (1, 60)))
        for (name, body), corners in zip(
            scene.bodies.items(), [((0.0, 1.0), (2.0, 2.0)), ((0.0, 0.0), (2.0, 1.0))], strict=True
        )
    }
    problem, end = HeatProblem(replace(scene, bodies=graded), MPI.COMM_SELF), 0.01
    history = problem.no_rate.history
    values = np.zeros(sum(body.mesh.n_nodes for body in graded.values()))
    for _ in range(steps):
        values = problem.solve(rate=Rate(steps / end, values, history)).values
    (rubbed,) = problem.state.contacts
    exact = 2.0 * heat * np.sqrt(end / np.pi) / (np.sqrt(6.0) + np.sqrt(200.0))
    assert rubbed.slave == pytest.approx(exact, rel=0.02)
    assert rubbed.master == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"coefficient": -0.1}, "FrictionHeat.coefficient"),
        ({"speed": -1.0}, "FrictionHeat.speed"),
        ({"share": 1.5}, "FrictionHeat.share must lie between 0 and 1, got 1.5"),
        ({"part": -0.5}, "FrictionHeat.part must lie between 0 and 1"),
    ],
)
def test_friction_that_would_cool_is_refused(given: dict, words: str):
    with pytest.raises(InvalidInputError, match=words):
        FrictionHeat(**given)


def test_shares_by_effusivities_need_capacities():
    with pytest.raises(InvalidInputError, match="need the heat capacities of both"):
        effusivity_share(Conductor(1.0), DISC)
