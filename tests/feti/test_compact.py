"""One triangle in single precision for each subdomain: a third of the memory, and the same answers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.compact import CompactOperator
from fenics_contact.feti.inverse import ExplicitOperator, LocalKind
from fenics_contact.feti.torn import TornSystem
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import DualSolution, FaceNewton, ProjectedCG, Smalse, solve
from tests.feti.scenes import STEEL, clamped_block, touching_blocks


@pytest.fixture(scope="module")
def torn() -> TornSystem:
    scene, partitions = touching_blocks()
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))


@pytest.fixture(scope="module")
def systems(torn: TornSystem) -> dict[LocalKind, DualSystem]:
    return {kind: DualSystem(torn, kind=kind) for kind in (LocalKind.EXPLICIT, LocalKind.COMPACT)}


def solved(system: DualSystem, tolerance: float) -> DualSolution:
    torn = system.torn
    slips = torn.groups.slips
    coefficient, bound = (x[torn.owned_discs] for x in (slips.coefficient, slips.tresca_bound))
    return solve(system.problem, bound, FaceNewton(tolerance=tolerance), friction_coefficient=coefficient)


def test_forces_and_displacements_with_friction_agree_to_ten_digits(
    systems: dict[LocalKind, DualSystem],
) -> None:
    answers = {kind: solved(system, 1e-12) for kind, system in systems.items()}
    whole, compact = answers.values()
    assert whole.residuals.worst < 1e-12
    assert compact.residuals.worst < 1e-12
    size = np.abs(whole.multiplier).max()
    np.testing.assert_allclose(compact.multiplier, whole.multiplier, atol=1e-10 * size)
    moved, same = (systems[kind].displacement(x.multiplier, x.alpha) for kind, x in answers.items())
    np.testing.assert_allclose(same, moved, atol=1e-10 * np.abs(moved).max())


def test_hardly_more_products_are_needed(systems: dict[LocalKind, DualSystem]) -> None:
    whole, compact = (solved(system, 1e-6) for system in systems.values())
    assert whole.products <= compact.products <= 1.05 * whole.products + 1
    # Rounding of single precision is not taken for what F is.
    product = systems[LocalKind.EXPLICIT].apply(compact.multiplier)
    assert np.abs(product - compact.product).max() < 1e-11 * np.abs(product).max()
    assert (
        np.abs(systems[LocalKind.COMPACT].apply_rounded(compact.multiplier) - product).max()
        > 1e-9 * np.abs(product).max()
    )


def test_a_third_of_the_memory_is_held(systems: dict[LocalKind, DualSystem]) -> None:
    held = {
        kind: sum(_bytes(each.operator) for each in system.inverse.kinds) for kind, system in systems.items()
    }
    assert held[LocalKind.COMPACT] < 0.42 * held[LocalKind.EXPLICIT]


def _bytes(operator: object) -> int:
    if isinstance(operator, CompactOperator):
        return operator.nbytes
    assert isinstance(operator, ExplicitOperator)
    return operator._flexible.nbytes + operator._stiff.nbytes


def test_insides_are_made_once_for_what_a_state_recovers(torn: TornSystem) -> None:
    system = DualSystem(torn, kind=LocalKind.COMPACT)
    insides, count = system.inverse._insides, len(system.inverse.kinds)
    before = insides.made
    found = solved(system, 1e-6)
    assert insides.made - before <= 3 * count  # once on the way, and for the certificate
    assert all(not part.matrix.held for part in torn.subdomains)
    before = insides.made
    system.displacement(found.multiplier, found.alpha)
    assert insides.made - before <= count


def test_a_matrix_that_single_precision_cannot_invert_stays_in_double() -> None:
    scene, partitions = clamped_block("hexahedron")
    mesh = scene.bodies["block"].mesh
    middle = mesh.points[mesh.cells].mean(axis=1)
    soft = np.flatnonzero(middle[:, 0] < 0.3)
    regions = {"soft": soft, "hard": np.setdiff1d(np.arange(mesh.n_cells), soft)}
    materials = {"soft": IsotropicElasticity(1e-7, 0.3), "hard": STEEL}
    body = Body(replace(mesh, regions=regions), materials)
    scene = replace(scene, bodies={"block": body})
    inverse = DualSystem(
        build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)), kind=LocalKind.COMPACT
    ).inverse
    kinds = [type(each.operator) for each in inverse.kinds]
    assert ExplicitOperator in kinds
    assert CompactOperator in kinds


def test_a_linear_problem_is_solved_to_ten_digits() -> None:
    scene, partitions = clamped_block("tetrahedron")
    torn = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))
    kinds = LocalKind.EXPLICIT, LocalKind.COMPACT
    whole, compact = (
        solve(DualSystem(torn, kind=kind).problem, None, ProjectedCG(tolerance=1e-11)) for kind in kinds
    )
    size = np.abs(whole.multiplier).max()
    np.testing.assert_allclose(compact.multiplier, whole.multiplier, atol=1e-10 * size)


def test_a_linear_problem_needs_few_products_more_however_small_its_tolerance() -> None:
    scene, partitions = clamped_block("tetrahedron")
    torn = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))
    whole, compact = (
        solve(DualSystem(torn, kind=kind).problem, None, ProjectedCG(tolerance=1e-10)).products
        for kind in (LocalKind.EXPLICIT, LocalKind.COMPACT)
    )
    assert whole < compact <= 1.5 * whole


def test_what_single_precision_does_not_reach_by_smalse_is_refused() -> None:
    scene, partitions = clamped_block("tetrahedron")
    system = DualSystem(
        build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)), kind=LocalKind.COMPACT
    )
    message = "SMALSE needs subdomains in double precision below a tolerance of 1e-05, got 1e-06"
    with pytest.raises(InvalidInputError, match=message):
        solve(system.problem, None, Smalse(tolerance=1e-6))
    assert solve(system.problem, None, Smalse(tolerance=1e-4)).residuals.within(1e-4)
