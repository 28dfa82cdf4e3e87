"""Mistakes in designs and their optimisation, and the quick tests that must find them."""

from __future__ import annotations

from tools.mutants.copy_of_package import Mutation

GIVEN = "tests/design/test_given_gap_sensitivity.py"
MERIT, NONLINEAR = "tests/optimize/test_bundle.py", "tests/optimize/test_nonlinear.py"

DESIGN_MUTATIONS = (
    Mutation(
        "gradients take a given gap for the distance of the surfaces",
        "design/contact_derivatives.py",
        "points.distance[mine], by",
        "points.gap[mine], by",
        (f"{GIVEN}::test_the_adjoint_agrees_with_central_differences[blocks, gap-energy]",),
    ),
    Mutation(
        "the adjoint is solved a thousand times more loosely",
        "design/adjoint_starts.py",
        "else min(share * tolerance, most)",
        "else 1e3 * share * tolerance",
        (
            "tests/design/test_units.py::test_the_gradient_at_default_tolerance_is_as_accurate_as_stated"
            "[energy-N and mm]",
        ),
    ),
    Mutation(
        "a resumed run forgets what error went with which tolerance",
        "design/memory.py",
        'self.error_by_tolerance = start.pop("alpha"), float(start.pop("error"))',
        'self.error_by_tolerance = start.pop("alpha"), 0.0 * float(start.pop("error"))',
        ("tests/design/test_resuming.py::test_what_error_went_with_which_tolerance_is_known_after_going_on",),
    ),
    Mutation(
        "planes of the bundle do not move with the centre",
        "_optimize/bundle.py",
        "errors = self.errors + change - self.gradients @ step",
        "errors = self.errors + change",
        ("tests/optimize/test_bundle.py::test_moving_the_centre_gives_the_bundle_that_is_built_there",),
    ),
    Mutation(
        "slopes of true surfaces stay when their nodes move",
        "design/surface_derivatives.py",
        "by_edges = -scaled[..., None] * c[:, :, None]",
        "by_edges = -0.0 * scaled[..., None] * c[:, :, None]",
        (
            "tests/design/test_derivatives.py::test_each_term_agrees_with_central_differences",
            "tests/design/test_chain_sensitivity.py::test_the_adjoint_agrees_with_central_differences",
        ),
    ),
    Mutation(
        "multipliers of equalities forget what limits beside them push",
        "_optimize/merit.py",
        "        found[here.equal] += share @ one.bundle.pushes",
        "        pass",
        (
            f"{NONLINEAR}::test_an_equality_and_a_limit_that_meet_at_an_angle_have_the_multipliers_that_balance_j",
        ),
    ),
    Mutation(
        "multipliers of equalities forget what is taken out of planes",
        "_optimize/merit.py",
        "    found[here.equal] += step.weights @ state.bundle.pushes",
        "",
        (f"{NONLINEAR}::test_multipliers_are_those_of_the_limits",),
    ),
    Mutation(
        "penalties are content with a ten thousandth of what is possible",
        "_optimize/merit.py",
        "share: float = 0.1",
        "share: float = 1e-4",
        (
            f"{MERIT}::test_a_penalty_stays_that_takes_off_a_tenth_of_a_violation_and_grows_where_it_takes_off_less",
        ),
    ),
    Mutation(
        "rows of equalities are a thousand times too long",
        "_optimize/merit.py",
        "np.vstack([rows, near.equality_rows])",
        "np.vstack([1000.0 * rows, near.equality_rows])",
        (f"{MERIT}::test_equalities_are_rows_of_length_one_whatever_their_units",),
    ),
    Mutation(
        "violations of equalities count a thousand times",
        "_optimize/nonlinear.py",
        "np.where(self.equal, np.abs(self.excess)",
        "np.where(self.equal, 1000.0 * np.abs(self.excess)",
        (f"{NONLINEAR}::test_violations_are_parts_of_the_sizes_of_limits_on_either_side",),
    ),
    Mutation(
        "adjoints are solved below rounding",
        "design/adjoint.py",
        "max(tolerance * begin.size, begin.rounding)",
        "tolerance * begin.size",
        ("tests/design/test_adjoint.py::test_a_norm_of_an_even_pressure_is_stationary",),
    ),
    Mutation(
        "new meshes forget what designs have added to given gaps",
        "design/remeshed.py",
        "    if name not in given:",
        "    if name in given:",
        ("tests/design/test_remeshed.py::test_new_meshes_of_the_same_cells_have_the_same_objective[gap]",),
    ),
    Mutation(
        "states of designs ignore the tolerance of Newton's method",
        "_equilibrium/problem.py",
        "return (self.steps or AutomaticSteps()).newton.tolerance",
        "return 1e-6",
        ("tests/design/test_design.py::test_states_of_rubber_are_solved_to_newtons_tolerance",),
    ),
    Mutation(
        "gradients of rubber hold weighted means where they are",
        "_pairing/sliding/points.py",
        "total += motion.gap_rows(some, self.coordinates).T @ by",
        "total += 0.0",
        ("tests/design/test_deformed_sensitivity.py::test_plane_blocks_that_meet_by_mortar",),
    ),
    Mutation(
        "slip of weighted means begins where no design moves it",
        "_pairing/sliding/slip.py",
        "result = result - _of_nodes(width * now[met] + a, width * count).T @ rows",
        "result = result - 0.0 * _of_nodes(width * now[met] + a, width * count).T @ rows",
        ("tests/design/test_deformed_sensitivity.py::test_plane_blocks_that_meet_by_mortar",),
    ),
)
