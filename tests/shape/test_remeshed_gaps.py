"""A new mesh in the shape of a design keeps what designs have added to the gaps that pairs give."""

from __future__ import annotations

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
)
from fenics_contact.design import Remeshed, TotalPotential
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.shapes import Plane

STEEL = PlaneStrain(100.0, 0.3)
FAR = np.array([-0.02, 0.05, -0.03, 0.01, 0.04])


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
    (value, gradient), (other, slopes) = kept(FAR), new(FAR)
    assert len(kept.remeshings) == len(new.remeshings) > 0
    assert other == pytest.approx(value, rel=1e-9)
    assert slopes == pytest.approx(gradient, rel=1e-6)
    assert kept.problems[0].value_of(FAR) == pytest.approx(value, rel=1e-2)
    assert max(abs(one.jump / one.before) for one in new.remeshings) < 1e-9


def test_new_nodes_of_a_surface_know_where_it_was() -> None:
    far = Remeshed(pressed(gap=0.006), finer, share=0.93)
    far(FAR)
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

    with pytest.raises(InvalidInputError, match=r"must have no shapes of its own, got those of"):
        Remeshed(pressed(gap=0.006), shaped, share=0.93)(FAR)
    Remeshed(pressed(), shaped, share=0.93)(FAR)
