"""From one refined mesh to another of the same family: where points lie, and values at Gauss points."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fenics_contact import BodyMesh, gallery
from fenics_contact.gallery.blocks import split_quadrilaterals
from fenics_contact.mesh import MeshTransfer, Refinement, refined
from fenics_contact.mesh.cell_types import CELL_TYPES, quadrature, shape_values
from fenics_contact.mesh.quality import jacobians

CELLS = ("triangle", "quadrilateral", "tetrahedron", "hexahedron")


@cache
def family(cell: str) -> tuple[list[Refinement], list[Refinement]]:
    """Two meshes that were refined thrice and twice from the same one, at different places."""
    if cell in ("triangle", "quadrilateral"):
        first = gallery.rectangle((0, 0), (2, 1), (3, 2), cell=cell)
    else:
        first = gallery.block((0, 0, 0), (2, 1, 1), (2, 1, 1), cell=cell)
    return refined_around(first, (0.3,) * first.dim, 3), refined_around(first, (0.9,) * first.dim, 2)


def refined_around(mesh: BodyMesh, place: tuple[float, ...], times: int) -> list[Refinement]:
    chain: list[Refinement] = []
    for _ in range(times):
        centres = mesh.points[mesh.cells].mean(axis=1)
        chain.append(refined(mesh, [np.linalg.norm(centres - place, axis=1).argmin()]))
        mesh = chain[-1].mesh
    return chain


def places(mesh: BodyMesh, cells: np.ndarray, positions: np.ndarray) -> np.ndarray:
    values = shape_values(CELL_TYPES[mesh.cell_type], positions)
    return np.asarray(np.einsum("nk,nki->ni", values, mesh.points[mesh.cells[cells]]))


def everywhere(mesh: BodyMesh, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.repeat(np.arange(mesh.n_cells), len(positions)), np.tile(positions, (mesh.n_cells, 1))


@pytest.mark.parametrize("cell", CELLS)
def test_points_are_found_where_they_lie(cell: str) -> None:
    old, new = family(cell)
    kind = CELL_TYPES[cell]
    for positions in (kind.nodes, quadrature(kind)[0]):
        given = everywhere(new[-1].mesh, positions)
        cells, found = MeshTransfer(old, new).located(*given)
        np.testing.assert_allclose(
            places(old[-1].mesh, cells, found), places(new[-1].mesh, *given), rtol=0, atol=1e-12
        )
        assert found.min() > -1e-12
        assert found.max() < 1.0 + 1e-12
    assert len(set(cells)) > 0.5 * min(old[-1].mesh.n_cells, new[-1].mesh.n_cells)


def test_nodes_on_a_curved_surface_stay_in_their_cells() -> None:
    first = split_quadrilaterals(gallery.half_disc(10.0, 3, grading=1.0))
    chain = refined_around(first, (0.0, 0.0), 3)
    again = [Refinement(each.mesh, each.parents, each.positions) for each in chain]
    kind = CELL_TYPES["triangle"]
    given = everywhere(chain[-1].mesh, kind.nodes)
    cells, positions = MeshTransfer(chain, again).located(*given)
    np.testing.assert_array_equal(cells, given[0])
    np.testing.assert_allclose(positions, given[1], rtol=0, atol=1e-10)
    assert abs(chain[-1].mesh.volume - first.volume) > 1e-6, "refined nodes lie on the circle"


def test_refinements_that_were_put_together_lead_to_the_same_places() -> None:
    old, new = family("triangle")
    together = MeshTransfer([old[2].after(old[1].after(old[0]))], [new[1].after(new[0])])
    given = everywhere(new[-1].mesh, quadrature(CELL_TYPES["triangle"])[0])
    for one, other in zip(MeshTransfer(old, new).located(*given), together.located(*given), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("cell", CELLS)
def test_values_are_means_of_old_ones_nearby(cell: str) -> None:
    old, new = family(cell)
    ends = old[-1].mesh, new[-1].mesh
    points, _ = quadrature(CELL_TYPES[cell], 2)
    at = places(ends[0], *everywhere(ends[0], points)).reshape(ends[0].n_cells, len(points), -1)
    values = np.concatenate([np.full_like(at[..., :1], 3.25), at], axis=-1)
    found = MeshTransfer(old, new).at_gauss_points(*ends, 2, values)
    np.testing.assert_allclose(found[..., 0], 3.25, rtol=1e-14)
    assert (found.min(axis=(0, 1)) >= values.min(axis=(0, 1)) - 1e-14).all()
    assert (found.max(axis=(0, 1)) <= values.max(axis=(0, 1)) + 1e-14).all()
    here = places(ends[1], *everywhere(ends[1], points)).reshape(found[..., 1:].shape)
    away = np.linalg.norm(found[..., 1:] - here, axis=-1)
    assert 0.02 < away.max() < 0.8, "of the size of cells: neither exact nor from elsewhere"


@pytest.mark.parametrize("cell", CELLS)
def test_integrals_are_kept_where_cells_become_larger(cell: str) -> None:
    old, _ = family(cell)
    fine, coarse = old[-1].mesh, old[0].mesh
    points, weights = quadrature(CELL_TYPES[cell], 2)
    values = np.random.default_rng(3).random((fine.n_cells, len(points), 2))
    found = MeshTransfer(old, old[:1]).at_gauss_points(fine, coarse, 2, values)
    sizes = [weights * jacobians(each.points, each.cells, points) for each in (fine, coarse)]
    before, after = (np.einsum("cq,cqk->k", *pair) for pair in zip(sizes, (values, found), strict=True))
    # In squares and cubes as many points are gathered by each as its weight asks for, in simplices nearly.
    np.testing.assert_allclose(after, before, rtol=0.05 if CELL_TYPES[cell].is_simplex else 1e-12)


def test_halved_cells_have_the_values_of_the_nearest_points() -> None:
    mesh = gallery.rectangle((0, 0), (2, 1), (2, 1))
    finer = refined(mesh, [0, 1])
    points, _ = quadrature(CELL_TYPES["quadrilateral"], 2)
    values = np.arange(8.0).reshape(2, 4, 1)
    found = MeshTransfer(new=[finer]).at_gauss_points(mesh, finer.mesh, 2, values)[..., 0]
    np.testing.assert_allclose(found, np.broadcast_to(found[:, :1].round(), found.shape), atol=1e-12)
    centres = finer.mesh.points[finer.mesh.cells].mean(axis=1)
    at = places(mesh, *everywhere(mesh, points))
    np.testing.assert_array_equal(
        found[:, 0].round(), np.linalg.norm(at[None] - centres[:, None], axis=2).argmin(axis=1)
    )


def test_a_transfer_fits_its_meshes_alone() -> None:
    old, new = family("triangle")
    transfer = MeshTransfer(old, new)
    assert transfer.fits(old[-1].mesh, new[-1].mesh)
    assert not transfer.fits(new[-1].mesh, old[-1].mesh)
    assert not MeshTransfer(old, family("quadrilateral")[1]).fits(old[-1].mesh, new[-1].mesh)
    assert MeshTransfer().fits(old[-1].mesh, old[-1].mesh)
    assert not MeshTransfer().fits(old[-1].mesh, new[-1].mesh)
