"""Subdomains that are alike up to a rigid motion share factors, others do not, and answers stay the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.spatial.transform import Rotation
from ufl.domain import extract_unique_domain

from fenics_contact import (
    Body,
    BodyMesh,
    ContactProblem,
    ElasticFoundation,
    Scene,
    Support,
    box_partition,
    solve_scene,
)
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.alike import Kind, Kinds
from fenics_contact.feti.by_shape import BY_MATRIX, ByMatrix, ByShape, Family, Samples
from fenics_contact.feti.compact import CompactOperator
from fenics_contact.feti.inverse import (
    ExplicitOperator,
    FactoredOperator,
    LocalKind,
    TornInverse,
    _distinct_rows,
)
from fenics_contact.feti.moved import SAME, Placement
from fenics_contact.feti.subdomain import Assembled, assemble
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    Elasticity,
    IsotropicElasticity,
    Material,
    OrthotropicElasticity,
    PlaneStrain,
    strain,
)
from fenics_contact.qp import FaceNewton
from tests.feti.scenes import STEEL, skewed, sliding_block

TURN = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
IN_PLANE = Rotation.from_euler("z", 0.4).as_matrix()[:2, :2]
WAYS = (LocalKind.IMPLICIT, LocalKind.EXPLICIT, LocalKind.COMPACT)


@pytest.fixture(params=[1, 1000], ids=["at once", "one by one"], autouse=True)
def number_from_which_products_are_taken_at_once(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    for operator in (ExplicitOperator, FactoredOperator, CompactOperator):
        monkeypatch.setattr(operator, "pays_from", request.param)


def bent(cell: str = "hexahedron") -> BodyMesh:
    """A mesh that no rotation or mirror maps on itself."""
    return skewed(block((0, 0, 0), (1.0, 1.2, 0.9), (2, 3, 2), cell))


def renumbered(mesh: BodyMesh) -> BodyMesh:
    """The same mesh with nodes and cells in another order."""
    random = np.random.default_rng(0)
    order, cells = random.permutation(mesh.n_nodes), random.permutation(mesh.n_cells)
    new = np.argsort(order)
    surfaces = {name: new[facets] for name, facets in mesh.surfaces.items()}
    return BodyMesh(mesh.points[order], new[mesh.cells[cells]], surfaces)


def of_bodies(bodies: Sequence[Body], sides: Sequence[str], kind: LocalKind) -> TornInverse:
    """The inverse of bodies with one subdomain each, on the supported sides of which are their interfaces."""
    named = {f"body {k}": body for k, body in enumerate(bodies)}
    supports = [Support(name, side) for name, side in zip(named, sides, strict=True)]
    scene = Scene(named, supports)
    parts = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in named.items()}
    torn = build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF))
    return DualSystem(torn, kind=kind).inverse


def require_operators_of_each(inverse: TornInverse) -> None:
    """Hold every operator against the subdomain's own matrix."""
    random = np.random.default_rng(1)
    forces = random.normal(size=len(inverse.interface))
    flexed, stiffened = np.zeros_like(forces), np.zeros_like(forces)
    each = zip(inverse._subdomains, inverse.operators, inverse._local, inverse._parts, strict=True)
    for subdomain, operator, b, part in each:
        K = subdomain.matrix.get().toarray()
        inner = np.setdiff1d(np.arange(len(K)), b)
        w = K @ random.normal(size=len(K))
        np.testing.assert_allclose(K @ operator.invert(w), w, atol=1e-10 * np.abs(w).max())
        on_b = np.zeros(len(K))
        on_b[b] = forces[part]
        flexed[part] = operator.invert(on_b)[b]
        bending = np.linalg.solve(K[np.ix_(inner, inner)], K[np.ix_(inner, b)])
        S = K[np.ix_(b, b)] - K[np.ix_(b, inner)] @ bending
        stiffened[part] = S @ forces[part]
        whole, force = operator.extend(forces[part])
        np.testing.assert_allclose(whole[inner], -bending @ forces[part], atol=1e-10 * np.abs(whole).max())
        np.testing.assert_allclose(force, stiffened[part], atol=1e-10 * np.abs(force).max())
        rows = np.round(random.normal(size=(4, len(b))))
        columns = np.array([_flexed(operator, row) for row in rows])
        found = operator.row_flexibility(csr_matrix(rows))
        rounding = 1e-5 if inverse.is_rounded else 1e-8
        np.testing.assert_allclose(found, np.einsum("kn,kn->k", rows, columns), rtol=rounding)
    size, rounding = np.abs(flexed).max(), 1e-5 if inverse.is_rounded else 1e-10
    np.testing.assert_allclose(inverse.apply_flexibility_exactly(forces), flexed, atol=1e-10 * size)
    np.testing.assert_allclose(inverse.apply_flexibility(forces), flexed, atol=rounding * size)
    np.testing.assert_allclose(
        inverse.apply_stiffness(forces), stiffened, atol=1e-5 * np.abs(stiffened).max()
    )
    across = np.round(random.normal(size=(4, len(forces)), scale=0.4))
    across[1] = -across[0]
    expected = [row @ inverse.apply_flexibility_exactly(row) for row in across]
    found = inverse.row_flexibility(csr_matrix(across))
    np.testing.assert_allclose(found, expected, rtol=1e-5 if inverse.is_rounded else 1e-8)


