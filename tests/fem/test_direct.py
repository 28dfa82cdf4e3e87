"""Direct solves of bodies without contact, supported or not, in any units."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, RigidSurface, Scene, State, Support, Traction, box_partition, solve_scene
from fenics_contact._equilibrium.linear import default_solver
from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton, ProjectedCG, Smalse
from tests.conftest import run_on_ranks
from tests.fem.scenes import BOXES, TOLERANCE, cut, error, loaded_block, two_materials
from tests.feti.scenes import CELLS, STEEL, clamped_block
from tests.scenes import Load


def cantilever(length: float, cells: int) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (length, 1.0, 1.0), (cells, 2, 2))
    body = Body(mesh, IsotropicElasticity(100.0, 0.3))
    return Scene({"beam": body}, [Support("beam", "x0")], [Traction("beam", "x1", (0.0, 0.0, 1e-6))])


def test_a_slender_beam_is_solved_to_what_double_precision_allows() -> None:
    state = solve_scene(cantilever(100.0, 40), MPI.COMM_SELF)

    assert isinstance(state.system, DirectSystem)
    (part,) = state.torn.subdomains
    free = np.setdiff1d(np.arange(part.mesh.size), state.torn.B.indices)
    dense = np.linalg.solve(part.stiffness[free][:, free].toarray(), part.load[free])
    np.testing.assert_allclose(state.torn_displacement[free], dense, atol=1e-6 * np.abs(dense).max())
    assert state.estimate_errors().algebraic < 1e-7


def test_an_answer_that_is_rounding_is_refused() -> None:
    with pytest.raises(ConvergenceError, match=r"must have an error below 0.0001 .* less slender"):
        solve_scene(cantilever(1e5, 40), MPI.COMM_SELF)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.1), (1e3, 2.0)])
@pytest.mark.parametrize("angle", [0.1, 0.2, 0.3])
def test_a_body_that_is_only_moved_has_no_energy_but_rounding(
    angle: float, shift: tuple[float, float]
) -> None:
    """Which may be negative, and says nothing of how slender it is."""
    plate = rectangle((0.0, 0.0), (1.0, 1.0), (7, 7))
    turned = RigidSurface("plate", "y0", (0.0, 0.0), shift, angle)
    state = solve_scene(Scene({"plate": Body(plate, PlaneStrain(1.0, 0.3))}, [turned]), MPI.COMM_SELF)
    exact = np.array(shift) + angle * plate.points[:, ::-1] * (-1.0, 1.0)
    found = state.gather_displacement("plate")
    assert np.abs(found - exact).max() < 1e-13 * np.abs(exact).max()


def test_a_damaged_factor_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = DirectSystem.__init__

    def damaged(self: DirectSystem, *args: object, **kwargs: object) -> None:
        whole(self, *args, **kwargs)
        solve = self._factor.solve

        def wrong(right: np.ndarray, out: np.ndarray) -> None:
            solve(right, out)
            out *= 0.7

        self._factor.solve = wrong

    monkeypatch.setattr(DirectSystem, "__init__", damaged)
    with pytest.raises(ConvergenceError, match="must have an error below"):
        solve_scene(cantilever(3.0, 5), MPI.COMM_SELF)


def test_a_body_of_which_every_node_is_prescribed_has_reactions() -> None:
    plate = Body(rectangle((0.0, 0.0), (1.0, 1.0), (1, 1)), PlaneStrain(1000.0, 0.0))
    stretched = (lambda x: 0.01 * x[:, 0], 0.0)
    scene = Scene({"plate": plate}, [Support("plate", side, stretched) for side in ("y0", "y1")])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert isinstance(state.system, DirectSystem)
    assert state.energies.strain == pytest.approx(0.5 * 1000.0 * 0.01**2)
    np.testing.assert_allclose(state.gather_stress("plate")[:, 0, 0], 10.0)
    assert state.estimate_errors().algebraic == 0.0
    assert state.balance().imbalance < 1e-12


# The Dirichlet preconditioner keeps the number of iterations bounded while subdomains are added.
LAYERS = 4  # cells along the edge of a subdomain, H/h


@pytest.mark.parametrize("cell", CELLS)
def test_iterations_are_bounded_as_subdomains_are_added(cell: str) -> None:
    counts = {}
    for n in (2, 3, 4):
        scene, partitions = clamped_block(cell, (n, n, n), LAYERS)
        state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10)
        assert state.solution.residuals.gluing < 1e-10
        counts[n**3] = state.solution.products
    sys.stdout.write(f"\n{cell}, H/h = {LAYERS}: iterations by number of subdomains {counts}\n")
    assert counts[64] <= 1.3 * counts[8]
    assert 5 < counts[64] < 40


# Bodies that nothing holds are refused where the load would move them, and only there.
def bars(*loads: Load, supports: tuple[Support, ...] = ()) -> State:
    """Two bars of two subdomains each, side by side; the left one is clamped unless supports are given."""
    meshes = {name: block((x, 0, 0), (x + 1, 1, 4), (2, 2, 4)) for name, x in (("left", 0), ("right", 3))}
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        supports or (Support("left", "z0"),),
        loads,
    )
    cuts = {name: box_partition(mesh, (1, 1, 2)) for name, mesh in meshes.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance=1e-10)


def test_a_loaded_body_without_support_is_refused_by_name() -> None:
    message = (
        r"every body must be held by supports, contact or friction, but body 'right' can move away under the "
        r"load: translation \(.*, 1\) .*meets no resistance. Support it, or let it touch something"
    )
    with pytest.raises(InfeasibleError, match=message):
        bars(Traction("left", "z1", (1.0, 0.0, 0.0)), Traction("right", "z1", (0.0, 0.0, 1.0)))


def test_a_support_that_leaves_the_loaded_direction_free_is_not_enough() -> None:
    supports = (Support("left", "z0"), Support("right", "z0", (None, None, 0.0)))
    with pytest.raises(
        InfeasibleError, match=r"body 'right' can move away under the load: translation \((-?0|1)"
    ):
        bars(Traction("right", "x1", (1.0, 0.0, 0.0)), supports=supports)


def test_a_body_without_support_and_load_stays_free_of_stress() -> None:
    state = bars(Traction("left", "z1", (1.0, 0.0, 0.5)))
    assert state.von_mises["left"].x.array.max() > 0.1
    assert np.abs(state.von_mises["right"].x.array).max() < 1e-8


def test_a_scene_without_a_single_multiplier_is_solved() -> None:
    mesh = block((0, 0, 0), (1, 1, 4), (2, 2, 4), "tetrahedron")
    loads = [Traction("bar", "z1", (0.0, 0.0, 1.3)), Traction("bar", "z0", (0.0, 0.0, -1.3))]
    scene = Scene({"bar": Body(mesh, STEEL)}, loads=loads)
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions={"bar": np.zeros(mesh.n_cells, dtype=int)}, tolerance=1e-10
    )
    assert state.counts["equality_multipliers"] == 0
    np.testing.assert_allclose(state.von_mises["bar"].x.array, 1.3, rtol=1e-9)


def test_loads_in_balance_need_no_support() -> None:
    pull = 7.0
    state = bars(Traction("right", "z1", (0.0, 0.0, pull)), Traction("right", "z0", (0.0, 0.0, -pull)))
    np.testing.assert_allclose(state.von_mises["right"].x.array, pull, rtol=1e-7)
    assert state.energies.strain == pytest.approx(0.5 * pull**2 / STEEL.young_modulus * 4.0, rel=1e-8)


# Without contact, Total FETI finds the displacement that one big direct solve finds.
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("subdomains", BOXES)
def test_the_displacement_is_that_of_a_monolithic_solve(cell: str, subdomains: int) -> None:
    scene = loaded_block(cell)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, subdomains), tolerance=1e-10)
    assert state.counts["subdomains"] == subdomains
    assert error(state, "block") < TOLERANCE


@pytest.mark.parametrize("cell", CELLS)
def test_ragged_subdomains_find_it_too(cell: str) -> None:
    scene = loaded_block(cell)
    state = solve_scene(
        scene,
        MPI.COMM_SELF,
        partitions={"block": bisection_partition(scene.bodies["block"].mesh, 11)},
        tolerance=1e-10,
    )
    assert error(state, "block") < TOLERANCE


def test_prescribed_displacements_are_met() -> None:
    given = (0.01, -0.02, 0.05)
    scene = loaded_block("hexahedron", given)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert error(state, "block") < TOLERANCE
    held = np.unique(scene.bodies["block"].mesh.surfaces["z0"])
    u = state.gather_displacement("block")[held]
    np.testing.assert_allclose(u, np.tile(given, (len(held), 1)), atol=1e-10)


@pytest.mark.parametrize("cell", CELLS)
def test_components_that_are_not_prescribed_stay_free(cell: str) -> None:
    scene = loaded_block(cell, (None, 0.0, 0.1))
    scene = replace(scene, supports=[*scene.supports, Support("block", "x0", (0.02, None, None))])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert error(state, "block") < TOLERANCE
    u = state.gather_displacement("block")
    surfaces = scene.bodies["block"].mesh.surfaces
    below, left = np.unique(surfaces["z0"]), np.unique(surfaces["x0"])
    np.testing.assert_allclose(u[below][:, 1:], np.tile([0.0, 0.1], (len(below), 1)), atol=1e-10)
    np.testing.assert_allclose(u[left][:, 0], 0.02, atol=1e-10)
    assert np.ptp(u[below][:, 0]) > 1e-4


def test_bodies_of_different_materials_and_cells_do_not_disturb_each_other() -> None:
    scene, partitions = two_materials()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10)
    assert error(state, "soft") < TOLERANCE
    assert error(state, "stiff") < TOLERANCE


def test_a_scene_without_contact_is_solved_by_conjugate_gradients_alone() -> None:
    scene = loaded_block("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert state.counts["normal_multipliers"] == state.counts["tangential_multipliers"] == 0
    assert isinstance(default_solver(state.system.torn), ProjectedCG)
    assert state.solution.iterations == 1, "one linear solve is enough"
    assert state.solution.residuals.gluing < 1e-10
    assert state.contact.points.count == 0
    assert len(state.contact.normal_force) == len(state.contact.status) == 0


@pytest.mark.parametrize("solver", [FaceNewton(tolerance=1e-9), Smalse(tolerance=1e-6)])
def test_contact_solvers_take_a_scene_without_contact(solver: FaceNewton | Smalse) -> None:
    scene = loaded_block("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 4), solver=solver)
    assert error(state, "block") < 100 * solver.tolerance


def test_primal_and_dual_energy_agree() -> None:
    scene, partitions = two_materials()
    energies = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10).energies
    assert energies.friction == 0.0
    assert energies.primal == pytest.approx(energies.dual, rel=1e-9)
    assert energies.strain > 0.01


def test_one_subdomain_is_a_decomposition_too() -> None:
    scene = loaded_block("hexahedron")
    whole = {"block": np.zeros(scene.bodies["block"].mesh.n_cells, dtype=int)}
    assert error(solve_scene(scene, MPI.COMM_SELF, partitions=whole, tolerance=1e-10), "block") < TOLERANCE


# On several ranks the linear answer is that of one rank, and its fields are complete.
SCRIPT = Path(__file__).with_name("on_ranks.py")


@pytest.fixture(scope="module", params=[2, 4])
def ranks(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def answer(ranks: int) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(run_on_ranks(SCRIPT, ranks, timeout=100).splitlines()[-1])
    found["ranks"] = ranks
    return found


def test_the_displacement_on_ranks_is_that_of_a_monolithic_solve(answer: dict[str, Any]) -> None:
    errors = {name: case["error"] for name, case in answer["blocks"].items()}
    assert set(errors) == {f"{cell} {n}" for cell in CELLS for n in BOXES if n >= answer["ranks"]}
    assert max(errors.values()) < TOLERANCE, errors


def test_iterations_and_energy_do_not_depend_on_the_ranks(answer: dict[str, Any]) -> None:
    for cell in CELLS:
        scene = loaded_block(cell)
        alone = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
        case = answer["blocks"][f"{cell} 8"]
        assert abs(case["products"] - alone.solution.products) <= 1
        assert case["energy"] == pytest.approx(alone.energies.primal, rel=1e-10)


def test_a_rank_may_own_no_multiplier(answer: dict[str, Any]) -> None:
    assert 0 in answer["bar"]["owned"]
    assert answer["bar"]["error"] < TOLERANCE


def test_fields_are_complete_where_ranks_have_no_cell_of_a_body(answer: dict[str, Any]) -> None:
    both = [answer["bodies"][name] for name in ("soft", "stiff")]
    assert min(min(body["cells"]) for body in both) == 0, "every rank has cells of both: nothing was tested"
    for body in both:
        assert sum(body["cells"]) == body["all cells"]
        assert body["error"] < TOLERANCE
        assert body["field"] < TOLERANCE
        assert body["stress"] < 10 * TOLERANCE
