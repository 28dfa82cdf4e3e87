"""Linear constraints hold what their equations say, with forces in proportion to their factors."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import (
    Body,
    ConstraintTerm,
    ContactPair,
    ContactProblem,
    LinearConstraint,
    LoadStep,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    box_partition,
    read_scene_file,
    solve_scene,
    solve_steps,
    write_result,
)
from fenics_contact._adaptive.refined_scene import refine_scene
from fenics_contact._scene.constraints import with_values
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.constraints import ConstraintRows, independent_rows
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, StVenantKirchhoff
from fenics_contact.materials.elastic import lame
from fenics_contact.output import StepTable, read_result

STEEL = IsotropicElasticity(2.1e3, 0.3)
ROW = IsotropicElasticity(2.1e3, 0.0)


def with_corner(mesh, at=(0.0, 0.0, 0.0)):
    """The mesh with a node set of one node."""
    node = int(np.argmin(np.linalg.norm(mesh.points - np.array(at), axis=1)))
    return replace(mesh, node_sets={**mesh.node_sets, "corner": np.array([node])})


def periodic(gradient: np.ndarray) -> list[LinearConstraint]:
    """Opposite sides of a unit cell move alike but for a mean gradient of displacement."""
    return [
        LinearConstraint(
            [ConstraintTerm("cell", f"{a}1", c), ConstraintTerm("cell", f"{a}0", c, -1.0)],
            float(gradient[i, j]),
            f"{c}{a}",
            "translation",
        )
        for j, a in enumerate("xyz")
        for i, c in enumerate("xyz")
    ]


def cell(material, gradient: np.ndarray, cells=(3, 3, 4), shape: str = "hexahedron") -> Scene:
    mesh = with_corner(block((0, 0, 0), (1, 1, 1), cells, shape))
    if isinstance(material, dict):
        low = mesh.points[mesh.cells].mean(axis=1)[:, 2] < 0.5
        mesh = replace(mesh, regions={"low": np.flatnonzero(low), "high": np.flatnonzero(~low)})
    held = [Support("cell", "corner")]
    return Scene({"cell": Body(mesh, material)}, held, constraints=periodic(gradient))


@pytest.mark.parametrize("shape", ["hexahedron", "tetrahedron"])
def test_a_periodic_cell_of_one_material_strains_evenly(shape: str, caplog: pytest.LogCaptureFixture) -> None:
    """Patch test: u = H x, and the forces across the sides are those of the stress."""
    gradient = np.array([[0.01, 0.004, 0.0], [0.0, -0.002, 0.003], [0.0, 0.0, 0.005]])
    scene = cell(STEEL, gradient, shape=shape)
    parts = {"cell": box_partition(scene.bodies["cell"].mesh, (2, 1, 2))}
    with caplog.at_level(logging.INFO, "fenics_contact"):
        state = ContactProblem(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-11).solve()
    points = scene.bodies["cell"].mesh.points
    np.testing.assert_allclose(state.gather_displacement("cell"), points @ gradient.T, atol=1e-11)
    strain, (first, second) = 0.5 * (gradient + gradient.T), lame(2.1e3, 0.3)
    stress = first * np.trace(strain) * np.eye(3) + 2.0 * second * strain
    forces = state.constraints()
    drawn = np.array([[forces[f"{c}{a}"].force.sum() for a in "xyz"] for c in "xyz"])
    np.testing.assert_allclose(drawn, stress, atol=1e-8 * np.abs(stress).max())
    assert all(np.abs(each.on_bodies["cell"]).max() < 1e-9 for each in forces.values())
    assert state.balance().imbalance < 1e-10
    # As many equations are independent as nodes less those of a torus of 3 × 3 × 4 cells have components.
    every, needed = 3 * (2 * 4 * 5 + 4 * 4), 3 * (4 * 4 * 5 - 3 * 3 * 4)
    assert f"{every - needed} of {every} equations of linear constraints follow from others" in caplog.text


def test_the_stiffness_of_layers_is_that_of_backus() -> None:
    """Two layers of half the height: u is linear in each, and the mean stress known.

    G. E. Backus, *Long-wave elastic anisotropy produced by horizontal layering*, J. Geophys. Res. 67 (1962).
    """
    layers = {"low": IsotropicElasticity(1000.0, 0.2), "high": IsotropicElasticity(4000.0, 0.35)}
    constants = np.array([lame(1000.0, 0.2), lame(4000.0, 0.35)])
    first, second = constants.T
    whole = first + 2.0 * second
    along = 1.0 / np.mean(1.0 / whole)
    beside = along * np.mean(first / whole)
    shear = 1.0 / np.mean(1.0 / second)
    for gradient, exact in (
        (np.diag([0.0, 0.0, 0.01]), np.diag([beside, beside, along])),
        (0.005 * np.eye(3)[:, [0]] @ np.eye(3)[[2]] * 2.0, shear * (np.eye(3)[:, [0]] @ np.eye(3)[[2]])),
    ):
        state = solve_scene(cell(layers, gradient), MPI.COMM_SELF, tolerance=1e-11)
        forces = state.constraints()
        drawn = np.array([[forces[f"{c}{a}"].force.sum() for a in "xyz"] for c in "xyz"])
        exact = np.triu(exact) + np.triu(exact, 1).T
        np.testing.assert_allclose(drawn, 0.01 * exact, atol=1e-8 * 0.01 * np.abs(exact).max())


def rods(constraint: LinearConstraint, material=ROW, loads=()) -> Scene:
    """Two rods along x, 4 long and 1 across, each held at its left end."""
    bodies = {
        name: Body(with_corner(block((0, y, 0), (4, y + 1, 1), (4, 1, 1)), (4.0, y, 0.0)), material)
        for name, y in (("a", 0.0), ("b", 3.0))
    }
    held = [Support(name, "x0") for name in bodies]
    return Scene(bodies, held, loads, constraints=[constraint])


def test_equations_hold_on_when_supports_change() -> None:
    """Several equations, of which each has a row, and a support that a later load step takes away."""
    ends = [ConstraintTerm("a", "x1", "x"), ConstraintTerm("b", "x1", "x", -1.0)]
    pull = [Traction("a", "x1", (2.0, 0.0, 0.0))]
    scene = rods(LinearConstraint(ends, 0.01, "ends", "translation"), loads=pull)
    aside = [*scene.supports, Support("b", "x1", (None, 0.1, None))]
    steps = [LoadStep("aside", pull, supports=aside), LoadStep("released", pull, supports=scene.supports)]
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-11), steps)
    alone = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    assert np.abs(states[0].gather_displacement("b")[:, 1]).max() == pytest.approx(0.1)
    for name in scene.bodies:
        found, wanted = (state.gather_displacement(name) for state in (states[1], alone))
        np.testing.assert_allclose(found, wanted, atol=1e-8 * np.abs(wanted).max())
    force = alone.constraints()["ends"].force
    assert len(force) == 4
    np.testing.assert_allclose(states[1].constraints()["ends"].force, force, rtol=1e-6)


def gear() -> list[ConstraintTerm]:
    """The end of a moves twice as far as that of b."""
    a = ConstraintTerm("a", "x1", "x", 0.25, equation=0)
    return [a, ConstraintTerm("b", "x1", "x", -0.5, equation=0)]


def test_a_lever_between_bodies_shares_a_load_as_its_arms_say() -> None:
    """u_a = 2 u_b of two rods k: P = k u_a + F, 2 F = k u_b, with the energy of a."""
    stiffness, load = 2.1e3 / 4.0, 10.0
    pull = [Traction("a", "x1", (load, 0.0, 0.0))]
    state = solve_scene(
        rods(LinearConstraint(gear(), name="lever"), loads=pull), MPI.COMM_SELF, tolerance=1e-11
    )
    moved = [state.gather_displacement(name)[:, 0].max() for name in "ab"]
    np.testing.assert_allclose(moved, load / (stiffness * 1.25) * np.array([1.0, 0.5]), rtol=1e-8)
    held = state.constraints()["lever"]
    np.testing.assert_allclose(held.force, [-stiffness * moved[1] / 2.0], rtol=1e-8)
    np.testing.assert_allclose(held.on_bodies["a"], held.force * [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(held.on_bodies["b"], -2.0 * held.force * [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(state.balance().gaps.force, -held.force * [1.0, 0.0, 0.0], atol=1e-9)
    assert state.balance().imbalance < 1e-10
    assert "lever" in str(state.constraints())


@pytest.mark.parametrize("material", [ROW, StVenantKirchhoff(2.1e3, 0.0)], ids=["small", "large"])
def test_load_steps_change_values(material) -> None:
    """Both ends are drawn apart by a constraint alone; equations stay linear where bodies deform much."""
    scene = rods(LinearConstraint(gear(), name="gap"), material)
    steps = [LoadStep(f"{value}", constraints={"gap": value}) for value in (0.2, -0.1)]
    states = list(solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), steps))
    for state, value in zip(states, (0.2, -0.1), strict=True):
        a, b = (state.gather_displacement(name)[scene.bodies[name].mesh.nodes_of("x1"), 0] for name in "ab")
        assert a.mean() - 2.0 * b.mean() == pytest.approx(value, rel=1e-7)
        held = state.constraints()["gap"]
        assert held.on_bodies["b"][0] == pytest.approx(-2.0 * held.on_bodies["a"][0], rel=1e-9)
        assert state.balance().imbalance < 1e-7
        if material is ROW:
            assert held.force[0] == pytest.approx(2.1e3 / 4.0 * value / 5.0, rel=1e-7)


def test_many_nodes_follow_one_and_their_rows_stay_sparse() -> None:
    """An end that stays plane: each of its nodes moves along x as a corner does."""
    mesh = with_corner(block((0, 0, 0), (2, 1, 1), (2, 7, 7)), (2.0, 0.0, 0.0))
    follow = [ConstraintTerm("a", "x1", "x"), ConstraintTerm("a", "corner", "x", -1.0)]
    pull = [Traction("a", "x1", (lambda p: np.column_stack([10.0 * p[:, 1], *np.zeros((2, len(p)))])))]
    scene = Scene(
        {"a": Body(mesh, STEEL)}, [Support("a", "x0")], pull, constraints=[LinearConstraint(follow)]
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    moved = state.gather_displacement("a")[mesh.nodes_of("x1")]
    assert np.ptp(moved[:, 1]) > 1e-4
    assert np.ptp(moved[:, 0]) < 1e-9 * np.abs(moved[:, 0]).max()
    (rows,) = state.torn.groups.of(ConstraintRows)
    assert rows.count == 8 * 8 - 1
    assert rows.left_out == 1  # that of the corner itself, which cancels
    gram = rows.free @ rows.free.T
    assert gram.nnz <= 4 * rows.count
    force = state.constraints()["a x1 and a corner"]
    np.testing.assert_allclose(force.on_bodies["a"], 0.0, atol=1e-9)
    assert np.abs(force.force).max() > 0.05


def test_equations_along_directions_of_nodes_hold_with_contact_and_supports_across() -> None:
    """A block that a plane stops, whose end nodes slide along an inclined plane by equations."""
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    nodes = mesh.nodes_of("x1")
    slope = np.array([[1.0, 0.0, 0.5]])
    slide = LinearConstraint([ConstraintTerm("a", nodes, np.repeat(slope, len(nodes), axis=0))])
    contact = [ContactPair(Surface("a", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))]
    held = [Support("a", "x0", (0.0, 0.0, None))]
    scene = Scene(
        {"a": Body(mesh, STEEL)}, held, [Traction("a", "z1", (0.0, 0.0, -20.0))], contact, constraints=[slide]
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    moved = state.gather_displacement("a")[nodes]
    np.testing.assert_allclose(moved @ slope[0], 0.0, atol=1e-12)
    assert np.abs(moved).max() > 1e-4
    held_by = state.constraints()["9 nodes of a"].on_bodies["a"]
    np.testing.assert_allclose(held_by, held_by[0] * slope[0], rtol=1e-9, atol=1e-12)
    assert held_by[0] < -1.0
    assert state.balance().imbalance < 1e-9


def test_what_a_rigid_surface_moves_is_part_of_equations() -> None:
    """A free rigid end of a moves the end of b, as one equation says."""
    scene = rods(LinearConstraint(gear(), name="lever"))
    rigid = RigidSurface("a", "x1", (4, 0.5, 0.5), (None, 0.0, 0.0), (0.0, 0.0, 0.0), force=(10.0, 0.0, 0.0))
    scene = replace(scene, supports=[*scene.supports, rigid])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    moved = [state.gather_displacement(name)[:, 0].max() for name in "ab"]
    np.testing.assert_allclose(moved, 10.0 / (2.1e3 / 4.0 * 1.25) * np.array([1.0, 0.5]), rtol=1e-8)


def test_equations_that_contradict_are_refused_and_those_that_follow_are_left_out() -> None:
    end = ConstraintTerm("a", "corner", "x")
    both = [LinearConstraint([end], 0.01, "one"), LinearConstraint([end], 0.02, "two")]
    scene = rods(both[0])
    with pytest.raises(
        InfeasibleError, match=r"LinearConstraint '(one|two)' contradicts others or supports by 0.01"
    ):
        solve_scene(replace(scene, constraints=both), MPI.COMM_SELF)
    at_support = LinearConstraint([ConstraintTerm("a", "x0", "x", equation=0)], 0.3, "held")
    with pytest.raises(
        InfeasibleError, match=r"LinearConstraint 'held' contradicts others or supports by 0.3"
    ):
        solve_scene(replace(scene, constraints=[at_support]), MPI.COMM_SELF)
    agreed = [both[0], both[0].with_value(0.01), at_support.with_value(0.0)]
    state = solve_scene(replace(scene, constraints=agreed), MPI.COMM_SELF, tolerance=1e-10)
    (rows,) = state.torn.groups.of(ConstraintRows)
    assert rows.left_out == 2
    forces = [float(each.force[0]) for each in state.constraints().values()]
    assert sorted(map(abs, forces))[:2] == [0.0, 0.0]
    assert max(map(abs, forces)) > 0.5
    # What other equations make of one may have other values in a load step.
    with pytest.raises(InfeasibleError, match="contradicts others or supports by"):
        solve_scene(LoadStep("far", constraints={"held": 0.5}).applied_to(state.scene), MPI.COMM_SELF)


def test_dependent_rows_are_found_whatever_their_order_and_size() -> None:
    rng = np.random.default_rng(0)
    base = sp.random(40, 200, 0.03, random_state=1, format="csr") + sp.eye(40, 200, format="csr")
    mixed = sp.csr_matrix(rng.normal(size=(5, 40)) * (rng.random((5, 40)) < 0.1)) @ base
    rows = sp.vstack([base[:20], mixed, base[20:]]).tocsr()
    rows = rows[rng.permutation(45)]
    rows = (sp.diags(1.0 / np.sqrt(rows.multiply(rows).sum(axis=1)).A1) @ rows).tocsr()
    kept, made = independent_rows(rows)
    assert kept.sum() == 40
    np.testing.assert_allclose((made @ rows[kept] - rows[~kept]).toarray(), 0.0, atol=1e-10)
    assert np.linalg.matrix_rank(rows[kept].toarray()) == 40


def test_a_constraint_alone_holds_a_body_as_far_as_it_can() -> None:
    free = replace(rods(LinearConstraint(gear())), supports=[Support("a", "x0")])
    loaded = replace(free, loads=[TotalForce("b", "x1", (0.0, 1.0, 0.0))])
    with pytest.raises(InfeasibleError, match="body 'b' can move away"):
        solve_scene(loaded, MPI.COMM_SELF)
    guide = [Support("b", "y0", (None, 0.0, None)), Support("b", "z0", (None, None, 0.0))]
    drawn = replace(free, supports=[*free.supports, *guide], loads=[TotalForce("b", "x1", (4.0, 0.0, 0.0))])
    state = solve_scene(drawn, MPI.COMM_SELF, tolerance=1e-10)
    assert state.constraints()["a x1 and b x1"].on_bodies["b"][0] == pytest.approx(-4.0, rel=1e-8)


def test_partners_are_found_in_any_order_of_the_nodes() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 2, 2))
    left, right = (np.unique(mesh.surfaces[side]) for side in ("x0", "x1"))
    terms = [ConstraintTerm("a", left, "x"), ConstraintTerm("a", right[::-1], "x", -1.0)]
    body = Body(mesh, STEEL)
    first, other = LinearConstraint(terms, paired="translation").entries({"a": body})
    across = mesh.points[other.nodes] - mesh.points[first.nodes]
    np.testing.assert_allclose(across, np.tile([2.0, 0.0, 0.0], (len(left), 1)), atol=1e-14)


RANKS = """
    from mpi4py import MPI
    import numpy as np
    from fenics_contact import Body, ConstraintTerm, ContactPair, LinearConstraint, RigidPlane, Scene, Support
    from fenics_contact import Surface, Traction, box_partition, solve_scene
    from fenics_contact.gallery import block
    from fenics_contact.materials import IsotropicElasticity

    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 3))
    sides = [ConstraintTerm("a", "y1", "y"), ConstraintTerm("a", "y0", "y", -1.0)]
    across = [ConstraintTerm("a", "y1", "x"), ConstraintTerm("a", "y0", "x", -1.0)]
    constraints = [LinearConstraint(sides, 0.0, "y", "translation"),
                   LinearConstraint(across, 0.0, "x", "translation"),
                   LinearConstraint([ConstraintTerm("a", "x1", "z", (0.1), equation=0)], -0.002, "mean")]
    scene = Scene({"a": Body(mesh, IsotropicElasticity(2.1e3, 0.3))}, [Support("a", "x0", (0.0, 0.0, None))],
                  [Traction("a", "z1", (1.0, 0.0, -20.0))],
                  [ContactPair(Surface("a", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))],
                  constraints=constraints)

    def found(comm, parts=None):
        state = solve_scene(scene, comm, partitions=parts, tolerance=1e-11)
        forces = [each.force.sum() for each in state.constraints().values()]
        return [*map(float, forces), float(state.gather_displacement("a").max())]

    parts = {"a": box_partition(mesh, (2, 1, 2))}
    torn, whole = found(MPI.COMM_WORLD, parts), found(MPI.COMM_SELF)
    if MPI.COMM_WORLD.rank == 0:
        print(repr((torn, whole)))
