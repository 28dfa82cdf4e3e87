"""The memory that a state needs is known from the scene, and refused where there is less."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import Scene, box_partition, solve_scene
from fenics_contact._base.memory import return_memory
from fenics_contact._scene import memory
from fenics_contact._scene.memory import Rates, Subdomains, expected_memory, require_memory
from fenics_contact.design.adjoint import WeakChoice, linearise_face, solve_adjoint
from fenics_contact.design.objective import Partials
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import DualSystem, build_torn_system, decompose, decomposition
from fenics_contact.gallery import block
from fenics_contact.results.linear_state import LinearState
from tests.feti.scenes import skewed

#: A straight mesh, how often it is cut along each axis, and whether it is bent.
CUTS = {
    "equal": (block_mesh((12, 6, 6)), (4, 2, 2), False),
    "tetrahedra": (block((0, 0, 0), (2, 1, 1), (6, 4, 4), "tetrahedron"), (3, 2, 2), False),
    "bent": (block_mesh((6, 4, 4)), (3, 2, 2), True),
}


def cut(name: str) -> tuple[Scene, dict[str, np.ndarray]]:
    mesh, boxes, bent = CUTS[name]
    return block_on_plane(skewed(mesh) if bent else mesh, 0.3), {"block": box_partition(mesh, boxes)}


@pytest.mark.parametrize("name", CUTS)
def test_kinds_matrices_and_interfaces_are_those_that_are_built(name: str) -> None:
    scene, parts = cut(name)
    known = Subdomains.of(scene, parts)
    torn = build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF))
    system = DualSystem(torn)
    assert known.size.tolist() == [part.mesh.size for part in torn.subdomains]
    assert known.interface.sum() == len(system.inverse.interface)
    assert len(set(known.kind)) == len(system.inverse.kinds)
    assert len(set(known.matrix)) == len({id(part.matrix) for part in torn.subdomains})
    entries = sum(part.stiffness.nnz for part in torn.subdomains)
    assert known.couplings @ known.size == pytest.approx(entries, rel=0.05)


def test_every_rank_has_factors_of_its_own_and_a_machine_one_set_of_tables() -> None:
    scene, parts = cut("equal")
    known, rates = Subdomains.of(scene, parts), Rates()
    alone, two = expected_memory(scene, known), expected_memory(scene, known, 2)
    tables = rates.tables * known.size.sum() + sum(
        array.nbytes for array in (scene.bodies["block"].mesh.points, scene.bodies["block"].mesh.cells)
    )
    assert two > alone + rates.start + rates.alone * known.size.sum()
    assert two < 2.0 * alone - tables
    assert expected_memory(scene, known, 2, machines=2) == pytest.approx(two + tables)
    unlike = Subdomains.of(*cut("bent"))
    assert len(set(unlike.kind)) == len(unlike.size) == 12
    assert scene.plan(parts).memory == alone
    assert scene.plan(parts, ranks=2).memory == two


def test_a_scene_that_does_not_fit_into_memory_is_refused_before_it_is_built(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = block_mesh((34, 22, 22))
    scene = block_on_plane(mesh, 0.3)
    parts = {"block": box_partition(mesh, (5, 4, 4))}
    needed = expected_memory(scene, Subdomains.of(scene, parts), compact=True)
    monkeypatch.setattr(memory, "available_memory", lambda: 0.5 * needed)
    message = (
        rf"a state must fit into memory, but {mesh.points.size} unknowns need about {needed / 1e9:.3g} GB on "
        rf"this machine, and {0.5 * needed / 1e9:.3g} GB are left: about {mesh.points.size // 2:,} unknowns "
        "would fit; take coarser meshes"
    )
    monkeypatch.setattr(decomposition, "cut_out", None)  # nothing is cut
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(scene, MPI.COMM_SELF, partitions=parts)
    allowed = message.replace("are left", "are allowed")
    with pytest.raises(InvalidInputError, match=allowed):
        solve_scene(scene, MPI.COMM_SELF, partitions=parts, memory=0.5 * needed)
    monkeypatch.setattr(memory, "available_memory", lambda: 0.9 * needed)  # an estimate may err
    counted = partial(Subdomains.of, scene, parts)
    assert require_memory(scene, counted, MPI.COMM_SELF)
    monkeypatch.setattr(memory, "available_memory", lambda: None)
    assert not require_memory(scene, counted, MPI.COMM_SELF)


def test_subdomains_are_stored_compactly_where_a_state_would_not_fit_otherwise() -> None:
    scene, parts = cut("bent")
    known = Subdomains.of(scene, parts)
    needed, least = (expected_memory(scene, known, compact=compact) for compact in (False, True))
    assert least < needed
    roomy = solve_scene(scene, MPI.COMM_SELF, partitions=parts, memory=2.0 * needed, tolerance=1e-11)
    tight = solve_scene(scene, MPI.COMM_SELF, partitions=parts, memory=needed, tolerance=1e-11)
    assert isinstance(roomy, LinearState)
    assert isinstance(tight, LinearState)
    assert not roomy.dual.inverse.is_rounded
    assert tight.dual.inverse.is_rounded
    forces = roomy.solution.multiplier
    np.testing.assert_allclose(tight.solution.multiplier, forces, atol=1e-10 * np.abs(forces).max())
    nodes = scene.bodies["block"].mesh.n_nodes
    by_displacement = np.random.default_rng(0).standard_normal(roomy.torn_displacement.shape)
    partials = Partials(0.0, by_displacement, np.zeros_like(forces), np.zeros((nodes, 3)))
    adjoints = [
        solve_adjoint(state, partials, linearise_face(state, WeakChoice.RELEASED), tolerance=1e-10)
        for state in (roomy, tight)
    ]
    expected, found = (adjoint.multiplier for adjoint in adjoints)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    for without_sense in (0.0, np.nan, np.inf):
        with pytest.raises(InvalidInputError, match="memory must be positive and finite, got"):
            solve_scene(scene, MPI.COMM_SELF, partitions=parts, memory=without_sense)


def test_bodies_are_cut_leaner_where_a_state_would_not_fit_otherwise() -> None:
    scene = block_on_plane(skewed(block_mesh((10, 8, 8))), 0.3)
    usual, lean = scene.partition(), scene.partition(lean=True)
    assert usual["block"].max() < lean["block"].max()
    needed = expected_memory(scene, Subdomains.of(scene, usual), compact=True)
    states = [solve_scene(scene, MPI.COMM_SELF, memory=most * needed, tolerance=1e-9) for most in (1.2, 1.0)]
    for state, cut_as in zip(states, (usual, lean), strict=True):
        np.testing.assert_array_equal(state.torn.decomposition.partitions["block"], cut_as["block"])
    forces = [state.contact.normal_force for state in states]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-7 * forces[0].max())


TAKEN = """
import sys
from mpi4py import MPI
from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import _dolfinx, solve_scene
from fenics_contact._base.libraries import start
from fenics_contact._scene.memory import Subdomains, expected_memory
from fenics_contact.gallery import block
from fenics_contact.qp import FaceNewton
from fenics_contact.study.worker import peak_memory
from tests.feti.scenes import skewed

