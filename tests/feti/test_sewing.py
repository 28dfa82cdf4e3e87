"""Copies of nodes follow jumps together with their neighbours: flat cells cost no products."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.feti.sewing import NOT_SEWN, Sewing
from fenics_contact.gallery import block, box_lattice, hemisphere
from fenics_contact.mesh import bisection_partition
from tests.feti.scenes import CELLS, STEEL, Cut, clamped_block, ragged_block, touching_blocks

WORTH_IT = Sewing.coupled
SYMMETRIC = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}


@pytest.fixture(scope="module", autouse=True)
def sewn_always() -> Iterator[None]:
    """Whatever the cells are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sewing, "coupled", 0.0)
        yield


def ball(n: int = 6, parts: int = 6) -> Cut:
    """A quarter of half a ball whose cells become up to twenty times flatter than they are wide."""
    mesh = hemisphere(10.0, n)
    held = [Support("ball", side, value) for side, value in SYMMETRIC.items()]
    held.append(Support("ball", "contact", (None, None, 0.0)))
    scene = Scene({"ball": Body(mesh, STEEL)}, held, [TotalForce("ball", "top", (1.0, 0.0, -10.0))])
    return scene, {"ball": bisection_partition(mesh, parts)}


SCENES = {
    **{cell: lambda cell=cell: clamped_block(cell) for cell in CELLS},
    "ragged": lambda: ragged_block("tetrahedron"),
    "contact": touching_blocks,
    "ball": ball,
}


def dual(cut: Cut, kind: LocalKind = LocalKind.IMPLICIT) -> DualSystem:
    scene, partitions = cut
    return DualSystem(build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)), kind=kind)


@pytest.fixture(scope="module", params=list(SCENES))
def system(request: pytest.FixtureRequest) -> DualSystem:
    return dual(SCENES[request.param]())


def sewing_of(system: DualSystem) -> Sewing:
    sewing = system.preconditioner._sewing
    assert isinstance(sewing, Sewing)
    return sewing


def test_sewing_changes_no_jump(system: DualSystem) -> None:
    B, sewing = system._B_interface, sewing_of(system)
    displacement = np.sin(1.0 + np.arange(B.shape[1]))
    moved = sewing.eased(displacement) - displacement
    assert np.abs(moved).max() > 0.1
    assert np.abs(B @ moved).max() < 1e-13


def test_both_directions_are_each_others_transpose(system: DualSystem) -> None:
    sewing, count = sewing_of(system), system._B_interface.shape[1]
    displacement, force = np.sin(1.0 + np.arange(count)), np.cos(3.0 * np.arange(count))
    work = force @ sewing.eased(displacement)
    assert work == pytest.approx(displacement @ sewing.eased_transposed(force), rel=1e-11)
    assert abs(work - force @ displacement) > 1e-3 * abs(work)


def test_sweeps_are_damped_ones_with_blocks_of_faces_edges_and_vertices(system: DualSystem) -> None:
    sewing, torn = sewing_of(system), system.torn
    K = system.inverse.interface_stiffness().toarray()
    N = sewing.moved.toarray()[:, sewing.sewn]
    A = N.T @ K @ N
    tearing, rows = torn.decomposition.tearing, torn.numbering.owned[sewing.sewn]
    nodes = torn.decomposition.gluing.dof[rows] // torn.components
    first = tearing.first_copy
    sets = [tuple(tearing.copy_subdomain[first[node] : first[node + 1]]) for node in nodes]
    assert len(set(sets)) > 1
    same = np.array([[one == other for other in sets] for one in sets])
    jacobi = sewing.damping * np.linalg.inv(np.where(same, A, 0.0))
    left = np.eye(len(A)) - jacobi @ A
    Q = sum(np.linalg.matrix_power(left, k) for k in range(sewing.sweeps)) @ jacobi
    expected = np.eye(len(K)) - N @ Q @ N.T @ K
    found = np.column_stack([sewing.eased(column) for column in np.eye(len(K))])
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()


