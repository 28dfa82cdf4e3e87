"""Operators of one subdomain: kernel, generalised inverse and condensation."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, TotalForce, box_partition
from fenics_contact._base.sparse import LocalCost, explicit_cost, implicit_cost, prefers_explicit
from fenics_contact.feti import DualSystem, build_torn_system, decompose, dual
from fenics_contact.feti.compact import CompactOperator, Insides
from fenics_contact.feti.condensation import Condensation, Condensations
from fenics_contact.feti.factor import Factor, fixing_nodes, regularised
from fenics_contact.feti.inverse import (
    ExplicitOperator,
    ImplicitOperator,
    LocalKind,
    TornInverse,
)
from fenics_contact.feti.sewing import NOT_SEWN
from fenics_contact.feti.subdomain import LocalOperator, Subdomain, interface_dofs
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton, solve
from tests.feti.scenes import CELLS, STEEL, Cut, lone_block, ragged_block, touching_blocks

KINDS = (ImplicitOperator, ExplicitOperator, CompactOperator)


def piece(cell: str, cells: int = 3) -> Subdomain:
    mesh = block((0, 0, 0), (1, 1.2, 0.9), (cells, cells, cells), cell)
    scene = Scene({"block": Body(mesh, STEEL)})
    parts = {"block": np.zeros(mesh.n_cells, dtype=int)}
    return build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF)).subdomains[0]


def surface(subdomain: Subdomain) -> np.ndarray:
    """Marks of the dofs on two sides, but for one component of one side."""
    points = subdomain.points
    left, right = (np.isclose(points[:, 0], x) for x in (0.0, 1.0))
    marks = np.repeat((left | right)[:, None], 3, axis=1)
    marks[right, 1] = False
    return marks.ravel()


def keep(kind: type, subdomain: Subdomain, interface: np.ndarray) -> LocalOperator:
    if kind is ExplicitOperator:
        return ExplicitOperator(subdomain, interface, Condensations())
    if kind is CompactOperator:
        schur = Condensations().schur_complement(subdomain.stiffness, interface)
        return CompactOperator(subdomain, interface, schur, Insides())
    return ImplicitOperator(subdomain, interface)


def columns(method: object, size: int) -> np.ndarray:
    found = np.empty((size, size))
    for k, unit in enumerate(np.eye(size)):
        method(unit, out := np.empty(size))  # type: ignore[operator]
        found[:, k] = out
    return found


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_inverse_is_a_symmetric_generalised_one(cell: str, kind: type) -> None:
    subdomain = piece(cell)
    operator = keep(kind, subdomain, np.flatnonzero(surface(subdomain)))
    K = subdomain.stiffness.toarray()
    inverse = np.column_stack([operator.invert(unit) for unit in np.eye(len(K))])
    assert abs(inverse - inverse.T).max() < 1e-9 * abs(inverse).max()
    assert abs(K @ inverse @ K - K).max() < 1e-9 * abs(K).max()


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("kind", KINDS)
def test_flexing_is_the_inverse_seen_from_the_interface(cell: str, kind: type) -> None:
    subdomain = piece(cell)
    b = np.flatnonzero(surface(subdomain))
    operator = keep(kind, subdomain, b)
    inverse = np.column_stack([operator.invert(unit)[b] for unit in np.eye(subdomain.mesh.size)[b]])
    F = columns(operator.apply_flexibility_exactly, len(b))
    assert abs(F - inverse).max() < 1e-10 * abs(inverse).max()
    rounding = 1e-5 if kind is CompactOperator else 1e-15
    assert abs(columns(operator.apply_flexibility, len(b)) - F).max() <= rounding * abs(F).max()
    rows = sp.random(7, len(b), density=0.1, random_state=3, format="csr")
    expected = np.einsum("ij,jk,ik->i", rows.toarray(), F, rows.toarray())
    one_by_one = operator.row_flexibility(rows, 1)  # type: ignore[call-arg]  # the protocol has no such choice
    for found in (operator.row_flexibility(rows), one_by_one):
        np.testing.assert_allclose(found, expected, rtol=max(1e-9, rounding), atol=1e-12 * abs(F).max())


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    ("kind", "rounding"), [(ImplicitOperator, 1e-10), (ExplicitOperator, 1e-6), (CompactOperator, 1e-6)]
)
def test_stiffening_is_the_schur_complement(cell: str, kind: type, rounding: float) -> None:
    subdomain = piece(cell)
    marks = surface(subdomain)
    b, i = np.flatnonzero(marks), np.flatnonzero(~marks)
    K = subdomain.stiffness.toarray()
    expected = K[np.ix_(b, b)] - K[np.ix_(b, i)] @ np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)])
    S = columns(keep(kind, subdomain, b).apply_stiffness, len(b))
    assert abs(S - expected).max() < rounding * abs(expected).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [1e-60, 1e60])
def test_stiffening_has_room_for_displacements_of_any_size(kind: type, size: float) -> None:
    subdomain = piece("hexahedron")
    b = np.flatnonzero(surface(subdomain))
    operator, way = keep(kind, subdomain, b), np.linspace(-1.0, 2.0, len(b))
    operator.apply_stiffness(way, force := np.empty(len(b)))
    operator.apply_stiffness(size * way, other := np.empty(len(b)))
    np.testing.assert_allclose(other / size, force, rtol=1e-5, atol=1e-5 * abs(force).max())
    operator.apply_stiffness(0.0 * way, other)
    assert not other.any()


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_interface_extends_with_the_least_energy(cell: str, kind: type) -> None:
    subdomain = piece(cell)
    marks = surface(subdomain)
    b, i = np.flatnonzero(marks), np.flatnonzero(~marks)
    way = np.random.default_rng(2).standard_normal(len(b))
    whole, force = keep(kind, subdomain, b).extend(way)
    np.testing.assert_array_equal(whole[b], way)
    resulting = subdomain.stiffness @ whole
    size = np.abs(resulting).max()
    assert np.abs(resulting[i]).max() < 1e-12 * size
    np.testing.assert_allclose(force, resulting[b], rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("kind", KINDS)
def test_an_interface_that_is_everything_leaves_no_inside(kind: type) -> None:
    subdomain = piece("hexahedron", cells=1)
    operator = keep(kind, subdomain, np.arange(subdomain.mesh.size))
    S = columns(operator.apply_stiffness, subdomain.mesh.size)
    K = subdomain.stiffness.toarray()
    assert abs(S - K).max() < 1e-6 * abs(K).max()
    right = K @ np.random.default_rng(1).standard_normal(len(K))
    np.testing.assert_allclose(K @ operator.invert(right), right, atol=1e-9 * abs(right).max())


@pytest.mark.parametrize("touched", [0, 1, 2])
def test_an_interface_that_holds_nothing_is_completed(touched: int) -> None:
    subdomain = piece("hexahedron")
    marks = np.zeros(subdomain.mesh.size, dtype=bool)
    marks[: 3 * touched] = True
    b = interface_dofs(marks, subdomain.kernel, subdomain.points)
    assert np.isin(np.flatnonzero(marks), b).all()
    inside = np.setdiff1d(np.arange(subdomain.mesh.size), b)
    stiffness = subdomain.stiffness.toarray()[np.ix_(inside, inside)]
    values = np.linalg.eigvalsh(stiffness)
    assert values.min() > 1e-4 * values.max()


def test_subdomains_with_the_same_pattern_share_one_symbolic_factorisation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made: list[Condensations] = []

    def kept() -> Condensations:
        made.append(Condensations())
        return made[-1]

    monkeypatch.setattr(dual, "Condensations", kept)
    mesh = block((0, 0, 0), (6, 1, 1), (12, 2, 2))
    scene = Scene(
        {"bar": Body(mesh, STEEL)}, [Support("bar", "x0")], [TotalForce("bar", "x1", (0.0, 0.0, -1.0))]
    )
    decomposition = decompose(scene, {"bar": box_partition(mesh, (6, 1, 1))}, MPI.COMM_SELF)
    torn = build_torn_system(scene, decomposition)
    system = DualSystem(torn, kind=LocalKind.EXPLICIT, shared=False)
    assert system.inverse.factored == 6
    # The last piece has another interface than those which a support or a neighbour holds at both ends.
    assert 1 <= made.pop().analysed <= 3
    workspaces = [each for each in gc.get_objects() if isinstance(each, Condensation)]
    assert not workspaces  # none is kept with the system


def test_only_one_workspace_is_held_while_subdomains_are_factored(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[weakref.ref[Condensation]] = []
    held: list[int] = []
    begin = Condensation.__init__

    def counted(self: Condensation, pattern: sp.csr_matrix, interface: np.ndarray) -> None:
        held.append(sum(each() is not None for each in made))
        made.append(weakref.ref(self))
        begin(self, pattern, interface)

    monkeypatch.setattr(Condensation, "__init__", counted)
    # Of two patterns in turn.
    pieces = 2 * [piece("hexahedron", cells=2), piece("hexahedron")]
    B = sp.identity(sum(each.mesh.size for each in pieces), format="csr")
    B = B[np.concatenate([surface(each) for each in pieces])]
    condensations = Condensations()
    inverse = TornInverse(pieces, B, condensations, kind=LocalKind.EXPLICIT, shared=False)
    assert inverse.factored == 4
    assert condensations.analysed == len(made) == 2
    assert held == [0, 0]


def test_both_kinds_give_the_same_contact_forces() -> None:
    scene, partitions = touching_blocks()
    torn = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))
    answers = []
    for kind in (LocalKind.IMPLICIT, LocalKind.EXPLICIT):
        system = DualSystem(torn, kind=kind)
        coefficient = torn.groups.slips.coefficient[system.torn.owned_discs]
        bound = torn.groups.slips.tresca_bound[system.torn.owned_discs]
        answers.append(
            solve(system.problem, bound, FaceNewton(tolerance=1e-9), friction_coefficient=coefficient)
        )
    first, second = (answer.multiplier[torn.n_equality :] for answer in answers)
    np.testing.assert_allclose(first, second, atol=1e-6 * abs(first).max())


def test_the_cost_model_prefers_dense_matrices_on_small_interfaces_and_for_many_products() -> None:
    assert prefers_explicit(2000, 600)
    assert not prefers_explicit(10_000, 5_000)
    assert not prefers_explicit(2000, 1100, products=1)
    assert prefers_explicit(2000, 1100, products=100_000)


def test_predicted_costs_grow_with_size_and_products() -> None:
    for cost in (implicit_cost, explicit_cost):
        small, large = cost(1000, 300), cost(4000, 900)
        assert 0 < small.setup < large.setup
        assert 0 < small.product < large.product
    assert LocalCost(setup=2.0, product=0.5).total(10) == 7.0


def test_weighting_by_stiffness_saves_products_where_materials_differ(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A body that is a thousand times stiffer than its partners in contact."""
    scene, partitions = touching_blocks()
    lower = scene.bodies["lower"]
    stiff = IsotropicElasticity(1e3 * STEEL.young_modulus, STEEL.poisson_ratio)
    scene = replace(scene, bodies={**scene.bodies, "lower": Body(lower.mesh, stiff)})
    torn = build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF))

    def products() -> int:
        problem, law = DualSystem(torn).problem, torn.groups.slips.coefficient
        return solve(problem, torn.groups.slips.tresca_bound, FaceNewton(), friction_coefficient=law).products

    weighted = products()
    monkeypatch.setattr(DualSystem, "_compliance", lambda self: np.ones(len(self.inverse.interface)))
    assert weighted < 0.75 * products()


