"""Heat is neither made nor lost on any mesh, and closed forms with joints, films, tables and radiation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import RigidPlane, Surface, Tie
from fenics_contact.gallery import ball, block, cylinder, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    GapRadiation,
    HeatAtNodes,
    HeatFlux,
    HeatScene,
    HeatSource,
    HeatState,
    HeldTemperature,
    PressureConductance,
    Radiation,
    TemperatureTable,
    ThermalContact,
    solve_heat,
)
from fenics_contact.mesh import bisection_partition, quadratic, refined, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh

SIGMA = 5.670374419e-8


def graded(mesh: BodyMesh) -> BodyMesh:
    """Return a mesh with hanging nodes, also on the joint at z = 1 (in the plane y = 1)."""
    near = np.array([0.0, 0.3, 1.0])[-mesh.dim :]
    for reach in (0.6, 0.3):
        far = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - near, axis=1)
        mesh = refined(mesh, far < reach).mesh
    return mesh


KINDS: dict[str, Callable[[BodyMesh], BodyMesh]] = {
    "hanging": graded,
    "quadratic": quadratic,
    "serendipity": lambda mesh: serendipity(quadratic(mesh)),
    "simplices": quadratic,
}


def stack(dim: int, kind: str) -> dict[str, BodyMesh]:
    """Return a lower and an upper box of unit width whose meshes do not match; the upper has regions."""
    make = rectangle if dim == 2 else block
    cell = (
        {2: "quadrilateral", 3: "hexahedron"}[dim]
        if kind != "simplices"
        else {2: "triangle", 3: "tetrahedron"}[dim]
    )
    zeros, ones = (0.0,) * (dim - 1), (1.0,) * (dim - 1)
    lower = make((*zeros, 0.0), (*ones, 1.0), (4,) * dim, cell)
    upper = make((*zeros, 1.0), (*ones, 2.0), (*(3,) * (dim - 1), 2), cell)
    meshes = {"lower": KINDS[kind](lower), "upper": KINDS[kind](upper)}
    left = meshes["upper"].points[meshes["upper"].cells].mean(axis=1)[:, 0] < 0.5
    regions = {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    return {**meshes, "upper": replace(meshes["upper"], regions=regions)}


def busy(dim: int, kind: str, discretisation: str, joint: str) -> HeatScene:
    """Return two bodies with all that heats and cools, on an obstacle, joined by a film or tied."""
    meshes, up = stack(dim, kind), "yz"[dim - 2]
    thickness = 2.5 if dim == 2 else 1.0
    slave, master = Surface("upper", f"{up}0"), Surface("lower", f"{up}1")
    floor = RigidPlane((0.0,) * dim, (*(0.0,) * (dim - 1), 1.0))
    contacts = [ThermalContact(Surface("lower", f"{up}0"), floor, 3.0, temperature=5.0)]
    film = ThermalContact(
        slave, master, PressureConductance(3.0, 1.0), pressure=lambda x: 1.0 + x[:, 0],
        discretisation=discretisation,
    )  # fmt: skip
    halves = {"left": Conductor(1.0), "right": Conductor(TemperatureTable((0.0, 500.0), (1.0, 4.0)))}
    return HeatScene(
        {
            "lower": ConductingBody(meshes["lower"], Conductor(2.0), thickness=thickness),
            "upper": ConductingBody(meshes["upper"], halves, thickness=thickness),
        },
        [HeldTemperature("upper", f"{up}1", lambda x: 300.0 + 20.0 * x[:, 0])],
        [
            HeatSource("upper", lambda x: 1.0 + x[:, 0]), HeatFlux("lower", "x1", lambda x: np.sin(x[:, 1])),
            Convection("upper", "x0", 2.0, 10.0), Radiation("upper", "x1", 0.8, ambient=300.0),
            HeatFlux("lower", "x0", 7.0, total=True), HeatAtNodes("lower", "x1", 0.5),
        ],
        [*contacts, film] if joint == "film" else contacts,
        [Tie(slave, master, discretisation=discretisation)] if joint == "tie" else [],
    )  # fmt: skip


ALL = [
    (dim, kind, discretisation, joint)
    for dim in (2, 3)
    for kind in KINDS
    for discretisation in ("node", "mortar")
    for joint in ("film", "tie")
]
QUICK = [
    (2, "hanging", "mortar", "tie"),
    (2, "simplices", "mortar", "film"),
    (3, "quadratic", "mortar", "film"),
]


def check_conserved(dim: int, kind: str, discretisation: str, joint: str) -> None:
    scene = busy(dim, kind, discretisation, joint)
    cut = {name: bisection_partition(body.mesh, 3) for name, body in scene.bodies.items()}
    state = solve_heat(scene, MPI.COMM_SELF, partitions=cut)
    assert bool(scene.bodies["lower"].mesh.hanging) == (kind == "hanging")
    assert state.balance.error < 1e-12
    # Each body for itself: what passes between them leaves one and enters the other.
    given = sum(heat for place, heat in state.balance.by_part.items() if " lower " in place)
    passing = state.contacts[1].total if joint == "film" else state.ties.sum()
    assert abs(given) > 1.0
    assert passing == pytest.approx(-given, rel=1e-12)
    # And so the sides of each, with the point heat that enters through no side.
    for name in scene.bodies:
        sides = [state.heat_through(name, side) for side in scene.bodies[name].mesh.surfaces]
        inside = sum(
            heat for place, heat in state.balance.by_part.items()
            if place in (f"HeatSource {name}", f"HeatAtNodes {name} x1")
        )  # fmt: skip
        assert sum(sides) == pytest.approx(-inside, abs=1e-12 * np.abs(sides).sum())


@pytest.mark.parametrize(("dim", "kind", "discretisation", "joint"), QUICK)
def test_heat_is_conserved(dim: int, kind: str, discretisation: str, joint: str) -> None:
    check_conserved(dim, kind, discretisation, joint)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dim", "kind", "discretisation", "joint"), [case for case in ALL if case not in QUICK]
)
def test_heat_is_conserved_on_all_meshes(dim: int, kind: str, discretisation: str, joint: str) -> None:
    check_conserved(dim, kind, discretisation, joint)


@pytest.mark.parametrize(
    ("dim", "kind"), [(2, "quadratic"), (3, "simplices"), pytest.param(3, "hanging", marks=pytest.mark.slow)]
)
def test_a_tie_of_meshes_that_do_not_match_keeps_a_linear_temperature(dim: int, kind: str) -> None:
    meshes, up = stack(dim, kind), "yz"[dim - 2]

    def linear(points: np.ndarray) -> np.ndarray:
        return 3.0 + points @ np.array([2.0, -1.0, 5.0])[-dim:]

    bodies = {
        name: ConductingBody(replace(mesh, regions={}), Conductor(2.0)) for name, mesh in meshes.items()
    }
    outer = {
        "lower": [s for s in meshes["lower"].surfaces if s != f"{up}1"],
        "upper": [s for s in meshes["upper"].surfaces if s != f"{up}0"],
    }
    held = [HeldTemperature(name, side, linear) for name, sides in outer.items() for side in sides]
    tie = Tie(Surface("upper", f"{up}0"), Surface("lower", f"{up}1"), discretisation="mortar")
    state = solve_heat(HeatScene(bodies, held, ties=[tie]), MPI.COMM_SELF)
    for name, mesh in meshes.items():
        assert state.temperature[name] == pytest.approx(linear(mesh.points), abs=1e-9)


@pytest.mark.parametrize(("dim", "discretisation"), [(3, "best"), (2, "mortar")])
def test_two_bars_with_a_film_are_resistances_in_series(dim: int, discretisation: str) -> None:
    meshes, up = stack(dim, "quadratic"), "yz"[dim - 2]
    thickness = {2: 2.5, 3: 1.0}[dim]
    bodies = {
        "lower": ConductingBody(meshes["lower"], Conductor(2.0), thickness=thickness),
        "upper": ConductingBody(replace(meshes["upper"], regions={}), Conductor(5.0), thickness=thickness),
    }
    film = ThermalContact(
        Surface("upper", f"{up}0"), Surface("lower", f"{up}1"), 0.8, discretisation=discretisation
    )
    held = [HeldTemperature("lower", f"{up}0", 20.0), HeldTemperature("upper", f"{up}1", 100.0)]
    state = solve_heat(HeatScene(bodies, held, contacts=[film]), MPI.COMM_SELF)
    flux, joint = 80.0 / (1.0 / 2.0 + 1.0 / 0.8 + 1.0 / 5.0), state.contacts[0]
    assert joint.total == pytest.approx(thickness * flux, rel=1e-10)
    assert joint.slave == pytest.approx(np.full(len(joint.nodes), 100.0 - flux / 5.0), rel=1e-9)
    assert state.heat_through("upper", f"{up}1") == pytest.approx(thickness * flux, rel=1e-10)
    assert state.heat_through("lower", "x0") == pytest.approx(0.0, abs=1e-9)


def test_curvatures_on_skew_facets_are_those_of_the_cylinder() -> None:
    def twisted(mesh: BodyMesh) -> BodyMesh:
        turn, (x, y, z) = 0.6 * mesh.points[:, 2], mesh.points.T
        return mesh.moved(
            np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z])
        )

    bodies = {
        "inner": ConductingBody(twisted(cylinder(2.0, 1.0, 4, 3, hole=1.0)), Conductor(1.0)),
        "outer": ConductingBody(twisted(cylinder(4.0, 1.0, 4, 3, hole=2.5)), Conductor(1.0)),
    }
    state = nested(bodies, {"inner": ("inner", "outer"), "outer": ("inner", "outer")}, "inner", "node")
    assert state.joints.spread == pytest.approx(np.log(1.25) / 0.25, rel=6e-3)


#: Of spheres of radii 1, 2, 2.5 and 4 with conductivities 3 and 5, and 0.7 in the gap.
SPHERES = 100.0 * 4.0 * np.pi / ((1 / 1 - 1 / 2) / 3.0 + (1 / 2 - 1 / 2.5) / 0.7 + (1 / 2.5 - 1 / 4) / 5.0)


def shell(inner: float, outer: float, layers: int, n: int) -> BodyMesh:
    """Return the half section of a shell, of quadratic cells."""
    mesh = quadratic(rectangle((0.0, 0.0), (1.0, 1.0), (layers, n)))
    radius, angle = inner + (outer - inner) * mesh.points[:, 0], np.pi * (mesh.points[:, 1] - 0.5)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    points[np.abs(points) < 1e-14] = 0.0
    return mesh.moved(points)


def nested(
    bodies: dict[str, ConductingBody], sides: dict[str, tuple[str, str]], slave: str, how: str
) -> HeatState:
    names = [slave, next(name for name in bodies if name != slave)]
    faces = {"inner": sides["inner"][1], "outer": sides["outer"][0]}
    first, second = (Surface(name, faces[name]) for name in names)
    gap = ThermalContact(first, second, GapConductance(0.7), discretisation=how)
    held = [
        HeldTemperature("inner", sides["inner"][0], 100.0),
        HeldTemperature("outer", sides["outer"][1], 0.0),
    ]
    return solve_heat(HeatScene(bodies, held, contacts=[gap]), MPI.COMM_SELF)


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("slave", "how"),
    [
        ("outer", "mortar"),
        pytest.param("inner", "mortar", marks=SLOW),
        pytest.param("inner", "node", marks=SLOW),
        pytest.param("outer", "node", marks=SLOW),
    ],
)
def test_a_sphere_in_a_sphere_around_an_axis(slave: str, how: str) -> None:
    wrong = []
    for n in (16, 32):
        bodies = {
            "inner": ConductingBody(shell(1.0, 2.0, n // 8, n), Conductor(3.0), axisymmetric=True),
            "outer": ConductingBody(shell(2.5, 4.0, n // 8 + 1, n), Conductor(5.0), axisymmetric=True),
        }
        state = nested(bodies, {"inner": ("x0", "x1"), "outer": ("x0", "x1")}, slave, how)
        assert state.balance.error < 1e-12
        wrong.append(abs(abs(state.contacts[0].total) / SPHERES - 1.0))
    assert wrong[1] < 5e-5
    assert wrong[0] / wrong[1] > 2.0**3


@pytest.mark.slow
@pytest.mark.parametrize("slave", ["inner", "outer"])
def test_a_sphere_in_a_sphere_in_space(slave: str) -> None:
    # Curvatures at the nodes of cubes blown up are skew: edges there have two oblique directions alone.
    bodies = {
        "inner": ConductingBody(quadratic(ball(2.0, 2, hole=1.0)), Conductor(3.0)),
        "outer": ConductingBody(quadratic(ball(4.0, 3, hole=2.5)), Conductor(5.0)),
    }
    state = nested(bodies, {"inner": ("inner", "outer"), "outer": ("inner", "outer")}, slave, "mortar")
    assert state.joints.spread == pytest.approx(0.8 if slave == "inner" else 1.25, rel=1e-6)
    assert abs(state.contacts[0].total) == pytest.approx(SPHERES, rel=4e-4)


def slab(material: Conductor, held: list[HeldTemperature], loads: list[object], n: int = 4) -> HeatState:
    body = ConductingBody(quadratic(rectangle((0.0, 0.0), (1.0, 0.2), (n, 1))), material)
    return solve_heat(HeatScene({"slab": body}, held, loads), MPI.COMM_SELF)


def test_conductivity_by_temperature_is_kirchhoffs_transform() -> None:
    # With k = 1 + T/100 the heat is (Θ(200) − Θ(0)) 0.2 with Θ = T + T²/200, and Θ is linear in x.
    held = [HeldTemperature("slab", "x0", 0.0), HeldTemperature("slab", "x1", 200.0)]
    errors = []
    for n in (4, 8):
        state = slab(Conductor(TemperatureTable((0.0, 200.0), (1.0, 3.0))), held, [], n)
        assert state.heat_through("slab", "x1") == pytest.approx(0.2 * 400.0, rel=2e-3 / n**2)
        x = state.scene.bodies["slab"].mesh.points[:, 0]
        exact = 100.0 * (np.sqrt(1.0 + 2.0 * 400.0 * x / 100.0) - 1.0)
        errors.append(np.abs(state.temperature["slab"] - exact).max())
    assert errors[1] < 0.4
    assert errors[0] / errors[1] > 2.0**2


def test_a_slab_that_radiates_to_its_surroundings() -> None:
    k, far = 1.5, 1000.0

    def left(T: float) -> float:
        return k * (far - T) - 0.8 * SIGMA * (T**4 - 300.0**4)

    exact = brentq(left, 300.0, far, xtol=1e-12)
    loads = [Radiation("slab", "x1", 0.8, ambient=300.0)]
    state = slab(Conductor(k), [HeldTemperature("slab", "x0", far)], loads)
    hot = np.unique(state.scene.bodies["slab"].mesh.surfaces["x1"])
    assert state.temperature["slab"][hot] == pytest.approx(np.full(len(hot), exact), rel=1e-9)
    assert state.heat_through("slab", "x1") == pytest.approx(-0.2 * k * (far - exact), rel=1e-9)


def test_two_slabs_that_radiate_across_a_gap() -> None:
    factor = SIGMA / (1.0 / 0.8 + 1.0 / 0.6 - 1.0)

    def flux(hot: float) -> float:
        return 2.0 * (1200.0 - hot)

    def left(hot: float) -> float:
        cold = 300.0 + flux(hot) / 3.0
        return flux(hot) - factor * (hot**4 - cold**4)

    hot = brentq(left, 300.0, 1200.0, xtol=1e-12)
    bodies = {
        "hot": ConductingBody(rectangle((0.0, 0.0), (1.0, 0.2), (3, 2)), Conductor(2.0)),
        "cold": ConductingBody(rectangle((1.5, 0.0), (2.5, 0.2), (2, 1)), Conductor(3.0)),
    }
    gap = ThermalContact(Surface("hot", "x1"), Surface("cold", "x0"), GapRadiation(0.8, 0.6))
    held = [HeldTemperature("hot", "x0", 1200.0), HeldTemperature("cold", "x1", 300.0)]
    state = solve_heat(HeatScene(bodies, held, contacts=[gap]), MPI.COMM_SELF)
    assert state.contacts[0].slave == pytest.approx(np.full(3, hot), rel=1e-9)
    assert state.contacts[0].total == pytest.approx(0.2 * flux(hot), rel=1e-9)