def test_jumps_strain_bodies_less(system: DualSystem) -> None:
    preconditioner, sewing, inverse = system.preconditioner, sewing_of(system), system.inverse
    apart = np.concatenate([np.full(len(local), np.sin(1.0 + k)) for k, local in enumerate(inverse._local)])
    jump = system._B_interface @ apart
    jump[system.torn.n_gluing :] = 0.0
    closed = preconditioner._jump(jump, preconditioner._contact)
    energies = [each @ inverse.apply_stiffness(each) for each in (closed, sewing.eased(closed))]
    assert 0.0 < energies[1] < 0.9 * energies[0]


def test_nodes_of_contacts_stay_where_these_are_closed() -> None:
    system = dual(touching_blocks())
    contact = np.unique(system._B_interface[system.torn.n_gluing :].indices)
    sewing = sewing_of(system)
    assert len(contact)
    assert np.diff(sewing.moved.tocsr().indptr)[contact].max() == 0
    assert np.diff(sewing.moved.tocsr().indptr).max() == 1


def condition(system: DualSystem, sewn: bool) -> float:
    """Return the largest over the least eigenvalue of P M P F on multipliers in equilibrium."""
    preconditioner, coarse = system.preconditioner, system.problem.coarse
    sewing = preconditioner._sewing
    preconditioner._sewing = sewing if sewn else NOT_SEWN
    identity = np.eye(system.torn.numbering.total)
    basis = scipy.linalg.null_space(coarse.matrix.toarray())
    F = basis.T @ np.column_stack([system.apply(column) for column in identity]) @ basis
    M = basis.T @ np.column_stack([preconditioner(column) for column in identity]) @ basis
    preconditioner._sewing = sewing
    values = scipy.linalg.eigvals(M @ F).real
    return float(values.max() / values.min())


def test_flat_cells_leave_the_operator_well_conditioned() -> None:
    system = dual(ball(4, 4))
    apart, sewn = condition(system, sewn=False), condition(system, sewn=True)
    print(f"\ncondition of a graded ball: {apart:.1f} without sewing, {sewn:.1f} with it")
    assert sewn < 0.3 * apart
    assert apart > 50.0


def test_sewn_is_what_flat_cells_couple(monkeypatch: pytest.MonkeyPatch) -> None:
    """On equal cells it costs more than it saves."""
    monkeypatch.setattr(Sewing, "coupled", WORTH_IT)
    assert dual(clamped_block("hexahedron")).preconditioner._sewing is NOT_SEWN
    assert isinstance(dual(ball(4, 4)).preconditioner._sewing, Sewing)
    cubes, flat = (dual(cut).inverse.strongest_coupling(3) for cut in (cubes_of(1.0), cubes_of(0.1)))
    assert cubes < 0.5
    assert flat > WORTH_IT


def of_tetrahedra(mesh: BodyMesh) -> BodyMesh:
    """The mesh with hexahedra split around the least of their nodes, and faces from the least of theirs."""

    def halves(faces: np.ndarray) -> list[np.ndarray]:
        around = (faces.argmin(axis=1)[:, None] + np.arange(4)) % 4
        faces = np.take_along_axis(faces, around, axis=1)
        return [faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]

    outwards = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    least, cells = mesh.cells.min(axis=1), []
    for face in outwards:
        opposite = ~(mesh.cells[:, face] == least[:, None]).any(axis=1)
        tips = least[opposite]
        cells += [np.column_stack([half, tips]) for half in halves(mesh.cells[opposite][:, face])]
    split = np.concatenate(cells)[:, [0, 2, 1, 3]]
    return BodyMesh(
        mesh.points, split, {k: np.concatenate(halves(each)) for k, each in mesh.surfaces.items()}
    )


