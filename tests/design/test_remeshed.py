"""Designs whose bodies are meshed anew, with gaps kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    minimize,
)
from fenics_contact.design import BundleTrust, NonlinearConstraint, Remeshed, TotalPotential
from fenics_contact.design.motion import MeshMotion
from fenics_contact.errors import FenicsContactError, InvalidDesignError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.mesh import boundary_faces
from fenics_contact.readers import refilled
from fenics_contact.shapes import Plane
from tests.design.bridges import COUNTS, FAR, bridge, bridge_problem, farthest

#: Linear tetrahedra are stiff, and what refills a body depends on the version of gmsh: theirs are finer.
NUMBERS = {"hexahedron": COUNTS, "tetrahedron": (16, 4, 12)}


@cache
def far(cell: str) -> Remeshed:
    """A problem that has evaluated the design `FAR`."""
    mesher = refilled if cell == "tetrahedron" else None
    remeshed = Remeshed(bridge_problem(bridge(cell, NUMBERS[cell])), mesher)
    remeshed(np.zeros(4))
    remeshed(FAR)
    return remeshed


def meshed_for(alpha: np.ndarray, cell: str) -> Scene:
    """The bridge with a mesh of blocks that are lowered evenly to the upper side of a design."""
    scene = bridge(cell, NUMBERS[cell])
    mesh = scene.bodies["beam"].mesh
    (design,) = bridge_problem(scene).designs
    top = mesh.points[design.lattice.nodes]
    drop = dict(zip(map(tuple, top[:, :2]), design.basis @ alpha, strict=True))
    lowered = mesh.points.copy()
    lowered[:, 2] *= 1.0 + np.array([drop[x, y] for x, y in mesh.points[:, :2]])
    return scene.moved({"beam": lowered})


@pytest.mark.parametrize(("cell", "near"), [("hexahedron", 0.01), ("tetrahedron", 0.2)])
def test_a_far_design_has_the_value_of_a_mesh_made_for_it(cell: str, near: float) -> None:
    remeshed = far(cell)
    with pytest.raises(InvalidDesignError):
        remeshed.problems[0](FAR)
    assert len(remeshed.remeshings) >= 2
    point, volume = remeshed.last, remeshed.volume(FAR)[0]
    assert point is not None
    own = bridge_problem(meshed_for(FAR, cell))
    error = point.state.estimate_errors().discretisation ** 2
    assert point.value == pytest.approx(own(np.zeros(4))[0], rel=near)
    assert volume == pytest.approx(own.volume(np.zeros(4))[0], rel=1e-10)
    assert max(abs(one.jump / one.before) for one in remeshed.remeshings) < error < 0.6


def test_cells_that_are_kept_make_no_jump() -> None:
    assert max(abs(one.jump / one.before) for one in far("hexahedron").remeshings) < 1e-7


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_the_gradient_far_out_is_that_of_the_values(cell: str) -> None:
    remeshed, way, step = far(cell), np.array([0.3, -0.5, 1.0, 0.4]), 1e-4
    near = FAR + 1e-3
    _, gradient = remeshed(near)
    ahead, behind = (remeshed(near + sign * step * way)[0] for sign in (1.0, -1.0))
    assert abs(gradient @ way) > 1e-2
    assert gradient @ way == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-4)


def test_other_functions_of_a_far_design_are_those_of_its_mesh() -> None:
    remeshed = far("hexahedron")
    potential, state, before = remeshed.function(TotalPotential()), remeshed.at(FAR).state, remeshed.products
    value, gradient = potential(FAR)
    assert 0 < remeshed.products - before < state.dual.products, "the adjoint alone, counted once"
    assert value == pytest.approx(state.energies.total_potential, rel=1e-9)
    ahead = remeshed.state_of(FAR + np.array([0.0, 0.0, 1e-4, 0.0])).energies.total_potential
    assert gradient[2] == pytest.approx((ahead - value) / 1e-4, rel=1e-2)
    assert remeshed.best is not None
    assert remeshed.best.value <= remeshed.at(FAR).value
    assert remeshed.first is not None
    assert np.all(remeshed.first.alpha == 0.0)


def test_a_run_that_goes_on_makes_the_same_meshes() -> None:
    remeshed = far("hexahedron")
    remeshed(FAR)
    again = Remeshed(bridge_problem(bridge("hexahedron", COUNTS)))
    assert again.fingerprint() == remeshed.fingerprint()
    again.recall(remeshed.memory())
    assert [one.jump for one in again.remeshings] == [one.jump for one in remeshed.remeshings]
    near = FAR - 1e-3
    assert again(near)[0] == pytest.approx(remeshed(near)[0], rel=1e-9)
    assert len(again.problems) == len(remeshed.problems)


def test_the_mesh_motion_of_a_design_is_computed_once_for_each_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    remeshed = far("hexahedron")
    asked: list[int] = []
    extend = MeshMotion.extend

    def counted(motion: MeshMotion, displacement: np.ndarray) -> np.ndarray:
        asked.append(id(motion))
        return extend(motion, displacement)

    monkeypatch.setattr(MeshMotion, "extend", counted)
    near = FAR - 2e-3
    remeshed(near)
    remeshed.volume(near)
    remeshed(near)
    assert 0 < len(asked) == len(set(asked)) <= len(remeshed.problems)


def test_a_design_out_of_reach_is_refused_in_words() -> None:
    few = Remeshed(bridge_problem(bridge("hexahedron", COUNTS)), most=1)
    with pytest.raises(InvalidDesignError, match=r"out of reach of 2 meshes, .* \(at most 1 are made\)"):
        few(FAR)


def test_bad_input_is_refused_in_words() -> None:
    problem = bridge_problem(bridge("hexahedron", COUNTS))
    with pytest.raises(InvalidInputError, match=r"share must lie between 0 and 1, got 1.5"):
        Remeshed(problem, share=1.5)

    def coarser(mesh: BodyMesh) -> BodyMesh:
        return block((0, 0, 0), (4, 0.6, 1.0), (7, 2, 4))

    with pytest.raises(InvalidInputError, match=r"must keep the nodes of its design surface, 27 of 27"):
        Remeshed(problem, coarser)(FAR)
    with pytest.raises(InvalidInputError, match=r"refilled with linear tetrahedra .* got 96 hexahedra"):
        refilled(problem.scene.bodies["beam"].mesh)


def test_a_refilled_body_keeps_its_boundary() -> None:
    mesh = bridge("tetrahedron", COUNTS).bodies["beam"].mesh
    new = refilled(mesh)
    assert new.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert new.n_nodes != mesh.n_nodes
    assert _corners(new, boundary_faces(new.cells)[0]) == _corners(mesh, boundary_faces(mesh.cells)[0])
    for name, facets in mesh.surfaces.items():
        assert _corners(new, new.surfaces[name]) == _corners(mesh, facets)


def _corners(mesh: BodyMesh, facets: np.ndarray) -> set[frozenset[tuple[float, ...]]]:
    return {frozenset(map(tuple, mesh.points[facet])) for facet in facets}


def test_a_boundary_that_gmsh_cannot_fill_is_refused_in_words() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2), "tetrahedron")
    broken = mesh.moved(mesh.points)
    points = mesh.points.copy()
    top = mesh.points[:, 2] == 1.0
    points[top, 2] = -0.5
    object.__setattr__(broken, "points", points)
    with pytest.raises(FenicsContactError, match=r"gmsh must fill the boundary of 48 tetrahedra"):
        refilled(broken)


@pytest.mark.slow
@pytest.mark.claim
def test_two_ranks_make_the_same_meshes(mpirun: Callable[..., str]) -> None:
    script = Path(__file__).with_name("bridges.py")
    alike, meshes, value, *gradient = (float(word) for word in mpirun(script, 2).split())
    remeshed = Remeshed(bridge_problem(bridge("tetrahedron", COUNTS)), refilled)
    wanted = remeshed(FAR)
    assert (alike, meshes) == (1, len(remeshed.problems))
    assert meshes >= 3
    assert value == pytest.approx(wanted[0], rel=1e-6)
    assert gradient == pytest.approx(wanted[1].tolist(), rel=1e-4)


@pytest.mark.slow
@pytest.mark.claim
def test_an_optimum_three_times_as_far_as_one_mesh_allows() -> None:
    problem = bridge_problem(bridge("hexahedron", (16, 3, 8)))
    remeshed = Remeshed(problem)
    whole = remeshed.volume(np.zeros(4))[0]
    half = NonlinearConstraint(remeshed.volume, upper=0.5 * whole, name="volume")
    method = BundleTrust(tolerance=1e-3)
    result = minimize(remeshed, np.zeros(4), method, bounds=(-0.8, 0.2), constraints=half, restore=True)
    assert result.reason.success
    assert 3.0 * farthest(problem, result.x) < 1.0
    assert len(remeshed.remeshings) >= 2
    state = remeshed.at(result.x).state
    error = state.estimate_errors().discretisation ** 2
    assert max(abs(one.jump / one.before) for one in remeshed.remeshings) < 1e-6 < error < 0.1
    found = np.array([-0.368, -0.230, -0.8, -0.602])
    assert result.x == pytest.approx(found, abs=0.02)


# A new mesh in the shape of a design keeps what designs have added to the gaps that pairs give.
STEEL = PlaneStrain(100.0, 0.3)
REMESHED_GAPS_FAR = np.array([-0.02, 0.05, -0.03, 0.01, 0.04])


def again(mesh: BodyMesh) -> BodyMesh:
    """The same cells in another order, as a mesh of its own."""
    order = np.random.default_rng(1).permutation(mesh.n_nodes)
    number = np.argsort(order)
    surfaces = {name: number[facets] for name, facets in mesh.surfaces.items()}
    return BodyMesh(mesh.points[order], number[mesh.cells], surfaces)


def finer(mesh: BodyMesh) -> BodyMesh:
    """Every triangle is cut into four."""
    corners = mesh.cells
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    ends, middle = np.unique(edges, axis=0, return_inverse=True)
    middle = mesh.n_nodes + middle.reshape(-1, 3)
    points = np.vstack([mesh.points, mesh.points[ends].mean(axis=1)])
    (a, b, c), (ab, bc, ca) = corners.T, middle.T
    cells = np.vstack(list(map(np.column_stack, ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)))))

    def halved(facets: np.ndarray) -> np.ndarray:
        rows = [int(np.flatnonzero((ends == edge).all(axis=1))[0]) for edge in np.sort(facets, axis=1)]
        between = mesh.n_nodes + np.array(rows)
        return np.vstack([np.column_stack([facets[:, 0], between]), np.column_stack([between, facets[:, 1]])])

    return BodyMesh(points, cells, {name: halved(facets) for name, facets in mesh.surfaces.items()})


def pressed(**pair: Any) -> ShapeProblem:
    """A block on a wider one, both of whose surfaces are designs."""
    upper = rectangle((0.2, 0.0), (1.8, 0.8), (7, 3), "triangle")
    lower = rectangle((0.0, -1.0), (2.0, 0.0), (9, 4), "triangle")
    supports = [Support("lower", "y0"), Support("upper", "y1", (0.0, -0.05))]
    contact = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), discretisation="node", **pair)
    bodies = {"upper": Body(upper, STEEL), "lower": Body(lower, STEEL)}
    scene = Scene(bodies, supports, contacts=[contact])
    designs = SurfaceDesign("upper", "y0", net=2), SurfaceDesign("lower", "y1", net=3)
    return ShapeProblem(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), designs, TotalPotential())


GIVEN: dict[str, dict[str, Any]] = {
    "gap": {"gap": 0.006},
    "of position": {"gap": lambda x: 0.02 * x[:, 0] ** 2},
    "interference": {"interference": 0.01},
    "adjust": {"adjust": 0.02},
}


@pytest.mark.parametrize("given", GIVEN)
def test_new_meshes_of_the_same_cells_have_the_same_objective(given: str) -> None:
    kept, new = (Remeshed(pressed(**GIVEN[given]), mesher, share=0.93) for mesher in (None, again))
    (value, gradient), (other, slopes) = kept(REMESHED_GAPS_FAR), new(REMESHED_GAPS_FAR)
    assert len(kept.remeshings) == len(new.remeshings) > 0
    assert other == pytest.approx(value, rel=1e-9)
    assert slopes == pytest.approx(gradient, rel=1e-6)
    assert kept.problems[0].value_of(REMESHED_GAPS_FAR) == pytest.approx(value, rel=1e-2)
    assert max(abs(one.jump / one.before) for one in new.remeshings) < 1e-9


def test_new_nodes_of_a_surface_know_where_it_was() -> None:
    far = Remeshed(pressed(gap=0.006), finer, share=0.93)
    far(REMESHED_GAPS_FAR)
    scene = far.problems[-1].scene
    assert len(far.remeshings) > 0
    for name, surface in (("upper", "y0"), ("lower", "y1")):
        mesh, nodes = scene.bodies[name].mesh, np.unique(scene.bodies[name].mesh.surfaces[surface])
        assert np.ptp(mesh.points[nodes, 1]) > 0.01
        assert np.abs(mesh.origin.points[nodes, 1]).max() < 1e-12
    assert max(abs(one.jump / one.before) for one in far.remeshings) < 0.02


def test_a_new_mesh_that_hides_where_its_surfaces_were_is_refused_in_words() -> None:
    def shaped(mesh: BodyMesh) -> BodyMesh:
        side = float(mesh.points[mesh.surfaces["x0"], 0].min())
        return again(mesh).with_shapes({"x0": Plane((side, 0.0), (-1.0, 0.0))})

    with pytest.raises(InvalidInputError, match=r"must have no shapes of its own, got"):
        Remeshed(pressed(gap=0.006), shaped, share=0.93)(REMESHED_GAPS_FAR)
    Remeshed(pressed(), shaped, share=0.93)(REMESHED_GAPS_FAR)
