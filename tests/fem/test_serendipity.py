"""Cells of 8 and 20 nodes: those of 9 and 27 whose centres follow; patch tests, CalculiX, contact, ranks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Preload,
    Scene,
    Section,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    solve_scene,
    solve_to,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition, completed, quadratic, refined, serendipity
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import sewn
from tests.fem.graded import pulled
from tests.fem.serendipity import bent, bent_bar, displacement_on
from tests.fem.several_ranks import displacement_of

#: Displacements of two nodes of `bent_bar` by CalculiX 2.20, elements C3D20 and forces at nodes.
BAR = {23: [-0.004937768, 0.005703146, 0.0231773], 35: [-0.0002680208, 0.0002864461, 0.001039807]}


def shaken(mesh: BodyMesh, size: float) -> BodyMesh:
    inside = (np.abs(mesh.points - mesh.points.mean(axis=0)) < 0.499 * np.ptp(mesh.points, axis=0)).all(
        axis=1
    )
    points = mesh.points.copy()
    points[inside] += size * np.random.default_rng(3).uniform(-1, 1, (inside.sum(), mesh.dim))
    return mesh.moved(points)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("subdomains", [1, 4])
def test_an_even_stress_is_even_in_distorted_cells(dim: int, subdomains: int) -> None:
    whole = rectangle((0, 0), (1, 1), (3, 2)) if dim == 2 else block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    mesh = shaken(serendipity(quadratic(whole)), 0.03)
    material = IsotropicElasticity(100.0, 0.3) if dim == 3 else PlaneStrain(100.0, 0.3)
    partition = {"bar": bisection_partition(mesh, subdomains)}
    state = solve_scene(pulled(mesh, material), MPI.COMM_SELF, partitions=partition, tolerance=1e-12)
    exact = mesh.points * ([0.01, -0.003, -0.003] if dim == 3 else [0.0091, -0.0039])
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-12 * np.abs(exact).max())
    stress = state.gather_nodal_stress("bar")[0]
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0], stress.shape), atol=1e-9)


def test_a_bent_bar_of_distorted_cells_moves_as_in_calculix() -> None:
    """Complete cells are softer: the test would not pass with these."""
    mesh, state = bent(3)
    assert mesh.cells_in_words == "6 serendipity hexahedra"
    moved = state.gather_displacement("bar")
    for node, by_calculix in BAR.items():
        np.testing.assert_allclose(moved[node], by_calculix, atol=1e-6 * np.abs(moved).max())
    complete = bent_bar(completed(mesh), 1)
    assert np.abs(complete.gather_displacement("bar") - moved).max() > 1e-3 * np.abs(moved).max()


@pytest.mark.parametrize("ranks", [2, 4])
def test_every_number_of_ranks_has_the_same_answer(ranks: int, mpirun: Callable[..., str]) -> None:
    alone = np.array(displacement_on(MPI.COMM_SELF))
    answer = displacement_of("tests.fem.serendipity", ranks, mpirun)
    np.testing.assert_allclose(answer, alone, atol=1e-9 * np.abs(alone).max())


@pytest.mark.parametrize("pair", [ContactPair, Tie])
def test_an_even_pressure_passes_between_surfaces_whose_centres_are_unknowns(pair: type) -> None:
    lower = serendipity(quadratic(block((0, 0, 0), (1, 1, 1), (2, 2, 1))))
    upper = serendipity(quadratic(block((0, 0, 1), (1, 1, 2), (2, 2, 1))))
    steel = IsotropicElasticity(100.0, 0.0)
    scene = Scene(
        {"lower": Body(lower, steel), "upper": Body(upper, steel)},
        [
            Support("lower", "z0"),
            Support("upper", "x0", (0.0, None, None)),
            Support("upper", "y0", (None, 0.0, None)),
        ],
        [Traction("upper", "z1", (0.0, 0.0, -1.0))],
        **{
            "contacts" if pair is ContactPair else "ties": [
                pair(Surface("upper", "z0"), Surface("lower", "z1"))
            ]
        },
    )
    for name, surface in (("lower", "z1"), ("upper", "z0")):
        mesh = scene.bodies[name].mesh
        assert mesh.centres
        assert not np.isin(mesh.centres.nodes, mesh.surfaces[surface]).any()
        assert np.isin(mesh.centres.nodes, mesh.surfaces["x0"]).any()
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    exact = upper.points * [0.0, 0.0, -0.01]
    np.testing.assert_allclose(state.gather_displacement("upper"), exact, atol=1e-11)
    if pair is ContactPair:
        np.testing.assert_allclose(state.contact.pressure, 1.0, rtol=1e-8)
    # The scene of a scene has the same meshes.
    again = Scene(scene.bodies, scene.supports, scene.loads, scene.contacts, scene.ties)
    assert again.bodies["lower"].mesh is scene.bodies["lower"].mesh


def test_large_strains_are_even_as_well() -> None:
    mesh = serendipity(quadratic(block((0, 0, 0), (1, 1, 1), (2, 1, 1))))
    state = solve_scene(pulled(mesh, NeoHooke(100.0, 0.3), 30.0), MPI.COMM_SELF, tolerance=1e-9)
    moved = state.gather_displacement("bar")
    rate = moved[np.argmax(mesh.points.sum(axis=1))]
    np.testing.assert_allclose(moved, mesh.points * rate, atol=1e-7)


def test_cells_without_centres_are_refused_and_complete_ones_stay() -> None:
    ten = quadratic(block((0, 0, 0), (1, 1, 1), (1, 1, 1), "tetrahedron"))
    with pytest.raises(InvalidInputError, match=r"needs quadratic quadrilaterals or hexahedra, got quad"):
        serendipity(ten)
    assert completed(ten) is ten
    box = serendipity(quadratic(block((0, 0, 0), (1, 1, 1), (1, 1, 1))))
    assert not completed(box).centres
    with pytest.raises(InvalidInputError, match=r"centre node \d+ is 0\.1 away"):
        BodyMesh(box.points + 0.1 * np.eye(27)[26][:, None], box.cells, centres=box.centres)


@pytest.mark.parametrize("integration", ["full", "reduced"])
@pytest.mark.parametrize("subdomains", [1, 4])
def test_a_cut_bolt_keeps_its_cells(integration: str, subdomains: int) -> None:
    """Centres follow on both sides of the section; drawn by a force it is a bar under tension."""
    mesh = shaken(serendipity(quadratic(block((0, 0, 0), (4, 1, 1), (4, 1, 1)))), 0.03)
    steel = IsotropicElasticity(100.0, 0.3)
    sides = {
        "x0": (0.0, None, None),
        "x1": (0.0, None, None),
        "y0": (None, 0.0, None),
        "z0": (None, None, 0.0),
    }
    scene = Scene(
        {"bar": Body(mesh, steel, integration=integration)},
        [Support("bar", side, value) for side, value in sides.items()],
        preloads=[Preload("bar", Section((2.0, 0.5, 0.5), (1.0, 0.0, 0.0)), force=0.5)],
    )
    cut = scene.bodies["bar"].mesh
    assert len(cut.centres.nodes) == len(mesh.centres.nodes) + 1
    assert cut.n_nodes == mesh.n_nodes + 9
    partition = {"bar": bisection_partition(cut, subdomains)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partition, tolerance=1e-8)
    np.testing.assert_allclose(state.gather_stress("bar")[:, 0, 0], 0.5, rtol=1e-6)
    assert next(iter(state.preloads().values())).shortening == pytest.approx(4 * 0.005, rel=1e-6)
    whole = sewn(cut)
    assert whole.cells_in_words == "4 serendipity hexahedra"
    np.testing.assert_array_equal(whole.centres.nodes, mesh.centres.nodes)


def test_subdomains_alike_share_a_matrix_where_the_same_centres_follow() -> None:
    whole = serendipity(quadratic(block((0, 0, 0), (2, 1, 1), (4, 1, 1))))
    halves = (whole.points[whole.cells].mean(axis=1)[:, 0] > 1.0).astype(int)
    for mesh, shared in ((whole, True), (completed(whole, "x0"), False)):
        state = solve_scene(
            pulled(mesh, IsotropicElasticity(100.0, 0.3)),
            MPI.COMM_SELF,
            partitions={"bar": halves},
            tolerance=1e-12,
        )
        one, other = state.torn.subdomains
        assert (one.matrix is other.matrix) == shared
        exact = mesh.points * [0.01, -0.003, -0.003]
        np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("lean", [False, True])
def test_quadratic_cells_are_halved_all_together(dim: int, lean: bool) -> None:
    """Distorted ones: their maps are those of the coarse cells, and the finer bar is softer."""
    whole = rectangle((0, 0), (3, 1), (3, 1)) if dim == 2 else block((0, 0, 0), (3, 1, 1), (3, 1, 1))
    coarse = shaken(quadratic(whole), 0.03)
    coarse = serendipity(coarse) if lean else coarse
    fine = refined(coarse, np.arange(coarse.n_cells))
    mesh = fine.mesh
    assert mesh.n_cells == 2**dim * coarse.n_cells
    assert bool(mesh.centres) == lean
    np.testing.assert_array_equal(fine.parents, np.repeat(np.arange(coarse.n_cells), 2**dim))
    np.testing.assert_array_equal(mesh.points[: coarse.n_nodes], coarse.points)
    assert mesh.volume == pytest.approx(coarse.volume, rel=1e-3 if lean else 1e-12)
    assert {name: len(facets) for name, facets in mesh.surfaces.items()} == {
        name: 2 ** (dim - 1) * len(facets) for name, facets in coarse.surfaces.items()
    }
    works = []
    for each in (coarse, mesh):
        material = IsotropicElasticity(100.0, 0.3) if dim == 3 else PlaneStrain(100.0, 0.3)
        force = TotalForce("bar", "x1", (0.0, 0.1, 0.0)[:dim])
        scene = Scene({"bar": Body(each, material)}, [Support("bar", "x0")], [force])
        state = solve_scene(scene, MPI.COMM_SELF)
        works.append(state.torn.load @ state.torn_displacement)
    assert 1.0 < works[1] / works[0] < 1.06
    with pytest.raises(InvalidInputError, match=r"are refined all together, got 1 of 3 cells: mark all"):
        refined(coarse, [1])


def test_a_quantity_of_serendipity_cells_gets_its_accuracy() -> None:
    mesh = serendipity(quadratic(rectangle((0, 0), (3, 1), (3, 1))))
    body = Body(mesh, PlaneStrain(100.0, 0.3))
    scene = Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.0, 0.1))])
    result = solve_to(scene, "strain_energy", 0.005, MPI.COMM_SELF)
    assert result.state.scene.bodies["bar"].mesh.cells_in_words == "192 serendipity quadrilaterals"
    finer = refined(result.state.scene.bodies["bar"].mesh, np.arange(192)).mesh
    finer = Body(refined(finer, np.arange(768)).mesh, PlaneStrain(100.0, 0.3))
    state = solve_scene(Scene({"bar": finer}, scene.supports, scene.loads), MPI.COMM_SELF)
    exact = float(state.torn.load @ state.torn_displacement) / 2.0
    assert result.value == pytest.approx(exact, rel=0.005)