def _flexed(operator: Any, force: np.ndarray) -> np.ndarray:
    operator.apply_flexibility_exactly(force, found := np.empty_like(force))
    return found


def moved(mesh: BodyMesh, Q: np.ndarray) -> BodyMesh:
    return mesh.moved(mesh.points @ Q.T + np.array([3.0, -2.0, 0.7]))


class OwnElasticity(IsotropicElasticity):
    """A user's material, whose stiffness may have directions as far as anybody knows."""


@pytest.mark.parametrize(
    # Those of the first, and of the first turned one, with which others agree dof by dof; compared by shapes
    # that of the first, then the sample, and no others.
    ("steel", "expected"),
    [(OwnElasticity(210.0, 0.3), [0, 1, 1, 2, 2]), (STEEL, [0, 1, 1, 2, 2])],
)
def test_matrices_are_held_no_longer_than_others_are_compared_with_them(
    steel: Material, expected: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    placed, held, place = list[Kind](), list[int](), Kinds.place

    def recorded(self: Kinds, given: Kind) -> tuple[Kind, Placement]:
        held.append(sum(each.subdomain.matrix.held for each in placed))
        placed.append(given)
        return place(self, given)

    monkeypatch.setattr(Kinds, "place", recorded)
    monkeypatch.setattr(Assembled, "same_as", lambda *given: None)  # each has a matrix of its own
    mesh = bent()
    meshes = [mesh, moved(mesh, np.eye(3)), moved(mesh, TURN), moved(mesh, TURN), renumbered(mesh)]
    inverse = of_bodies([Body(each, steel) for each in meshes], ["x0"] * 5, LocalKind.EXPLICIT)
    assert (len(inverse.kinds), inverse.factored) == (1, 1)
    assert held == expected
    assert not any("blocks" in vars(each) for each in placed)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_bodies_that_are_shifted_turned_and_renumbered_are_one_kind(cell: str, way: LocalKind) -> None:
    mesh = bent(cell)
    meshes = [mesh, moved(mesh, np.eye(3)), moved(mesh, QUARTER), moved(mesh, TURN), renumbered(mesh)]
    inverse = of_bodies([Body(each, STEEL) for each in meshes], ["x0"] * 5, way)
    assert (len(inverse.kinds), inverse.factored) == (1, 1)
    require_operators_of_each(inverse)


def test_rows_that_subdomains_alike_have_in_common_are_solved_for_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = bent()
    inverse = of_bodies([Body(each, STEEL) for each in (mesh, moved(mesh, np.eye(3)))], ["x0"] * 2, WAYS[0])
    assert len(inverse.kinds) == 1
    operator, solved = inverse.kinds[0].operator, []
    row = np.zeros(len(inverse.interface) // 2)
    row[[1, 4]] = 0.0, 2.0
    rows = csr_matrix(np.array([np.append(row, 0 * row), np.append(0 * row, -row), np.append(row, 2 * row)]))
    whole = type(operator).row_flexibility

    def counted(self: Any, rows: csr_matrix) -> np.ndarray:
        solved.append(rows.shape[0])
        return whole(self, rows)

    monkeypatch.setattr(type(operator), "row_flexibility", counted)
    found = inverse.row_flexibility(rows)
    assert solved == [2]
    np.testing.assert_allclose(found, found[0] * np.array([1.0, 1.0, 5.0]), rtol=1e-12)


def test_a_stored_zero_makes_no_rows_equal() -> None:
    rows = csr_matrix(
        (np.array([0.0, 1.0, 0.0, 2.0, 0.0, -1.0]), np.array([0, 1] * 3), np.array([0, 2, 4, 6]))
    )
    first, same = _distinct_rows(rows)
    assert (len(first), same[0] == same[1]) == (3, False)


@pytest.mark.parametrize("way", WAYS)
def test_mirrored_pieces_are_one_kind(way: LocalKind) -> None:
    straight = block((-1, 0, 0), (1, 1.2, 0.9), (4, 3, 2))
    x, y, z = straight.points.T
    mesh = straight.moved(np.column_stack([x + 0.2 * x * y * z, y + 0.1 * y * z, z + 0.1 * x**2]))
    scene = Scene({"bar": Body(mesh, STEEL)}, [Support("bar", "z0")])
    torn = build_torn_system(scene, decompose(scene, {"bar": box_partition(mesh, (2, 1, 1))}, MPI.COMM_SELF))
    inverse = DualSystem(torn, kind=way).inverse
    assert len(inverse.kinds) == 1
    require_operators_of_each(inverse)


@pytest.mark.parametrize("way", WAYS)
def test_pieces_of_which_single_components_are_held_are_one_kind_along_the_axes_alone(way: LocalKind) -> None:
    mesh = bent()
    meshes = [mesh, moved(mesh, QUARTER), moved(mesh, TURN)]
    values = [(0.0, None, None), (None, 0.0, None), (0.0, None, None)]
    named = {f"body {k}": Body(each, STEEL) for k, each in enumerate(meshes)}
    held = [Support(name, "y0", value) for name, value in zip(named, values, strict=True)]
    scene = Scene(named, [*held, *(Support(name, "x0") for name in named)])
    parts = {name: np.zeros(mesh.n_cells, dtype=int) for name in named}
    torn = build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF))
    inverse = DualSystem(torn, kind=way).inverse
    assert [len(inverse.kinds), *(kind.width for kind in inverse.kinds)] == [2, 3, 3]
    require_operators_of_each(inverse)


