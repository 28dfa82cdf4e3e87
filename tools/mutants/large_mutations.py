"""Mistakes in large deformations, and the quick tests that must find them."""

from __future__ import annotations

from tools.mutants.copy_of_package import Mutation

ONE_STEP = (
    "tests/large_deformations/test_newton_steps.py::"
    "test_friction_and_plastic_flow_do_not_depend_on_how_a_load_step_is_cut"
)

LARGE_MUTATIONS = (
    Mutation(
        "pressures that follow are three percent softer than their forces say",
        "_large_deformations/loading.py",
        "blocks[number] = blocks[number] + mesh.matrix_of(softening)",
        "blocks[number] = blocks[number] + 0.97 * mesh.matrix_of(softening)",
        (
            "tests/large_deformations/test_prescribed_motion.py::test_newton_is_quadratic_where_rims_slide_in_planes_of"
            "_symmetry_and_neighbours_pass_forces_on",
        ),
    ),
    Mutation(
        "soft rows of forces that turn keep columns of length one",
        "_large_deformations/tangent_step.py",
        "np.minimum(usual / np.abs(compliance[soft]), 1.0)",
        "np.ones(np.count_nonzero(soft))",
        (
            "tests/large_deformations/test_prescribed_motion.py::test_soft_rows_of_rims_between_many_parts_neither_cost"
            "_products_nor_accuracy",
        ),
    ),
    Mutation(
        "slip of bodies that move far begins anew in every part of a load step",
        "_large_deformations/moving_contact.py",
        "return self._from(load, displacement, last.points, last.start)",
        "return self._from(load, displacement, last.points, last.points.material_points())",
        (f"{ONE_STEP}[plane]",),
    ),
    Mutation(
        "slip of bodies that do not move far begins anew in every part of a load step",
        "_large_deformations/load_steps.py",
        "load = self._load(fraction, *now.origin)",
        "load = self._load(fraction, now.at, now.torn)",
        (f"{ONE_STEP}[metal]",),
    ),
    Mutation(
        "plastic strain goes on from every part of a load step",
        "_large_deformations/newton.py",
        "history=origin.history, time=origin.time",
        "history=self.evaluation.history, time=origin.time",
        (f"{ONE_STEP}[metal]",),
    ),
    Mutation(
        "pressures that followed before stay whole while others take their place",
        "_large_deformations/loading.py",
        "[((1.0 - part) * weight, each) for weight, each in first.following]",
        "[(weight, each) for weight, each in first.following]",
        (
            "tests/large_deformations/test_newton_steps.py::test_on_the_way_to_another_pressure_the_old_one_goes_as_the_new_one_comes",
        ),
    ),
    Mutation(
        "pressures that follow and are functions of time grow in proportion to it",
        "_large_deformations/loading.py",
        "mixed = replace(mixed, torn=torn, following=now.following, heat=now.heat)",
        "mixed = replace(mixed, torn=torn, heat=now.heat)",
        (
            "tests/large_deformations/test_newton_steps.py::test_a_pressure_that_is_a_function_of_time_has_its_value_at_every_part",
        ),
    ),
    Mutation(
        "surfaces that slide have no curvature",
        "_pairing/sliding/surfaces.py",
        'bend = np.einsum("nabd,nd->nab", at.second, at.normal)',
        'bend = 0.0 * np.einsum("nabd,nd->nab", at.second, at.normal)',
        ("tests/pairing/test_sliding_derivatives.py::test_stiffness_is_the_derivative_of_the_normal_forces",),
    ),
    Mutation(
        "directions of friction do not turn with normals",
        "_pairing/sliding/stiffness.py",
        "other = np.cross(change, unit) + np.cross(normal[:, None], turned)",
        "other = np.cross(change, unit)",
        (
            "tests/pairing/test_sliding_derivatives.py::test_friction_stiffness_is_the_derivative_of_the_friction"
            "_forces",
        ),
    ),
    Mutation(
        "nodes of a fold are slaves that are masters already",
        "_pairing/sliding/closest.py",
        "& ~self._are_masters(found, last)",
        "& (found.point >= 0)",
        ("tests/pairing/test_sliding_contact.py::test_a_node_is_no_slave_where_it_is_the_master_of_one",),
    ),
    Mutation(
        "friction of parts with histories of their own is not added up",
        "_large_deformations/load_steps.py",
        "earlier_friction_work += self.end.evaluation.friction_work",
        "earlier_friction_work = 0.0",
        (
            "tests/large_deformations/test_prescribed_motion.py::test_friction_to_and_fro_within_a_load_step_is_the_sum"
            "_over_parts_with_histories_of_their_own",
        ),
    ),
    Mutation(
        "nodes that meet their master later have no given gap",
        "_pairing/sliding/points.py",
        "near[:] = True",
        "pass",
        (
            "tests/pairing/test_sliding_derivatives.py::"
            "test_nodes_that_meet_their_master_later_have_the_gap_of_those_beside_them",
        ),
    ),
    Mutation(
        "forces a thousand times the rounding of positions are none",
        "_large_deformations/equations.py",
        "ROUNDED = 4.0 *",
        "ROUNDED = 4000.0 *",
        ("tests/large_deformations/test_newton_steps.py::test_rounding_alone_hides_nothing_of_a_small_load",),
    ),
    Mutation(
        "a tenth of what would strain bodies by their displacement counts as no force",
        "_large_deformations/equations.py",
        "FORCE_FLOOR = 1e-4",
        "FORCE_FLOOR = 1e-1",
        (
            "tests/large_deformations/test_newton_steps.py::test_a_small_load_on_a_body_that_is_moved_far_is_balanced",
        ),
    ),
    Mutation(
        "pressures of bodies that deform much are by undeformed area",
        "_pairing/sliding/means.py",
        "return self.pressed * self.share",
        "return self.before * self.share",
        (
            "tests/large_deformations/test_true_pressure.py::test_an_incompressible_block_presses_with_its_stress",
        ),
    ),
    Mutation(
        "points at the rim of the master have all of their area",
        "_pairing/sliding/means.py",
        "np.maximum(part, 0.5), part > 0.5",
        "1.0, False",
        (
            "tests/large_deformations/test_true_pressure.py::"
            "test_pressures_at_the_rim_of_the_master_are_those_of_small_strain",
        ),
    ),
    Mutation(
        "gradients of pressures hold deformed areas where displacements move them",
        "design/sensitivity.py",
        "free_part(by_places, every, ~np.isnan(moved.prescribed), axes)",
        "0.0 * by_places",
        ("tests/design/test_deformed_sensitivity.py::test_plane_blocks[plane-0.0-0.0-statuses0]",),
    ),
)
