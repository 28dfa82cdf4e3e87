"""One layer of cells for plates and shells: theory, numbers of CalculiX 2.20 (S8R), contact."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ConstraintTerm,
    ContactPair,
    Coulomb,
    LinearConstraint,
    Pressure,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import Thickened, thickened
from fenics_contact.mesh.one_layer import one_wide, two_wide
from tests.fem.surfaces import edges_of, grid, node_at

STEEL = IsotropicElasticity(2e5, 0.3)


def held(thin: Thickened, body: str, nodes: np.ndarray, axis: str) -> list[LinearConstraint]:
    """Hold the mean of bottom and top and, at corners of cells, the middle, as CalculiX does."""
    bottom, middle, top = thin.nodes[nodes[thin.nodes[nodes, 0] >= 0]].T
    mean = [ConstraintTerm(body, each, axis, 0.5) for each in (bottom, top)]
    middle = middle[middle >= 0]
    return [
        LinearConstraint(mean, name=f"{body} mean {axis}"),
        LinearConstraint([ConstraintTerm(body, middle, axis)], name=f"{body} middle {axis}"),
    ]


def plate_on_its_rim(name: str, side: int, thick: float, height: float = 0.0) -> tuple[Thickened, Body, list]:
    """A square plate, 100 wide, held at the rim of its middle surface."""
    points, facets, at = grid(side, side, lambda w: np.column_stack([100 * w, np.full(len(w), height)]))
    thin = thickened(points, facets, thick)
    rim = np.unique(np.concatenate(list(edges_of(at).values())))
    first, second = node_at(at, 0, 0), node_at(at, 1, 0)
    equations = held(thin, name, rim, "z")
    for axis, nodes in (("x", [first]), ("y", [first, second])):
        term = ConstraintTerm(name, thin.nodes[nodes, 1], axis)
        equations.append(LinearConstraint([term], name=f"{name} {axis}"))
    return thin, Body(thin.mesh, STEEL, integration="reduced"), equations


@pytest.mark.parametrize(
    ("slenderness", "across", "calculix"),
    [(10, 2, 0.98759), (50, 2, 0.98481), (100, 2, 0.98335), (200, 2, 0.98268), (10, 1, 0.98782)],
)
def test_a_cantilever_bends_as_shells_of_8_nodes_do(slenderness, across, calculix) -> None:
    thick, force = 100 / slenderness, 1.0
    points, facets, at = grid(
        20, across, lambda w: np.column_stack([100 * w[:, 0], 10 * w[:, 1], 0 * w[:, 0]])
    )
    thin = thickened(points, facets, thick, edges=edges_of(at))
    how: Any = "reduced" if across > 1 else "stabilised"
    scene = Scene(
        {"strip": Body(thin.mesh, STEEL, integration=how)},
        [Support("strip", "u0")],
        [Traction("strip", "u1", (0, 0, force / (10 * thick)))],
    )
    parts = {"strip": (np.arange(thin.mesh.n_cells) // across) // 5}
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=parts, tolerance=1e-8)
    tip = thin.at(state.gather_displacement("strip"))[node_at(at, 1, 0.5)]
    bending = force * 100**3 / (3 * 2e5 * 10 * thick**3 / 12)
    theory = bending + 1.2 * force * 100 / (2e5 / 2.6 * 10 * thick)
    assert tip[2] / theory == pytest.approx(calculix, abs=2e-5)
    assert state.solution.products <= 20


@pytest.mark.parametrize(("slenderness", "calculix", "most"), [(10, 1.11349, 40), (100, 1.00818, 90)])
def test_a_plate_on_its_rim_bends_as_shells_of_8_nodes_do(slenderness, calculix, most) -> None:
    """Ratio to Navier's series of thin plates, which neither shear nor free corners are in."""
    thick = 100 / slenderness
    thin, body, equations = plate_on_its_rim("plate", 16, thick)
    pressure = -2e5 * thick**3 / 100**4
    scene = Scene({"plate": body}, [], [Pressure("plate", "bottom", pressure)], constraints=equations)
    cell = np.arange(256)
    parts = {"plate": cell // 64 * 4 + cell % 16 // 4}
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=parts, tolerance=1e-8)
    sag = thin.at(state.gather_displacement("plate"))[:, 2]
    assert np.nanmin(sag) / (-0.04436086 * 1.0) == pytest.approx(calculix, abs=2e-5)
    assert state.solution.products <= most