comm = MPI.COMM_WORLD
start(comm)
_dolfinx.release()
before = peak_memory()
compactly = sys.argv[2] == "compact"  # of which large scenes have need
if sys.argv[1] == "tetrahedra":
    mesh = block((0, 0, 0), (2, 1, 1), (52, 26, 24) if compactly else (26, 13, 12), "tetrahedron")
else:
    mesh = block_mesh((56, 28, 28) if compactly else (40, 21, 20))
scene = block_on_plane(skewed(mesh) if compactly else mesh, 0.3)
parts = scene.partition(comm.size)
known = Subdomains.of(scene, parts)
fast, compact = (expected_memory(scene, known, comm.size, compact=each) for each in (False, True))
limit = fast if compactly else 2.0 * fast
state = solve_scene(scene, comm, partitions=parts, solver=FaceNewton(), memory=limit)
assert state.dual.inverse.is_rounded == compactly
taken = comm.allreduce(peak_memory() - before)
if comm.rank == 0:
    print((compact if compactly else fast) / taken)
"""


@pytest.mark.claim
@pytest.mark.parametrize(
    ("cells", "stored", "ranks"),
    [
        ("tetrahedra", "fast", 1),
        ("tetrahedra", "fast", 2),
        ("hexahedra", "fast", 1),
        ("hexahedra", "fast", 2),
        ("tetrahedra", "compact", 1),
        ("hexahedra", "compact", 1),
    ],
)
def test_the_expected_memory_is_what_a_state_takes(
    mpirun: Callable[..., str], cells: str, stored: str, ranks: int
) -> None:
    near = 0.1 if stored == "compact" else 0.2
    assert float(mpirun(TAKEN, ranks, cells, stored, fresh=True)) == pytest.approx(1.0, abs=near)


def test_what_was_freed_between_objects_that_stay_returns_to_the_system() -> None:
    if not hasattr(ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("only the C library of GNU returns it")

    def resident() -> int:
        return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

    size = 60_000  # small enough not to be mapped one by one
    pieces: list[bytearray | None] = [bytearray(size) for _ in range(800)]
    for place in range(800):
        if place % 8:
            pieces[place] = None
    before = resident()
    return_memory()
    assert resident() < before - 0.5 * 700 * size
    assert sum(each is not None for each in pieces) == 100
