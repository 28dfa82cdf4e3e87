"""What a design problem refuses, counts and remembers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, Scene, ShapeProblem, SurfaceDesign
from fenics_contact.design import ContactForces, Partials, TotalPotential, VolumeIntegral
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.results import ContactResult
from fenics_contact.results.deformed_state import AnyState
from tests.design.blocks import block_on_block, designs_of, problem, side
from tests.design.chains import SOLVER
from tests.design.objectives import misfit, objectives
from tests.design.quotients import Remembering
from tests.scenes import partitions


@cache
def scene() -> Scene:
    return block_on_block(Coulomb(0.38), load=(0.6, 0.12, -2.0))


@cache
def solved() -> Remembering:
    return problem(scene())


def fresh(**more: object) -> ShapeProblem:
    designs = designs_of(scene())
    return ShapeProblem(
        ContactProblem(scene(), MPI.COMM_SELF, partitions=partitions(scene()), **more),
        designs,
        TotalPotential(),
    )


DESIGN = 0.01 * np.random.default_rng(1).standard_normal(12)


@pytest.mark.parametrize("shape", [(11,), (13,), (12, 1), ()])
def test_a_design_of_the_wrong_shape_is_refused(shape: tuple[int, ...]) -> None:
    for ask in (solved().evaluate, solved().volume, solved().points_of):
        with pytest.raises(InvalidInputError, match=r"alpha must have shape \(12,\), got \("):
            ask(np.zeros(shape))


def test_a_design_of_an_unknown_body_is_refused() -> None:
    design = SurfaceDesign("middle", side(scene().bodies["upper"].mesh, "z0"), (2, 2))
    with pytest.raises(InvalidInputError, match=r"names body 'middle', the scene has \['lower', 'upper'\]"):
        ShapeProblem(
            ContactProblem(scene(), MPI.COMM_SELF, partitions=partitions(scene())), design, TotalPotential()
        )


def test_a_surface_that_is_held_may_not_move() -> None:
    design = SurfaceDesign("lower", side(scene().bodies["lower"].mesh, "z0"), (2, 2))
    with pytest.raises(
        InvalidInputError, match=r"keep away from supports, but .* of body 'lower' lie on both"
    ):
        ShapeProblem(
            ContactProblem(scene(), MPI.COMM_SELF, partitions=partitions(scene())), design, TotalPotential()
        )


def test_an_integral_over_an_unknown_body_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"got 'middle', there are \['lower', 'upper'\]"):
        solved().evaluate_by(VolumeIntegral("misfit", misfit, "middle"), DESIGN)


def test_force_derivatives_of_the_wrong_shape_are_refused() -> None:
    def short(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
        return 0.0, contact.normal_force[1:], contact.friction_force

    count = solved().state_of(DESIGN).contact.points.count
    with pytest.raises(
        InvalidInputError, match=rf"shapes \({count},\) and \({count}, 2\), got \({count - 1},\)"
    ):
        solved().evaluate_by(ContactForces(short), DESIGN)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_a_design_that_is_no_number_is_refused(number: float) -> None:
    with pytest.raises(InvalidInputError, match=f"alpha must be finite, got {number} in entry 3"):
        solved().evaluate(np.where(np.arange(12) == 3, number, 0.0))


def test_a_design_that_inverts_a_cell_is_refused_and_the_next_one_is_solved() -> None:
    before = solved().value_of(DESIGN)
    for ask in (solved().evaluate, solved().value_of, solved().volume):
        with pytest.raises(InvalidDesignError, match=r"the design cannot be meshed: .* move the nodes less"):
            ask(np.full(12, -2.0))
    nearby = solved().value_of(DESIGN + 1e-9)
    assert nearby == pytest.approx(before, rel=1e-6)


def test_the_volume_agrees_with_central_differences() -> None:
    direction, step = np.random.default_rng(3).standard_normal(12), 1e-5
    value, gradient = solved().volume(DESIGN)
    bodies = solved().scene_of(DESIGN).bodies
    assert value == pytest.approx(sum(body.mesh.volume for body in bodies.values()))
    up, down = (solved().volume(DESIGN + sign * step * direction)[0] for sign in (1, -1))
    assert abs(gradient @ direction) > 0.1
    assert gradient @ direction == pytest.approx((up - down) / (2 * step), rel=1e-8)
    # Every variable adds material.
    assert gradient.min() > 0.0


def test_a_known_state_is_differentiated_without_being_solved_again() -> None:
    problem = fresh(tolerance=1e-8)
    point = problem.evaluate(np.zeros(problem.size))
    contact = ContactProblem.following(point.state, tolerance=1e-8)
    known = ShapeProblem(contact, problem.designs, TotalPotential())
    again = known.differentiate(point.state)
    assert again.state is point.state
    assert again.value == point.value
    np.testing.assert_allclose(again.gradient, point.gradient, rtol=1e-6, atol=1e-9 * abs(point.value))
    assert "solve" not in known.seconds


def test_two_designs_of_one_body_add_up() -> None:
    free = replace(scene(), loads=[])
    mesh = free.bodies["upper"].mesh
    both = tuple(SurfaceDesign("upper", side(mesh, face), (2, 2), 0.1) for face in ("z0", "z1"))
    blocks = ShapeProblem(
        ContactProblem(free, MPI.COMM_SELF, partitions=partitions(free)), both, TotalPotential()
    )
    lower, upper = np.concatenate([np.full(4, 0.05), np.zeros(4)]), np.concatenate([np.zeros(4), np.ones(4)])
    moved = [blocks.points_of(alpha)["upper"] - mesh.points for alpha in (lower, upper, lower + upper)]
    assert np.abs(moved[0]).max() == pytest.approx(0.05)
    assert np.abs(moved[1]).max() == pytest.approx(1.0)
    assert moved[0] + moved[1] == pytest.approx(moved[2], abs=1e-13)
    assert set(blocks.points_of(lower)) == {"upper"}


def test_an_earlier_state_is_judged_in_its_own_shape() -> None:
    judges = objectives("upper")
    blocks = fresh(solver=SOLVER)
    state = blocks.state_of(DESIGN)
    forms = blocks.geometry.forms
    at_once = {name: judge.partials(state, forms) for name, judge in judges.items()}
    blocks.state_of(5 * DESIGN)
    for name, judge in judges.items():
        later = judge.partials(state, forms)
        assert judge.value(state, forms) == later.value == at_once[name].value
        assert np.array_equal(later.by_displacement, at_once[name].by_displacement)
        assert np.array_equal(later.by_shape, at_once[name].by_shape)


def test_evaluations_and_products_are_counted_and_the_best_design_is_kept() -> None:
    blocks = fresh()
    points = [blocks.evaluate(factor * DESIGN) for factor in (0.0, 3.0, -3.0)]
    assert blocks.evaluations == 3
    assert blocks.products == sum(point.state.system.products for point in points)
    assert all(0 < point.adjoint_iterations < point.state.system.products for point in points)
    assert blocks.first is points[0]
    assert blocks.last is points[-1]
    values = [point.value for point in points]
    assert blocks.best is points[int(np.argmin(values))]
    assert len(set(values)) == 3
    value, gradient = blocks(0.0 * DESIGN)
    assert value == pytest.approx(values[0], rel=1e-5)
    assert gradient.shape == (12,)
    assert {"decompose", "mesh motion", "solve", "adjoint", "gradient"} <= set(blocks.seconds)


@pytest.mark.parametrize("given", ["scene", None])
def test_what_is_no_contact_problem_is_refused(given: object) -> None:
    what = scene() if given == "scene" else given
    message = rf"needs a ContactProblem\(scene, comm\), got {type(what).__name__}: make one"
    with pytest.raises(InvalidInputError, match=message):
        ShapeProblem(what, designs_of(scene()), TotalPotential())  # type: ignore[arg-type]


class Broken:
    """The energy with a number that is none in one place."""

    def __init__(self, place: str, number: float) -> None:
        self.place, self.number = place, number

    def value(self, state: AnyState, forms: ShapeForms) -> float:
        return self.number if self.place == "value" else state.energies.total_potential

    def partials(self, state: AnyState, forms: ShapeForms) -> Partials:
        partials = TotalPotential().partials(state, forms)
        if self.place == "value":
            return replace(partials, value=self.number)
        broken = np.atleast_1d(np.array(getattr(partials, self.place)))
        broken[0] = self.number
        return replace(partials, **{self.place: broken})


@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("value", "value"),
        ("by_displacement", "derivative by displacements"),
        ("by_multiplier", "derivative by contact forces"),
        ("by_area", "derivative by areas"),
        ("by_jump", "derivative by slips and gaps"),
    ],
)
def test_an_objective_that_is_no_number_is_refused(place: str, told: str, number: float) -> None:
    with pytest.raises(
        InvalidInputError, match=f"must have a finite {told}, got {number} in entry 0: check d"
    ):
        solved().evaluate_by(Broken(place, number), DESIGN)
    assert np.isfinite(solved().evaluate_by(TotalPotential(), DESIGN).value)


def test_a_gradient_that_is_no_number_is_refused() -> None:
    class Steep:
        def value(self, state: AnyState, forms: ShapeForms) -> float:
            return 0.0

        def partials(self, state: AnyState, forms: ShapeForms) -> Partials:
            partials = TotalPotential().partials(state, forms)
            return replace(partials, by_shape=np.full_like(partials.by_shape, np.nan))

    with pytest.raises(InvalidInputError, match="must have a finite gradient, got nan in entry 0"):
        solved().evaluate_by(Steep(), DESIGN)


def test_a_value_alone_that_is_no_number_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="must have a finite value, got nan"):
        solved().value_by(Broken("value", np.nan), DESIGN)


def test_a_design_by_the_name_of_its_surface_is_that_of_its_nodes() -> None:
    contact = ContactProblem(scene(), MPI.COMM_SELF, partitions=partitions(scene()))
    named = ShapeProblem(contact, SurfaceDesign("lower", "z1", (3, 2)), TotalPotential())
    (design,), known = named.designs, SurfaceDesign("lower", side(scene().bodies["lower"].mesh, "z1"), (3, 2))
    assert design.lattice.counts == known.lattice.counts
    alpha = np.arange(6.0)
    np.testing.assert_array_equal(design.lattice.nodes, known.lattice.nodes)
    np.testing.assert_allclose(design.displacement(alpha), known.displacement(alpha), atol=1e-12)
    assert np.abs(design.displacement(alpha)).max() > 1.0


def test_a_design_by_name_says_what_its_surface_needs() -> None:
    contact = ContactProblem(scene(), MPI.COMM_SELF, partitions=partitions(scene()))
    with pytest.raises(InvalidInputError, match=r"a rectangular grid .* got 'front' of \['x0', "):
        ShapeProblem(contact, SurfaceDesign("lower", "front"), TotalPotential())
    with pytest.raises(InvalidInputError, match=r"a net \(7, 7\) needs as many nodes each way, got"):
        ShapeProblem(contact, SurfaceDesign("lower", "z1", (7, 7)), TotalPotential())
    with pytest.raises(
        InvalidInputError, match="surface 'z1', given by name, needs a scene for its nodes: take"
    ):
        _ = SurfaceDesign("lower", "z1").basis


class Settled:
    """An objective that is the same for all designs."""

    def value(self, state: AnyState, forms: ShapeForms) -> float:
        return 2.0

    def partials(self, state: AnyState, forms: ShapeForms) -> Partials:
        return Partials.of(state, 2.0)

    def __repr__(self) -> str:
        return "Settled()"


def test_an_objective_that_no_variable_changes_is_refused() -> None:
    first = fresh()
    idle = first.case(first.scene, Settled())
    with pytest.raises(InvalidInputError, match=r"but Settled\(\) is 2 and none of 12 variables changes it"):
        idle.evaluate(DESIGN)
    moving = first.case(first.scene, TotalPotential() + Settled())
    assert moving.evaluate(DESIGN).gradient.any()
