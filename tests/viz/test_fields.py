"""Gathered fields belong to the nodes and cells they are said to belong to."""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery import block
from fenics_contact.viz.fields import BodyFields, gather
from tests.viz.states import touching_blocks


def test_nodal_stress_of_a_constant_is_the_constant_and_a_mean_else() -> None:
    body = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    still = np.zeros((body.n_nodes, 3))
    np.testing.assert_allclose(BodyFields(body, still, np.full(2, 7.0)).nodal_von_mises, 7.0)
    mean = BodyFields(body, still, np.array([1.0, 3.0])).nodal_von_mises
    np.testing.assert_allclose(mean[np.isclose(body.points[:, 0], 1.0)], 2.0)
    assert set(mean.round(12)) == {1.0, 2.0, 3.0}


def test_gathered_state_has_the_fields_of_its_functions() -> None:
    state = touching_blocks()
    bodies = gather(state)
    assert set(bodies) == {"lower", "upper"}
    for name, body in bodies.items():
        np.testing.assert_array_equal(body.displacement, state.gather_displacement(name))
        assert body.von_mises.min() > 0
        np.testing.assert_allclose(np.sort(body.von_mises), np.sort(state.von_mises[name].x.array))
    np.testing.assert_allclose(
        bodies["upper"].deformed(2.0) - bodies["upper"].mesh.points, 2 * bodies["upper"].displacement
    )
