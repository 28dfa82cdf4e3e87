"""What is drawn belongs to the nodes and cells it is said to belong to."""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery import block
from fenics_contact.pictures.section import cells_of, drawn_bodies, lengths, moved, nodal
from fenics_contact.results.multi_block import body_grid
from tests.viz.states import pulled, touching_blocks


def test_nodal_stress_of_a_constant_is_the_constant_and_a_mean_else() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    body = body_grid(mesh, mesh.points)
    body.cell_data["stress"] = np.full(2, 7.0)
    np.testing.assert_allclose(nodal(body, "stress"), 7.0)
    body.cell_data["stress"] = np.array([1.0, 3.0])
    mean = nodal(body, "stress")
    np.testing.assert_allclose(mean[np.isclose(mesh.points[:, 0], 1.0)], 2.0)
    assert set(mean.round(12)) == {1.0, 2.0, 3.0}


def test_drawn_bodies_have_the_fields_of_the_state() -> None:
    state = touching_blocks()
    bodies = drawn_bodies(state)
    assert set(bodies) == {"lower", "upper"}
    for name, body in bodies.items():
        displacement = state.gather_displacement(name)
        np.testing.assert_array_equal(body["displacement"], displacement)
        np.testing.assert_allclose(lengths(body), np.linalg.norm(displacement, axis=1))
        np.testing.assert_array_equal(cells_of(body), state.scene.bodies[name].mesh.cells)
        assert body["von_mises"].min() > 0
        np.testing.assert_allclose(np.sort(body["von_mises"]), np.sort(state.von_mises[name].x.array))
    shifted = moved(bodies, 2.0)["upper"].points - bodies["upper"].points
    np.testing.assert_allclose(shifted, 2 * bodies["upper"]["displacement"], atol=1e-12)


def test_quadratic_cells_are_cut_into_linear_ones_that_repeat_their_values() -> None:
    state = pulled("hexahedron27")
    (body,) = drawn_bodies(state).values()
    whole = state.to_pyvista()["bar"]
    assert body.n_points == whole.n_points
    assert body.n_cells == 8 * whole.n_cells
    np.testing.assert_allclose(body["von_mises"], np.repeat(whole["von_mises"], 8))
    np.testing.assert_allclose(body["stress"], np.repeat(whole["stress"], 8, axis=0))