@pytest.mark.parametrize("way", WAYS)
def test_plane_pieces_are_turned_in_their_plane(way: LocalKind) -> None:
    straight = rectangle((0, 0), (1.0, 1.3), (3, 4))
    x, y = straight.points.T
    mesh = straight.moved(np.column_stack([x + 0.1 * x * y, y + 0.05 * x**2]))
    turned = mesh.moved(mesh.points @ IN_PLANE.T + 2.0)
    inverse = of_bodies([Body(each, PlaneStrain(210.0, 0.3)) for each in (mesh, turned)], ["x0"] * 2, way)
    assert len(inverse.kinds) == 1
    require_operators_of_each(inverse)


def wood(axes: np.ndarray) -> OrthotropicElasticity:
    return OrthotropicElasticity(
        (11000.0, 900.0, 500.0), (0.4, 0.5, 0.03), (700.0, 650.0, 90.0), tuple(map(tuple, axes.tolist()))
    )


def test_material_axes_count_with_the_shape() -> None:
    mesh, turned = bent(), moved(bent(), TURN)
    with_it = of_bodies([Body(mesh, wood(np.eye(3))), Body(turned, wood(TURN.T))], ["x0"] * 2, WAYS[1])
    assert len(with_it.kinds) == 1
    require_operators_of_each(with_it)
    left = of_bodies([Body(mesh, wood(np.eye(3))), Body(turned, wood(np.eye(3)))], ["x0"] * 2, WAYS[1])
    assert len(left.kinds) == 2
    require_operators_of_each(left)
    other = of_bodies([Body(mesh, wood(np.eye(3))), Body(mesh, wood(QUARTER))], ["x0"] * 2, WAYS[1])
    assert len(other.kinds) == 2


def _a_node_aside(body: Body) -> Body:
    points = body.mesh.points.copy()
    points[np.argmax(points.sum(axis=1)), 0] += 1e-6
    return replace(body, mesh=body.mesh.moved(points))


def _longer(body: Body) -> Body:
    return replace(body, mesh=body.mesh.moved(body.mesh.points * [1.0 + 1e-6, 1.0, 1.0]))


def _stiffer(body: Body) -> Body:
    kind: Any = type(body.material)
    return replace(body, material=kind(210.0 * (1 + 1e-6), 0.3))


def _contracting(body: Body) -> Body:
    kind: Any = type(body.material)
    return replace(body, material=kind(210.0, 0.3 + 1e-6))