@pytest.mark.parametrize("kind", [LocalKind.IMPLICIT, LocalKind.EXPLICIT])
@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e9])
def test_the_energy_of_a_displacement_is_that_of_double_precision(kind: LocalKind, unit: float) -> None:
    scene, parts = touching_blocks()
    system = DualSystem(build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF)), kind=kind)
    exact = DualSystem(system.torn, kind=LocalKind.IMPLICIT).inverse
    rng = np.random.default_rng(0)
    rigid = (system.kernel @ rng.normal(size=system.kernel.shape[1]))[system.inverse.interface]
    for share in (1.0, 1e-3):
        bent = share * rng.normal(size=len(rigid))
        energy = bent @ exact.apply_stiffness(bent)
        assert energy > 0.0
        found, force = system.inverse.energy(unit * (rigid + bent))
        assert found == pytest.approx(unit**2 * energy, rel=1e-9)
        np.testing.assert_allclose(
            force, unit * exact.apply_stiffness(bent), rtol=0, atol=1e-9 * np.abs(force).max()
        )
    assert system.inverse.energy(np.zeros_like(rigid))[0] == 0.0


def test_a_lifting_closes_the_rows_of_a_face() -> None:
    scene, parts = touching_blocks()
    system = DualSystem(build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF)))
    layout = system.problem.layout
    rows = np.concatenate([layout.equality, layout.normal[::2]])
    face = sp.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(layout.size, len(rows)))
    jump = face @ np.random.default_rng(1).normal(size=len(rows))
    lifting = system.preconditioner.lifting(face)
    moved = system.interface_jump(lifting.jump(jump))
    assert len(layout.normal) > 3
    np.testing.assert_allclose(moved[rows], jump[rows], atol=1e-3 * np.abs(jump).max())
    _, force = system.inverse.energy(lifting.jump(jump))
    system.preconditioner._sewing = NOT_SEWN
    expected = system.preconditioner.on_face(face)(jump)
    np.testing.assert_allclose(lifting.multiplier(force), expected, atol=1e-5 * np.abs(expected).max())