"""


def test_ranks_and_subdomains_find_the_same_forces(mpirun) -> None:
    every = [eval(mpirun(RANKS, ranks)) for ranks in (1, 2)]
    assert np.abs(every[0][1])[[0, 2, 3]].min() > 1e-4
    for torn, whole in every:
        np.testing.assert_allclose(torn, whole, rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(whole, every[0][1], rtol=1e-12, atol=1e-12)


def test_results_and_tables_have_the_forces(tmp_path) -> None:
    scene = rods(LinearConstraint(gear(), name="lever"), loads=[Traction("a", "x1", (10.0, 0.0, 0.0))])
    state = solve_scene(scene, MPI.COMM_SELF)
    record = read_result(write_result(state, tmp_path))
    (entry,) = record["forces"]["constraints"]
    held = state.constraints()["lever"]
    assert (entry["name"], entry["equations"]) == ("lever", 1)
    assert entry["bodies"][1]["force"] == pytest.approx(held.on_bodies["b"].tolist())
    table = StepTable(tmp_path / "steps.csv", MPI.COMM_SELF)
    assert "constraint lever a Fx" in table.add(state).read_text()


SCENE_FILE = """
[meshes.rod]
shape = "block"
lower = [0, 0, 0]
upper = [4, 1, 1]
counts = [4, 1, 1]
[materials.steel]
model = "isotropic"
young_modulus = 2100.0
poisson_ratio = 0.0
[bodies.a]
mesh = "rod"
material = "steel"
[[supports]]
body = "a"
surface = "x0"
value = [0, 0, 0]
[[constraints]]
name = "drawn"
terms = [
    { body = "a", nodes = "x1", direction = "x", factor = 0.5, equation = 0 },
    { body = "a", nodes = [0], direction = [0.0, 1.0, 0.0] },
]
[[steps]]
name = "out"
count = 2
constraints = { drawn = 0.2 }
"""


def test_a_scene_file_has_constraints_whose_values_steps_change(tmp_path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_FILE)
    found = read_scene_file(path, MPI.COMM_SELF)
    state = found.solve()
    nodes = found.scene.bodies["a"].mesh.nodes_of("x1")
    np.testing.assert_allclose(state.gather_displacement("a")[nodes, 0], 0.1, rtol=1e-6)
    assert [step.constraints for step in found.steps] == [{"drawn": 0.1}, {"drawn": 0.2}]
    path.write_text(SCENE_FILE.replace("{ drawn = 0.2 }", "{ drwn = 0.2 }"))
    with pytest.raises(InvalidInputError, match="must be the name of a constraint, one of 'drawn'"):
        read_scene_file(path, MPI.COMM_SELF).scene


END = ConstraintTerm("a", "corner", "x")


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: ConstraintTerm("a", [0.5], "x"), "nodes must be the name of a node set or numbers"),
        (lambda: ConstraintTerm("a", "x1", "r"), "direction must be finite numbers"),
        (lambda: ConstraintTerm("a", "x1", (0.0, 0.0, 0.0)), "direction must not be zero"),
        (lambda: ConstraintTerm("a", "x1", "x", 0.0), "factor must not be zero"),
        (lambda: ConstraintTerm("a", [1, 2], "x", [1.0, 2.0, 3.0]), "must have one entry for each node"),
        (lambda: ConstraintTerm("a", "x1", "x", equation=-1), "must count from 0"),
        (lambda: LinearConstraint([]), "needs terms, got none"),
        (lambda: LinearConstraint([END], np.nan), "must be a finite number, or one for each equation"),
        (lambda: rods(LinearConstraint([END, ConstraintTerm("c", "x1", "x")])), "names body 'c'"),
        (lambda: rods(LinearConstraint([ConstraintTerm("a", "end", "x")])), "names nodes 'end' of body 'a'"),
        (lambda: rods(LinearConstraint([ConstraintTerm("a", [99], "x")])), "must lie between 0 and 19"),
        (lambda: rods(LinearConstraint([ConstraintTerm("a", "x1", (1.0, 0.0))])), "must be in 3 dimensions"),
        (
            lambda: rods(LinearConstraint([ConstraintTerm("a", "x1", "x"), ConstraintTerm("b", "y0", "x")])),
            "must have as many nodes as each other, or one, got 4 and 10",
        ),
        (
            lambda: rods(
                LinearConstraint(
                    [ConstraintTerm("a", [0, 1], "x"), ConstraintTerm("a", [0, 4], "x")],
                    paired="translation",
                )
            ),
            "needs partners of all translated nodes",
        ),
        (
            lambda: LoadStep("far", constraints={"end": 1.0}).applied_to(rods(LinearConstraint([END]))),
            r"LoadStep.constraints names 'end', the scene has \['a corner'\]",
        ),
        (
            lambda: solve_scene(rods(LinearConstraint([END], [1.0, 2.0])), MPI.COMM_SELF),
            "has 1 equation, got 2 values",
        ),
        (
            lambda: refine_scene(rods(LinearConstraint([ConstraintTerm("a", [0], "x")])), {"a": [0]}),
            "cannot be refined, as numbers and order of nodes",
        ),
    ],
)
def test_what_does_not_fit_is_refused(made, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


def test_equal_terms_are_equal() -> None:
    one, other = (ConstraintTerm("a", [0, 1], "x", [1.0, 2.0]) for _ in range(2))
    assert one == other
    assert hash(one) == hash(other)
    assert one != ConstraintTerm("a", [0, 1], "x", [1.0, 3.0])
    assert LinearConstraint([one]) == LinearConstraint([other])
    changed = with_values([LinearConstraint([one], name="n")], {"n": 2.0})
    assert changed[0].key == LinearConstraint([other]).key


def test_factors_that_differ_by_orders_all_hold() -> None:
    """Many nodes follow one, some with factors of 1e-10: no equation is lost in one of its neighbours."""
    mesh = block((0, 0, 0), (4, 1, 1), (4, 3, 3))
    top = np.flatnonzero(mesh.points[:, 2] == 1.0)
    leader, *others = top[np.argsort(-mesh.points[top, 0], kind="stable")].tolist()
    factor = np.where(np.arange(len(others)) % 2, 1.0, 1e-10)
    terms = [
        ConstraintTerm("bar", others, "z", 1.0, np.arange(len(others))),
        ConstraintTerm("bar", np.full(len(others), leader), "z", -factor, np.arange(len(others))),
    ]
    scene = Scene(
        {"bar": Body(mesh, STEEL)},
        [Support("bar", "z0", (0.0, 0.0, 0.0))],
        [Traction("bar", "z1", (0.0, 0.0, 3.0))],
        constraints=[LinearConstraint(terms)],
    )
    moved = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10).gather_displacement("bar")[:, 2]
    assert moved[leader] > 1e-4
    np.testing.assert_allclose(moved[others], factor * moved[leader], rtol=0.0, atol=1e-9 * moved[leader])
