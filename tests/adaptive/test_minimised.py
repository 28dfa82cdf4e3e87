"""A shape optimisation that starts on a coarse mesh and refines it as it converges."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AccurateDesign,
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidSphere,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    gallery,
    minimize,
    minimize_to,
)
from fenics_contact._adaptive.refined_designs import refined_design, refined_for_designs
from fenics_contact.design import (
    BundleTrust,
    LoadPath,
    MovedSurface,
    NonlinearConstraint,
    StrainEnergy,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import side_of
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import quadratic, refined
from tests.adaptive.rollers import BOX, of_ranks, shaped


@pytest.fixture(scope="module")
def found() -> AccurateDesign:
    return minimize_to(shaped(), np.zeros(4), 0.02, bounds=BOX)


def test_the_optimum_is_that_of_the_finest_mesh_alone(found: AccurateDesign) -> None:
    last = found.problems[-1]
    alone = ShapeProblem(anew(last), last.designs, StrainEnergy())
    there = minimize(alone, np.zeros(4), BundleTrust(tolerance=1e-4), bounds=BOX)
    assert found.reached
    assert found.relative_error <= 0.02
    assert abs(found.value - there.value) < found.error
    assert there.value < 0.9 * there.history[0].value  # there is something to gain
    assert found.levels[-1].products < 0.5 * alone.products
    # The start of a level is the design of the one before, which is nearly the best one already.
    starts = [each.history[0].value for each in found.optimisations]
    assert abs(starts[-1] - found.value) < 0.1 * abs(starts[0] - found.value)


def anew(problem: ShapeProblem) -> ContactProblem:
    """Return a problem of the same scene that knows nothing."""
    return ContactProblem(problem.scene, MPI.COMM_SELF, tolerance=1e-8)


def test_refinement_is_where_the_objective_needs_it(found: AccurateDesign) -> None:
    mesh = found.problems[-1].scene.bodies["block"].mesh
    sizes = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    near = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1), axis=1) < 2.0
    assert sizes[near].max() <= 0.5 * sizes[~near].max()
    assert found.state.scene.bodies["block"].mesh.n_cells == mesh.n_cells == found.levels[-1].cells


def test_levels_are_printed_with_their_designs(found: AccurateDesign) -> None:
    head, *lines, reason = str(found).splitlines()
    assert head.split() == ("cells unknowns start least error designs products seconds predicted".split())
    assert len(lines) == len(found.levels) == len(found.optimisations) > 2
    designs = [int(re.split(r"  +", line.strip())[5]) for line in lines]
    assert designs == [each.evaluations for each in found.optimisations]
    assert reason == found.reason
    assert "2 % were asked for" in reason


def test_the_method_stops_where_a_mesh_can_tell_no_more_apart(found: AccurateDesign) -> None:
    assert all(one.reason.success for one in found.optimisations)
    assert found.optimisations[0].evaluations <= 4  # on a mesh without a spot a tenth is all that counts
    assert found.error >= 0.25 * 0.02 * found.value / 2  # what the method may leave is part of it


def test_constraints_follow_the_mesh() -> None:
    made: list[ShapeProblem] = []

    def keep(problem: ShapeProblem) -> NonlinearConstraint:
        made.append(problem)
        return NonlinearConstraint(problem.volume, 99.99, 99.99)

    problem = shaped()
    found = minimize_to(problem, np.zeros(4), 0.1, bounds=BOX, constraints=keep, restore=True)
    assert tuple(made) == found.problems
    assert len(made) > 2
    assert found.problems[-1].volume(found.x)[0] == pytest.approx(99.99, abs=1e-4)
    assert problem.evaluations == 0  # the problem given is left as it is


def test_quadrilaterals_are_halved_everywhere() -> None:
    found = minimize_to(shaped("quadrilateral"), np.zeros(4), 0.2, bounds=BOX)
    meshes = [problem.scene.bodies["block"].mesh for problem in found.problems]
    assert [mesh.n_cells for mesh in meshes] == [25 * 4**k for k in range(len(meshes))]
    assert len(meshes) > 2
    assert not meshes[-1].hanging


@pytest.mark.parametrize("kind", ["triangle", "triangle6", "tetrahedron", "hexahedron"])
def test_a_design_is_the_same_function_on_a_refined_mesh(kind: str) -> None:
    if kind.startswith("tri"):
        mesh, name, net = gallery.rectangle((0, 0), (2, 1), (5, 3), "triangle"), "y0", 4
        mesh = quadratic(mesh) if kind == "triangle6" else mesh
        mesh = mesh.reshaped(mesh.points + np.outer(0.1 * mesh.points[:, 0] ** 2, [0.0, 1.0]))
    else:
        mesh, name, net = gallery.block((0, 0, 0), (4, 2, 1), (4, 3, 2), kind), "z1", (3, 2)
    coarse = SurfaceDesign("body", side_of(mesh, name), net)
    some = np.arange(mesh.n_cells)[:: 1 if kind == "hexahedron" else 3]
    refinement = refined(mesh, some)
    fine = refined_design(coarse, mesh, refinement, refinement.mesh)
    np.testing.assert_array_equal(np.sort(fine.lattice.nodes), np.unique(refinement.mesh.surfaces[name]))
    alpha = np.random.default_rng(0).uniform(-0.1, 0.1, coarse.size)
    moved = [np.zeros_like(each.points) for each in (mesh, refinement.mesh)]
    for values, design in zip(moved, (coarse, fine), strict=True):
        values[design.lattice.nodes] = design.displacement(alpha)
    # Vertices keep their numbers; the polynomial of the parameters at new ones is the same as before.
    corners = 3 if kind == "triangle6" else mesh.cells.shape[1]
    old = np.intersect1d(np.unique(mesh.cells[:, :corners]), coarse.lattice.nodes)
    assert len(old) > 3
    np.testing.assert_allclose(moved[1][old], moved[0][old], atol=1e-14)
    flat = np.ptp(mesh.points[coarse.lattice.nodes], axis=0).min() == 0.0
    if flat:  # parameters are proportional to places
        places = refinement.mesh.points[fine.lattice.nodes][:, : mesh.dim - 1]
        extent = places.max(axis=0)
        np.testing.assert_allclose(fine.lattice.parameters, places / extent, atol=1e-14)
    else:
        again = SurfaceDesign("body", side_of(refinement.mesh, name), net)
        np.testing.assert_allclose(fine.displacement(alpha), again.displacement(alpha), atol=2e-3)


def test_files_of_surfaces_need_the_grid_of_the_first_mesh() -> None:
    mesh = gallery.block((0, 0, 0), (4, 2, 1), (4, 3, 2), "tetrahedron")
    refinement = refined(mesh, (mesh.points[mesh.cells].mean(axis=1) @ [1.0, 1.0, -4.0]) < -2.0)
    design = SurfaceDesign("body", side_of(mesh, "z1"), (3, 2))
    fine = refined_design(design, mesh, refinement, refinement.mesh)
    assert len(fine.lattice.nodes) < np.prod(fine.lattice.counts)
    with pytest.raises(InvalidInputError, match="of a refined mesh take the problem on the first one"):
        MovedSurface(fine, refinement.mesh, np.zeros(6))


def test_directions_that_turn_round_between_nodes_are_refused() -> None:
    mesh = gallery.rectangle((0, 0), (2, 1), (2, 1), "triangle")
    lattice = side_of(mesh, "y0")
    turned = replace(lattice, directions=lattice.directions * np.array([[1.0], [-1.0], [1.0]]))
    refinement = refined(mesh, np.arange(mesh.n_cells))
    with pytest.raises(InvalidInputError, match="directions that turn by less than half a turn"):
        refined_design(SurfaceDesign("body", turned, 2), mesh, refinement, refinement.mesh)


def test_a_state_on_a_refined_mesh_starts_from_the_one_before() -> None:
    problem = shaped(n=10)
    x = np.array([-0.01, 0.0, 0.01, 0.02])
    coarse = problem.at(x).state
    found = refined_for_designs(problem.scene, {"block": np.arange(200)})
    (design,) = problem.designs
    fine = refined_design(
        design,
        problem.scene.bodies["block"].mesh,
        found.refinements["block"],
        found.scene.bodies["block"].mesh,
    )
    warm, cold = (problem.on(problem.contact.on(found.scene), (fine,)) for _ in range(2))
    state = warm.begin(x, coarse, found.refinements)
    value = warm.value_of(x)
    assert value == pytest.approx(cold.value_of(x), rel=1e-7)
    assert state.solution.products <= 13 < cold.products  # of 18: cold starts come to rest first
    # A body that is moved by its design, but not refined, has the cells that it had.
    same = problem.on(problem.contact.on(problem.scene), problem.designs)
    assert same.begin(x, coarse, {}).solution.products < 10


def wrong(name: str) -> tuple[Any, dict[str, Any]]:
    """Return a problem and arguments that are refused."""
    problem = shaped()
    if name == "path":
        return LoadPath(problem, [LoadStep("push")]), {}
    if name == "rubber":
        mesh = gallery.rectangle((0, 0), (1, 1), (2, 2), "triangle")
        scene = Scene({"block": Body(mesh, NeoHooke(1.0, 0.3))}, [Support("block", "y1")])
        contact = ContactProblem(scene, MPI.COMM_SELF)
        return ShapeProblem(contact, SurfaceDesign("block", "y0", net=3), StrainEnergy()), {}
    if name == "constraint":
        return problem, {"constraints": [NonlinearConstraint(problem.volume, 100.0)]}
    return problem, {"relative_error": 1.0}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("path", "minimize_to needs a ShapeProblem, got LoadPath: give the problem of one load case"),
        ("rubber", "minimize_to needs linear materials, as errors"),
        ("constraint", "nonlinear constraints must follow the mesh, got one of the first mesh: give a func"),
        ("accuracy", "relative_error must lie between 0 and 1, got 1: 0.01 asks"),
    ],
)
def test_what_cannot_follow_the_mesh_is_refused(name: str, message: str) -> None:
    problem, more = wrong(name)
    given = {"relative_error": 0.1, **more}
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        minimize_to(problem, np.zeros(problem.size), **given)


SCRIPT = """
import numpy as np
from mpi4py import MPI
from tests.adaptive.rollers import of_ranks
print(of_ranks(MPI.COMM_WORLD))
"""


def test_ranks_find_the_same_design_on_the_same_meshes(mpirun) -> None:
    assert mpirun(SCRIPT, 2).strip() == of_ranks(MPI.COMM_SELF)


@pytest.mark.slow
def test_tetrahedra_are_optimised_with_less_work_than_on_the_finest_mesh_alone() -> None:
    mesh = gallery.block((0, 0, 0), (10, 10, 10), (4, 4, 3), "tetrahedron")
    scene = Scene(
        bodies={"block": Body(mesh, IsotropicElasticity(2.1e5, 0.3))},
        supports=[Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))],
        loads=[TotalForce("block", "z1", (0.0, 0.0, -8000.0))],
        contacts=[ContactPair(Surface("block", "z0"), RigidSphere((0, 0, -60.0), 60.0))],
    )
    contact = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-7)
    problem = ShapeProblem(contact, SurfaceDesign("block", "z0", net=(3, 3)), StrainEnergy())
    found = minimize_to(problem, np.zeros(9), 0.05, bounds=(-0.05, 0.05))
    alone = ShapeProblem(anew(found.problems[-1]), found.problems[-1].designs, StrainEnergy())
    there = minimize(alone, np.zeros(9), BundleTrust(tolerance=6e-3), bounds=(-0.05, 0.05))
    assert found.reached
    assert abs(found.value - there.value) < found.error
    assert found.levels[-1].products < 0.4 * alone.products
    assert sum(level.products for level in found.levels) < alone.products