# Kernels are what the stiffness does not feel, and K⁺ undoes it up to them.
def subdomains(cut: Cut) -> tuple[Subdomain, ...]:
    scene, partitions = cut
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)).subdomains


def whole_piece(cell: str, size: tuple[float, float, float], counts: tuple[int, int, int]) -> Subdomain:
    """One block as one subdomain."""
    mesh = block((0, 0, 0), size, counts, cell)
    return subdomains((Scene({"block": Body(mesh, STEEL)}), {"block": np.zeros(mesh.n_cells, dtype=int)}))[0]


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("cut", [lone_block, ragged_block])
def test_kernel_is_annihilated_by_stiffness(cell: str, cut: object) -> None:
    found = subdomains(cut(cell))  # type: ignore[operator]
    assert len(found) > 4
    for subdomain in found:
        stiffness, kernel = subdomain.stiffness, subdomain.kernel
        assert np.linalg.matrix_rank(kernel) == kernel.shape[1] == 6
        assert abs(stiffness @ kernel).max() < 1e-12 * abs(stiffness).max()


@pytest.mark.parametrize("cell", CELLS)
def test_kernel_holds_every_mode_without_energy(cell: str) -> None:
    for subdomain in subdomains(ragged_block(cell)):
        energy = np.linalg.eigvalsh(subdomain.stiffness.toarray())
        assert np.count_nonzero(energy < 1e-10 * energy.max()) == subdomain.kernel.shape[1]
        assert energy.min() > -1e-12 * energy.max()


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    ("size", "counts"),
    [((1, 1, 1), (3, 3, 3)), ((1, 1, 30), (1, 1, 30)), ((30, 30, 1), (8, 8, 1)), ((1, 2, 3), (1, 1, 1))],
    ids=["cube", "rod", "plate", "one brick"],
)
def test_the_inverse_of_the_regularised_stiffness_is_a_generalised_inverse(
    cell: str, size: tuple[float, float, float], counts: tuple[int, int, int]
) -> None:
    subdomain = whole_piece(cell, size, counts)
    stiffness = subdomain.stiffness.toarray()
    matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
    assert np.linalg.eigvalsh(matrix.toarray()).min() > 0.0
    inverse = Factor(matrix).solve_many(np.eye(len(stiffness)))
    np.testing.assert_allclose(inverse, inverse.T, atol=1e-9 * abs(inverse).max())
    back = stiffness @ inverse @ stiffness
    assert abs(back - stiffness).max() < 1e-9 * abs(stiffness).max()