@pytest.mark.parametrize("changed", [_a_node_aside, _longer, _stiffer, _contracting])
@pytest.mark.parametrize("Q", [np.eye(3), QUARTER, TURN], ids=["shifted", "quarter", "turned"])
@pytest.mark.parametrize("steel", [STEEL, OwnElasticity(210.0, 0.3)], ids=["known", "own"])
def test_what_is_alike_but_for_a_millionth_is_not_shared(
    steel: Material, Q: np.ndarray, changed: Callable[[Body], Body]
) -> None:
    body = Body(bent(), steel)
    other = replace(changed(body), mesh=moved(changed(body).mesh, Q))
    inverse = of_bodies([body, other], ["x0"] * 2, LocalKind.EXPLICIT)
    assert len(inverse.kinds) == 2
    require_operators_of_each(inverse)


def test_interfaces_elsewhere_are_other_kinds_unless_the_shape_maps_them() -> None:
    cube, brick = block((0, 0, 0), (1, 1, 1), (3, 3, 3)), block((0, 0, 0), (1, 1, 0.8), (3, 3, 3))
    for mesh, kinds in ((cube, 1), (brick, 2)):
        inverse = of_bodies([Body(mesh, STEEL)] * 3, ["x0", "y1", "z1"], LocalKind.EXPLICIT)
        assert len(inverse.kinds) == kinds
        require_operators_of_each(inverse)


def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def apart(kinds: Kinds, given: Kind) -> tuple[Kind, Placement]:
        return kinds.add(given), SAME

    monkeypatch.setattr(Kinds, "place", apart)


def test_sharing_changes_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, cut = sliding_block()
    solver = FaceNewton(tolerance=1e-11)
    shared = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=solver)
    assert shared.counts["kinds"] == len(shared.dual.inverse.kinds) <= 6
    alone(monkeypatch)
    other = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=solver)
    assert other.counts["kinds"] == 16
    assert abs(shared.counts["f_products"] - other.counts["f_products"]) <= 1
    size = np.abs(other.contact.force).max()
    np.testing.assert_allclose(shared.contact.force, other.contact.force, atol=1e-10 * size)
    displaced, expected = (state.gather_displacement("block") for state in (shared, other))
    np.testing.assert_allclose(displaced, expected, atol=1e-10 * np.abs(expected).max())
    assert size > 0.0


ON_RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact.qp import FaceNewton
    from tests.feti.scenes import sliding_block

    scene, cut = sliding_block()
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    own = MPI.COMM_WORLD.allgather(len(state.dual.inverse.kinds))
    assert state.counts["kinds"] == sum(own)
    if MPI.COMM_WORLD.rank == 0:
        order = np.argsort(state.contact.points.slave)
        print(*own, *state.contact.force[order].ravel().tolist())
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_two_ranks_have_as_many_kinds_as_one_and_all_have_the_same_answer(
    ranks: int, mpirun: Callable[..., str]
) -> None:
    words = mpirun(ON_RANKS, ranks).split()
    kinds, forces = [int(word) for word in words[:ranks]], np.array(words[ranks:], dtype=float)
    scene, cut = sliding_block()
    alone = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    expected = alone.contact.force[np.argsort(alone.contact.points.slave)].ravel()
    np.testing.assert_allclose(forces, expected, atol=1e-10 * np.abs(expected).max())
    assert alone.counts["kinds"] == sum(kinds) if ranks == 2 else sum(kinds) <= 9


def counted(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str) -> list[object]:
    """Count the calls of a method, by what they return."""
    whole, results = getattr(owner, name), list[object]()

    def method(self: Any, *given: Any) -> Any:
        results.append(whole(self, *given))
        return results[-1]

    monkeypatch.setattr(owner, name, method)
    return results


def mirrored(mesh: BodyMesh) -> BodyMesh:
    """The mesh behind a mirror, with hexahedra of positive volume."""
    cells = mesh.cells[:, [1, 0, 3, 2, 5, 4, 7, 6]]
    surfaces = {name: facets[:, ::-1] for name, facets in mesh.surfaces.items()}
    return BodyMesh(mesh.points * [-1.0, 1.0, 1.0], cells, surfaces)


def many_of_one_shape() -> list[BodyMesh]:
    turns = [Rotation.from_euler("xyz", [k, 0.3 - k, 2.0 * k]).as_matrix() for k in range(4)]
    return [moved(each, Q) for each in (bent(), renumbered(bent()), mirrored(bent())) for Q in turns]


