"""Mistakes that no test saw when they were tried, and the tests that find them since."""

from __future__ import annotations

from tools.mutants.copy_of_package import Mutation

RESIDUALS = "tests/adaptive/test_contact_residuals.py"
ALIKE = "tests/feti/test_alike.py::test_stiffnesses_that_agree_in_diagonal_trace_and_norm_alone_are_not_alike"
HELD_TIES = f"{RESIDUALS}::test_rows_that_supports_determine_carry_no_force_of_a_tie"

UNSEEN_MUTATIONS = (
    Mutation(
        "subdomains of one numbering are alike by their diagonals alone",
        "feti/alike.py",
        "return same and self._agree(A.data, B.data)",
        "return same",
        (ALIKE,),
    ),
    Mutation(
        "turned subdomains are alike by the pattern of their stiffness alone",
        "feti/alike.py",
        "return self._agree(A.data, Q @ data @ Q.T if given.width == len(Q) else data)",
        "return True",
        (ALIKE,),
    ),
    Mutation(
        "the bulge of quadratic facets is part of the true surface's height",
        "_pairing/mortar/coupling.py",
        "np.asarray(raised - bulge)",
        "raised",
        ("tests/pairing/test_true_gaps.py::test_the_gap_between_true_shells_is_that_of_their_radii",),
    ),
    Mutation(
        "the directions of slivers do not turn",
        "_pairing/mortar/coupling.py",
        "np.where(alone, (one - other) / np.where(alone, apart, 1.0), -one * other)",
        "np.where(alone, 0.0, -one * other)",
        ("tests/pairing/test_mortar_derivative.py::test_the_pseudo_inverse_of_a_sliver_turns_with_it",),
    ),
    Mutation(
        "one layer of reduced cells in contact has no share of full integration",
        "_scene/body.py",
        "or touches_in_one_layer(self.mesh)",
        "or False",
        (
            "tests/fem/test_thin_bodies.py::"
            "test_two_plates_in_contact_share_the_load_by_one_layer_of_reduced_cells",
        ),
    ),
    Mutation(
        "forces at corners of shells are shared otherwise than in CalculiX",
        "decks/shells.py",
        "(middle, 2.0)",
        "(middle, 1.0)",
        ("tests/decks/test_shells.py::test_plates_move_as_calculix_prints",),
    ),
    Mutation(
        "knots of shells are rigid",
        "decks/shell_motions.py",
        "ways[..., 6] = arms",
        "ways[..., 6] = 0.0",
        ("tests/decks/test_shells.py::test_shells_that_meet_at_right_angles_are_joined_as_by_knots",),
    ),
    Mutation(
        "MEANROT takes the common displacement for a rotation",
        "decks/multi_point.py",
        "vectors -= vectors.mean(axis=0)",
        "vectors -= 0.0",
        ("tests/decks/test_multi_point.py::test_the_mean_rotation_is_about_the_mean_displacement",),
    ),
    Mutation(
        "centres of cells keep the temperature that no deck gives them",
        "decks/loads.py",
        "mesh.centres.placed((instant.temperatures - self.built.steps.initial)[nodes])",
        "(instant.temperatures - self.built.steps.initial)[nodes]",
        (
            "tests/decks/test_temperatures.py"
            "::test_centres_of_quadratic_cells_have_the_temperatures_around_them",
        ),
    ),
    Mutation(
        "at a corner of a table by slip friction grows as before it",
        "_scene/surface_laws.py",
        'np.searchsorted(self.slip, slip, side="right")',
        'np.searchsorted(self.slip, slip, side="left")',
        (
            "tests/equilibrium/test_friction_by_slip.py::test_the_slope_at_a_corner_of_a_table_is_that_beyond_it",
        ),
    ),
    Mutation(
        "partners are where the first node of both sides lies",
        "_scene/constraints.py",
        "points.mean(axis=0) - start.mean(axis=0)",
        "points[0] - start[0]",
        ("tests/feti/test_linear_constraints.py::test_partners_are_found_in_any_order_of_the_nodes",),
    ),
    Mutation(
        "the area of a section is that of the facets that it cuts",
        "_scene/preloads.py",
        "vector_areas(mesh.points, facets) @ self.normal(mesh)",
        "np.linalg.norm(vector_areas(mesh.points, facets), axis=1)",
        ("tests/feti/test_preloads.py::test_the_area_of_an_oblique_section_is_that_across_its_normal",),
    ),
    Mutation(
        "rims of bodies with a chart move by whole bulges",
        "_adaptive/boundary_defect.py",
        "way[around > 0] = 2.0 / 3.0 * ",
        "way[around > 0] = ",
        ("tests/adaptive/test_boundary_defect.py::test_rims_move_until_their_chords_enclose_the_true_area",),
    ),
    Mutation(
        "rims of true surfaces move by whole bulges",
        "_adaptive/boundary_errors.py",
        "distance[around > 0] = 2.0 / 3.0 * ",
        "distance[around > 0] = ",
        (f"{RESIDUALS}::test_chords_of_a_cylinder_move_until_they_enclose_its_area_at_rims_too",),
    ),
    Mutation(
        "gaps that a pair gives are missed between nodes",
        "_adaptive/contact_residuals.py",
        "slave.at_nodes(residual - (points.gap - points.distance))",
        "slave.at_nodes(residual)",
        (f"{RESIDUALS}::test_gaps_that_are_given_are_missed_nowhere_between_nodes",),
    ),
    Mutation(
        "a force of supports counts ties that supports determine",
        "_adaptive/resultants.py",
        "np.where(joint.held(torn.decomposition.fixed), 0.0, joint.measured(held))",
        "joint.measured(held)",
        (HELD_TIES,),
    ),
    Mutation(
        "reactions count ties that supports determine",
        "feti/ties.py",
        "np.where(self.held(fixed), 0.0, multiplier)",
        "multiplier",
        (HELD_TIES,),
    ),
    Mutation(
        "adjoint forces of energies work on gaps of open nodes",
        "_adaptive/goal_errors.py",
        "0.0 if weight else 0.5",
        "0.5",
        (f"{RESIDUALS}::test_forces_of_adjoints_work_on_half_of_the_gaps_but_those_of_energies_on_none",),
    ),
    Mutation(
        "rescues have springs of one stiffness",
        "qp/rescue.py",
        "factor = 1.0 if number < 4 else",
        "factor = 1.0 if number >= 0 else",
        ("tests/equilibrium/test_rigid_bodies.py::test_springs_of_other_stiffness_free_a_stuck_newton",),
    ),
    Mutation(
        "solvers in turn begin anew",
        "qp/in_turn.py",
        "best = stopped[-1].best",
        "best = start.iterate",
        ("tests/qp/test_in_turn.py::test_the_next_begins_with_the_best_multiplier_of_the_one_before",),
    ),
)