def test_one_tetrahedron_is_a_subdomain_too() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1), "tetrahedron")
    found = subdomains((Scene({"block": Body(mesh, STEEL)}), {"block": np.arange(6)}))
    assert [subdomain.mesh.size for subdomain in found] == [12] * 6
    for subdomain in found:
        matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
        assert np.linalg.eigvalsh(matrix.toarray()).min() > 0.0


def test_the_regularised_stiffness_stays_sparse() -> None:
    subdomain = whole_piece("hexahedron", (1, 1, 1), (4, 4, 4))
    matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
    assert matrix.nnz < subdomain.stiffness.nnz + 12**2


def test_one_right_side_and_many_have_the_same_solutions() -> None:
    subdomain = whole_piece("hexahedron", (1, 1, 1), (2, 2, 2))
    factor = Factor(regularised(subdomain.stiffness, subdomain.kernel, subdomain.points))
    right = np.random.default_rng(0).standard_normal((factor.size, 3))
    many = factor.solve_many(right)
    for k in range(3):
        one = np.empty(factor.size)
        factor.solve(right[:, k], one)
        np.testing.assert_allclose(many[:, k], one, rtol=1e-10)
    assert factor.solve_many(right[:, :0]).shape == (factor.size, 0)


@pytest.mark.parametrize("counts", [(4, 4, 4), (1, 1, 9), (6, 6, 1)])
def test_fixing_nodes_are_far_apart_and_not_on_a_line(counts: tuple[int, int, int]) -> None:
    points = block((0, 0, 0), counts, counts).points
    chosen = points[fixing_nodes(points)]
    apart = np.linalg.norm(chosen[:, None] - chosen, axis=2)[np.triu_indices(4, 1)]
    assert apart.min() > 0.2 * max(counts)
    assert np.linalg.matrix_rank(chosen - chosen[0]) >= 2