def roof(thin: Thickened, nodes: dict[str, np.ndarray]) -> Scene:
    """A quarter of the roof of Scordelis and Lo: held at its curved end, its own weight."""
    supports = [Support("roof", "u0", (0.0, None, None)), Support("roof", "v1", (None, 0.0, None))]
    equations = [each for axis in "xz" for each in held(thin, "roof", nodes["v0"], axis)]
    body = Body(thin.mesh, IsotropicElasticity(4.32e8, 0.0), integration="reduced")
    return Scene({"roof": body}, supports, [BodyForce("roof", (0, 0, -360.0))], constraints=equations)


@pytest.mark.parametrize(("side", "calculix"), [(8, 0.99853), (16, 0.99842)])
def test_a_curved_roof_sags_as_shells_of_8_nodes_do(side, calculix) -> None:
    top = np.radians(40)

    def place(w: np.ndarray) -> np.ndarray:
        return np.column_stack([25 * np.sin(top * w[:, 0]), 25 * w[:, 1], 25 * np.cos(top * w[:, 0])])

    points, facets, at = grid(side, side, place)
    thin = thickened(points, facets, 0.25, edges=edges_of(at))
    state = solve_scene(roof(thin, edges_of(at)), MPI.COMM_WORLD, tolerance=1e-8)
    sag = thin.at(state.gather_displacement("roof"))[node_at(at, 1, 1), 2]
    assert sag / -0.3024 == pytest.approx(calculix, abs=1e-4)
    assert state.solution.products <= 110


@pytest.mark.parametrize("corners", [3, 4])
def test_facets_without_midpoints_get_them_and_bend_right(corners) -> None:
    points, facets, at = grid(10, 2, lambda w: np.column_stack([100 * w[:, 0], 10 * w[:, 1], 0 * w[:, 0]]))
    used, linear = np.unique(facets[:, :4], return_inverse=True)
    linear = linear.reshape(-1, 4)
    if corners == 3:
        linear = np.concatenate([linear[:, :3], linear[:, [0, 2, 3]]])
    edges = {name: np.flatnonzero(np.isin(used, nodes)) for name, nodes in edges_of(at).items()}
    thin = thickened(points[used], linear, np.full(len(used), 5.0), edges=edges)
    how: Any = "reduced" if corners == 4 else "full"
    load = Traction("strip", "u1", (0, 0, 1 / 50))
    scene = Scene({"strip": Body(thin.mesh, STEEL, integration=how)}, [Support("strip", "u0")], [load])
    tip = thin.at(solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-8).gather_displacement("strip"))[-1]
    assert tip[2] / (1e6 / (3 * 2e5 * 10 * 125 / 12)) == pytest.approx(0.985, abs=0.01)


def test_thickness_offset_and_normals_place_the_faces() -> None:
    points, facets, _ = grid(2, 2, lambda w: np.column_stack([4 * w, 0 * w[:, 0]]))
    depth = 1.0 + points[:, 0]
    thin = thickened(points, facets, depth, offset=0.5)
    used = thin.nodes[:, 0] >= 0
    bottom, top = (thin.mesh.points[thin.nodes[used, k]] for k in (0, 2))
    np.testing.assert_allclose(bottom, points[used], atol=1e-14)
    np.testing.assert_allclose(top[:, 2], depth[used], atol=1e-14)
    leaning = thickened(points, facets, 1.0, normals=np.tile([1.0, 0.0, 1.0], (len(points), 1)))
    away = leaning.mesh.points[leaning.nodes[used, 2]] - points[used]
    np.testing.assert_allclose(away, np.tile([0.5, 0, 0.5], (used.sum(), 1)) / np.sqrt(2), atol=1e-14)
    middle = thin.nodes[:, 1] >= 0
    np.testing.assert_array_equal(np.isnan(thin.at(thin.mesh.points)[:, 0]), ~used)
    np.testing.assert_allclose(thin.at(thin.mesh.points)[middle, 2], (depth / 2)[middle])


def two_plates(
    side: int, thick: float, how: str = "reduced", mu: float = 0.0
) -> tuple[Scene, Thickened, float]:
    """Two plates on their rims, one on the other, the upper one pressed."""
    upper, first, above = plate_on_its_rim("up", side, thick)
    _, second, below = plate_on_its_rim("low", side, thick, -thick)
    bodies = {n: Body(b.mesh, STEEL, integration=how) for n, b in {"up": first, "low": second}.items()}  # type: ignore[arg-type]
    pressure = 2e5 * thick**3 / 100**4
    law = (Coulomb(mu),) if mu else ()
    pair = ContactPair(Surface("up", "bottom"), Surface("low", "top"), *law)
    scene = Scene(bodies, [], [Pressure("up", "top", pressure)], [pair], constraints=above + below)
    return scene, upper, pressure


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_two_plates_in_contact_share_the_load_by_one_layer_of_reduced_cells(mu) -> None:
    sag = []
    for how in ("reduced", "full"):
        scene, thin, pressure = two_plates(8, 10.0, how, mu)
        state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-7)
        sag.append(np.nanmin(thin.at(state.gather_displacement("up"))[:, 2]))
        assert np.median(state.contact.pressure) == pytest.approx(0.5 * pressure, rel=0.02)
        assert state.solution.products <= 120
    assert sag[0] == pytest.approx(sag[1], rel=0.01)