def test_stiffly_coupled_cells_take_a_third_sweep() -> None:
    scene, _ = ball()
    mesh = of_tetrahedra(scene.bodies["ball"].mesh)
    system = dual(
        (replace(scene, bodies={"ball": Body(mesh, STEEL)}), {"ball": bisection_partition(mesh, 6)})
    )
    sewing = sewing_of(system)
    three = condition(system, sewn=True)
    system.preconditioner.sew(replace(sewing, sweeps=2))
    two = condition(system, sewn=True)
    print(f"\ncondition of a ball of tetrahedra: {two:.1f} with two sweeps, {three:.1f} with three")
    assert three < 0.7 * two
    assert [sewing.sweeps, sewing_of(dual(clamped_block("hexahedron"))).sweeps] == [3, 2]


def cubes_of(height: float) -> Cut:
    mesh = block((0, 0, 0), (4, 4, 4 * height), (4, 4, 4))
    scene = Scene({"block": Body(mesh, STEEL)}, [Support("block", "x0")])
    return scene, {"block": bisection_partition(mesh, 2)}


def test_compact_subdomains_store_no_further_matrices() -> None:
    system = dual(clamped_block("hexahedron", layers=3), LocalKind.COMPACT)
    assert system.inverse.is_rounded
    assert system.preconditioner._sewing is NOT_SEWN


@pytest.mark.parametrize("kind", [LocalKind.IMPLICIT, LocalKind.EXPLICIT, LocalKind.COMPACT])
def test_subdomains_alike_have_the_stiffness_of_their_own(kind: LocalKind) -> None:
    mesh = block((0, 0, 0), (2, 2, 2), (4, 4, 4))
    parts = {"block": (mesh.points[mesh.cells].mean(axis=1) > 1.0) @ np.array([1, 2, 4])}
    scene = Scene({"block": Body(mesh, STEEL)}, [Support("block", "x0")])
    inverse = dual((scene, parts), kind).inverse
    assert len(inverse.kinds) < 8
    exact = [
        part.stiffness[local][:, local]
        for part, local in zip(inverse._subdomains, inverse._local, strict=True)
    ]
    apart = inverse.interface_stiffness() - sp.block_diag(exact)
    assert abs(apart).max() < 1e-12 * abs(exact[0]).max()


# Contact: few products whichever way it is discretised, and whatever the cells.
def hertz(discretisation: str, cell: str, friction: float) -> Scene:
    """A quarter of a ball of hexahedra on a block, cells graded towards the spot and both cuts."""
    along = 10.0 * np.expm1(3 * np.linspace(0, 1, 11)) / np.expm1(3)
    meshes = {
        "ball": hemisphere(10.0, 8),
        "block": box_lattice([1.05 * along, along, -along[::-1]], cell),
    }
    law: dict[str, Any] = {"discretisation": discretisation}
    if friction:
        law["friction"] = Coulomb(friction)
    held = [Support(name, side, value) for name in meshes for side, value in SYMMETRIC.items()]
    return Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [*held, Support("block", "z0", (None, None, 0.0))],
        [TotalForce("ball", "top", (0.0, 0.0, -3.75))],
        [ContactPair(Surface("block", "z1"), Surface("ball", "contact"), **law)],
    )


@pytest.mark.parametrize(
    ("discretisation", "cell", "friction", "most"),
    [("mortar", "tetrahedron", 0.0, 65), ("mortar", "tetrahedron", 0.3, 65), ("node", "hexahedron", 0.0, 65)],
)
def test_balls_on_blocks_take_few_products(
    discretisation: str, cell: str, friction: float, most: int
) -> None:
    state = solve_scene(hertz(discretisation, cell, friction), MPI.COMM_SELF, tolerance=1e-6)
    print(f"\nball on block, {discretisation}, {cell}, {friction}: {state.counts}")
    assert state.counts["subdomains"] >= 6
    assert state.balance().imbalance < 1e-9
    assert 10 < np.count_nonzero(state.contact.normal_force) < 0.5 * state.contact.points.count
    assert state.counts["f_products"] < most  # 90, 103 and 91 without either, 72 with friction not at rest