def test_few_nodes_are_all_fixed() -> None:
    assert sorted(fixing_nodes(np.eye(3))) == [0, 1, 2]


def test_the_stiffness_follows_the_material() -> None:
    soft = whole_piece("hexahedron", (1, 1, 1), (1, 1, 1))
    scene = Scene(
        {"block": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), replace(STEEL, young_modulus=420.0))}
    )
    stiff = subdomains((scene, {"block": np.zeros(1, dtype=int)}))[0]
    assert sp.linalg.norm(stiff.stiffness - 2 * soft.stiffness) < 1e-12 * sp.linalg.norm(stiff.stiffness)


# Schur complements of subdomains, however few of their dofs lie inside.
@pytest.mark.parametrize("inside", [1, 2, 5, 30])
def test_a_condensation_is_the_schur_complement_however_few_dofs_lie_inside(inside: int) -> None:
    random = np.random.default_rng(inside)
    size = 24 + inside // 2
    root = random.standard_normal((size, size))
    matrix = root @ root.T + np.eye(size)
    interface = np.sort(random.choice(size, size - min(inside, size - 1), replace=False))
    within = np.setdiff1d(np.arange(size), interface)
    given = sp.csr_matrix(matrix)
    condensation = Condensation(given, interface)
    reduced = np.linalg.solve(matrix[np.ix_(within, within)], matrix[np.ix_(within, interface)])
    expected = matrix[np.ix_(interface, interface)] - matrix[np.ix_(interface, within)] @ reduced
    # MUMPS fills one triangle, and may take too little memory for the integers of small matrices.
    for found in (condensation(given), condensation._by_factor(given)):
        small = 1e-12 * np.abs(expected).max()
        assert np.tril(found) == pytest.approx(np.tril(expected), rel=1e-10, abs=small)