@pytest.mark.filterwarnings("ignore")
def test_statuses_that_flicker_are_settled_by_faces_solved_more_accurately() -> None:
    """At the rims of two thin plates nothing presses; by faces solved to a quarter it took 1852 products."""
    scene, _, pressure = two_plates(12, 1.0)
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-7)
    assert state.solution.products <= 1200
    assert np.median(state.contact.pressure) == pytest.approx(0.5 * pressure, rel=0.02)


def test_a_plate_on_a_ball_presses_as_theory_has_it() -> None:
    """The ball has 0.350 of the load, where the centre sags by its own load and force as much as it must."""
    _, body, equations = plate_on_its_rim("plate", 16, 1.0)
    ball = RigidSphere((50, 50, -20.5), 20)
    pressure = 2e5 / 100**4
    pair = ContactPair(Surface("plate", "bottom"), ball)
    scene = Scene({"plate": body}, [], [Pressure("plate", "top", pressure)], [pair], constraints=equations)
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-7)
    assert state.contact.normal_force.sum() / (pressure * 1e4) == pytest.approx(0.350, abs=0.004)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_contact_of_very_thin_plates_is_refused_or_right() -> None:
    scene, thin, pressure = two_plates(8, 0.1)
    try:
        state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-7)
    except ConvergenceError:
        return
    sag = np.nanmin(thin.at(state.gather_displacement("up"))[:, 2])
    assert sag / -0.0443609 == pytest.approx(0.5, abs=0.02)
    assert np.median(state.contact.pressure) == pytest.approx(0.5 * pressure, rel=0.05)


def test_subdomains_get_two_cells_wide_where_the_body_is() -> None:
    points, facets, _ = grid(8, 2, lambda w: np.column_stack([8 * w[:, 0], 2 * w[:, 1], 0 * w[:, 0]]))
    mesh = thickened(points, facets, 0.5).mesh
    rows = np.arange(mesh.n_cells) % 2
    assert not one_wide(mesh).any()
    assert two_wide(mesh, rows).max() == 0
    boxes = np.arange(mesh.n_cells) // 4
    np.testing.assert_array_equal(two_wide(mesh, boxes), boxes)
    narrow = thickened(*grid(8, 1, lambda w: np.column_stack([w, 0 * w[:, 0]]))[:2], 0.1).mesh
    assert one_wide(narrow).all()


def test_what_makes_no_layer_is_refused() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    pair = [[0, 1, 2, 3], [1, 4, 5, 2]]
    with pytest.raises(InvalidInputError, match=r"thickness must be above zero, 1 of 6 .*point 2"):
        thickened(square, pair, [1, 1, 0, 1, 1, 1])
    with pytest.raises(InvalidInputError, match=r"one for each of 6 points, got shape \(2,\)"):
        thickened(square, pair, [1, 1])
    with pytest.raises(InvalidInputError, match=r"common normal, those at .* face both ways"):
        thickened(square, [pair[0], pair[1][::-1]], 0.1)
    with pytest.raises(InvalidInputError, match="name points from 0 to 5, got 1 to 9"):
        thickened(square, [[1, 2, 3, 9]], 0.1)
    with pytest.raises(InvalidInputError, match=r"shape \(n, 8\), .* got int64 of shape \(1, 5\)"):
        thickened(square, [[0, 1, 2, 3, 4]], 0.1)
    with pytest.raises(InvalidInputError, match="points must be finite and of shape"):
        thickened(square[:, :2], pair, 0.1)
    with pytest.raises(InvalidInputError, match="normals must be a vector other than zero"):
        thickened(square, pair, 0.1, normals=np.zeros((6, 3)))
    with pytest.raises(InvalidInputError, match="edge 'left' must have all nodes of an edge on the rim"):
        thickened(square, pair, 0.1, edges={"left": [1, 2]})
    curved, facets, _ = grid(2, 2, lambda w: np.column_stack([np.sin(w[:, 0]), w[:, 1], np.cos(w[:, 0])]))
    with pytest.raises(InvalidInputError, match="positive Jacobian"):
        thickened(curved, facets, 4.0)