def test_what_depends_on_the_shape_alone_is_compared_before_it_is_assembled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compared = counted(monkeypatch, Kinds, "_same_matrix")
    bodies = [Body(each, STEEL) for each in many_of_one_shape()]
    inverse = of_bodies(bodies, ["x0"] * len(bodies), LocalKind.EXPLICIT)
    assert (len(inverse.kinds), compared) == (1, [True, True])  # one sample turned, one mirrored
    require_operators_of_each(inverse)
    assert len(compared) == 2
    compared.clear()
    bodies = [replace(body, material=OwnElasticity(210.0, 0.3)) for body in bodies]
    assert len(of_bodies(bodies, ["x0"] * len(bodies), LocalKind.EXPLICIT).kinds) == 1
    assert len(compared) == len(bodies) - 1


def test_samples_that_differ_have_all_matrices_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fenics_contact.feti.subdomain.is_isotropic", lambda material: True)
    compared = counted(monkeypatch, Kinds, "_same_matrix")
    bodies = [Body(each, wood(np.eye(3))) for each in many_of_one_shape()]
    bodies += bodies[:2]
    inverse = of_bodies(bodies, ["x0"] * len(bodies), LocalKind.EXPLICIT)
    assert compared.count(False) > len(bodies)
    assert len(inverse.kinds) == 4 + 4  # renumbered ones are alike
    require_operators_of_each(inverse)


@pytest.mark.parametrize(
    ("aside", "kinds", "compared"),
    # The sample alone; matrices, which agree; matrices, which do not.
    [(1e-15, 1, [True]), (3e-13, 1, [True, True]), (1e-10, 2, [True, False])],
)
def test_matrices_decide_where_nodes_are_elsewhere_by_more_than_rounding(
    aside: float, kinds: int, compared: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Assembled, "same_as", lambda *given: None)  # each has a matrix of its own
    mesh = renumbered(bent())
    points = mesh.points.copy()
    points[np.argmax(points.sum(axis=1)), 0] += aside
    near = BodyMesh(points, mesh.cells, mesh.surfaces)
    found = counted(monkeypatch, Kinds, "_same_entries")
    bodies = [Body(moved(each, TURN), STEEL) for each in (bent(), mesh, mesh, near)]
    inverse = of_bodies(bodies, ["x0"] * 4, LocalKind.EXPLICIT)
    assert (len(inverse.kinds), found[: len(compared)]) == (kinds, compared)
    require_operators_of_each(inverse)


def test_shapes_agree_if_cells_do_and_samples_did() -> None:
    family, nodes, same = Family((), np.zeros(1), Samples()), np.array([3, 2, 1, 0, 4]), [True, False]
    cells = np.array([[0, 1, 2, 4], [0, 2, 3, 4]])
    shape, turned, other = (
        ByShape(family, each.copy) for each in (cells, nodes[cells[::-1, [2, 0, 1, 3]]], cells[[0, 0]])
    )

    def compare() -> bool:
        return same.pop(0)

    assert shape.agrees(turned, nodes, 0.0, 1.0, compare)
    assert shape.agrees(turned, nodes, 0.0, 1.0, compare)
    assert same == [False], "the second time nothing is compared"
    assert not shape.agrees(other, nodes, 0.0, 1.0, compare)
    same += [False] * 4
    assert not shape.agrees(turned, nodes, 1e-12, 1.0, compare)
    assert not shape.agrees(ByShape(Family((), np.zeros(1), Samples()), cells.copy), nodes, 0.0, 1.0, compare)
    assert not shape.agrees(turned, nodes, 0.0, -1.0, compare), "a mirror needs a sample of its own"
    assert not shape.agrees(turned, nodes, 0.0, 1.0, compare), "one that differs ends the trust"
    assert not same


def test_a_moved_subdomain_is_factored_alone_or_joins_a_kind() -> None:
    scene, cut = sliding_block()
    mesh = scene.bodies["block"].mesh
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    first = problem.solve()
    points = mesh.points.copy()
    corner = np.argmax(points @ [1.0, 2.0, 4.0])
    points[corner] += [0.02, 0.03, 0.01]
    other = replace(scene, bodies={"block": replace(scene.bodies["block"], mesh=mesh.moved(points))})
    second = problem.solve(other, start=first)
    assert second.dual.inverse.factored == 1
    third = problem.solve(scene, start=second)
    assert third.dual.inverse.factored == 0
    assert third.dual.inverse.changed
    expected = solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    size = np.abs(expected.contact.force).max()
    np.testing.assert_allclose(third.contact.force, expected.contact.force, atol=1e-9 * size)
    apart = solve_scene(other, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=1e-11))
    np.testing.assert_allclose(second.contact.force, apart.contact.force, atol=1e-9 * size)
    assert np.abs(second.contact.force - first.contact.force).max() > 1e-6 * size


@dataclass(frozen=True)
class Stiffening(Elasticity):
    """A material whose stiffness grows along x."""

    @property
    def parameters(self) -> tuple[float, ...]:
        return (210.0,)

    def stress(self, u: Any, parameters: tuple[ufl.Constant, ...]) -> Any:
        x = ufl.SpatialCoordinate(extract_unique_domain(u))[0]
        return parameters[0] * (1.0 + x) * strain(u)


def matrices(scene: Scene, boxes: tuple[int, int, int]) -> int:
    """Return how many matrices are assembled, after comparing each with the subdomain's own."""
    cut = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
    decomposition = decompose(scene, cut, MPI.COMM_SELF)
    subdomains = build_torn_system(scene, decomposition).subdomains
    for found in subdomains:
        body = scene.bodies[found.mesh.body]
        own = assemble(found.mesh, body, [], decomposition.forms, foundations=scene.foundations)
        assert abs(found.stiffness - own.stiffness).max() < 1e-12 * abs(own.stiffness).max()
        np.testing.assert_array_equal(found.kernel, own.kernel)
        np.testing.assert_array_equal(found.points, own.points)
    return len({id(each.matrix) for each in subdomains})


def test_pieces_that_differ_by_a_translation_are_assembled_once() -> None:
    bar = Body(block((0.1, 0.2, 0.3), (3.1, 1.2, 1.3), (6, 2, 2)), STEEL)
    assert matrices(Scene({"bar": bar}), (3, 1, 1)) == 1
    graded = replace(bar, mesh=bar.mesh.moved(bar.mesh.points**1.5))
    assert matrices(Scene({"bar": graded}), (3, 1, 1)) == 3
    longer = replace(bar, mesh=bar.mesh.moved(bar.mesh.points * [1.0 + 1e-9, 1.0, 1.0]))
    other = IsotropicElasticity(100.0, 0.3)
    bodies = {"bar": bar, "longer": longer, "softer": replace(bar, material=other), "again": bar}
    assert matrices(Scene(bodies), (3, 1, 1)) == 3


def test_what_depends_on_more_than_the_shape_is_assembled_for_each_piece() -> None:
    bar = Body(block((0, 0, 0), (3, 1, 1), (6, 2, 2)), STEEL)
    beds = [ElasticFoundation("bar", "x1", 3.0)]
    assert matrices(Scene({"bar": bar}, foundations=beds), (3, 1, 1)) == 3
    assert matrices(Scene({"bar": replace(bar, material=Stiffening())}), (3, 1, 1)) == 3
    halves = replace(bar.mesh, regions={"left": np.arange(12), "right": np.arange(12, 24)})
    materials = {"left": STEEL, "right": IsotropicElasticity(100.0, 0.3)}
    assert matrices(Scene({"bar": Body(halves, materials)}), (3, 1, 1)) == 3


def test_stiffnesses_that_agree_in_diagonal_trace_and_norm_alone_are_not_alike() -> None:
    """K and 2 diag K − K: entries between nodes have the other sign, and all invariants are the same."""
    random = np.random.default_rng(0)
    points, root = random.uniform(size=(5, 2)), random.uniform(0.5, 1.0, (10, 10))
    stiffness = root @ root.T
    other = 2.0 * np.diag(np.diagonal(stiffness)) - stiffness
    first, given, again = (
        Kind(_Stiff(csr_matrix(each), points), np.arange(4))  # type: ignore[arg-type]
        for each in (stiffness, other, stiffness)
    )
    np.testing.assert_allclose(given.size, first.size)
    np.testing.assert_allclose(given.marks, first.marks)
    kinds = Kinds()
    assert kinds.place(first) == (first, SAME)
    assert kinds.place(given) == (given, SAME)
    assert kinds.place(again) == (first, SAME)


@dataclass(eq=False)
class _Stiff:
    """A subdomain as far as kinds look at it."""

    stiffness: csr_matrix
    points: np.ndarray

    @property
    def mesh(self) -> _Stiff:
        return self

    @property
    def matrix(self) -> csr_matrix:
        return self.stiffness

    @property
    def shape(self) -> ByMatrix:
        return BY_MATRIX

    @property
    def components(self) -> int:
        return self.points.shape[1]

    @property
    def kernel(self) -> np.ndarray:
        return np.zeros((self.points.size, 3))
