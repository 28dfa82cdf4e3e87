"""Supports prescribe numbers or functions of position, component by component."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, LoadStep, Scene, Support, Traction, solve_scene
from fenics_contact.errors import InvalidInputError
from tests.models.bodies import bent, box, steel
from tests.models.elements import CELLS

POINTS = np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])


def test_values_are_numbers_functions_or_nan_where_free() -> None:
    support = Support("body", "x0", (None, 2.0, lambda points: points[:, 0] + points[:, 2]))
    np.testing.assert_array_equal(support.values(POINTS), [[np.nan, 2.0, 2.0], [np.nan, 2.0, 8.0]])
    plane = Support("body", "x0", (lambda points: points[:, 1], None))
    np.testing.assert_array_equal(plane.values(POINTS[:, :2]), [[1.0, np.nan], [4.0, np.nan]])


@pytest.mark.parametrize("function", [lambda points: points, lambda points: np.full(len(points), np.nan)])
def test_a_function_must_return_a_number_a_point(function: object) -> None:
    support = Support("body", "x0", (None, function, None))  # type: ignore[arg-type]
    with pytest.raises(
        InvalidInputError, match="component 1 of the support of surface 'x0' must return finite"
    ):
        support.values(POINTS)


@pytest.mark.parametrize("cell", CELLS)
def test_a_linear_displacement_all_around_is_taken_on_inside(cell: str) -> None:
    mesh = bent(box(cell))
    A = np.array([[0.01, 0.02, 0.0], [-0.01, 0.03, 0.01], [0.0, 0.02, -0.02]])[: mesh.dim, : mesh.dim]
    components = tuple(lambda points, row=row: points @ row for row in A)
    supports = [Support("body", surface, components) for surface in mesh.surfaces]
    state = solve_scene(
        Scene({"body": Body(mesh, steel(mesh.dim))}, supports), MPI.COMM_SELF, tolerance=1e-10
    )
    inside = np.setdiff1d(
        np.arange(mesh.n_nodes), np.concatenate([f.ravel() for f in mesh.surfaces.values()])
    )
    assert len(inside)
    np.testing.assert_allclose(state.gather_displacement("body"), mesh.points @ A.T, atol=1e-12)


def test_a_support_of_three_components_does_not_suit_a_plane_body() -> None:
    message = r"Support.value of body 'plate' must hold two entries, for x and y, as the body is plane, got"
    with pytest.raises(InvalidInputError, match=message):
        Scene({"plate": Body(box("triangle"), steel(2))}, [Support("plate", "x0", (0.0, 0.1, 0.0))])


@pytest.mark.parametrize("cell", CELLS)
def test_a_support_holds_all_directions_of_its_body_by_default(cell: str) -> None:
    mesh = box(cell)
    scene = Scene({"body": Body(mesh, steel(mesh.dim))}, [Support("body", "x0")])
    assert scene.supports == (Support("body", "x0", (0.0,) * mesh.dim),)
    held = np.unique(mesh.surfaces["x0"])
    assert scene.fixed("body")[held].all()
    assert not np.delete(scene.fixed("body"), held, axis=0).any()


def test_a_plane_body_that_is_held_by_default_is_solved() -> None:
    body = Body(box("triangle"), steel(2))
    pull = Traction("plate", "x1", (1.0, 0.0))
    states = [
        solve_scene(Scene({"plate": body}, [support], [pull]), MPI.COMM_SELF)
        for support in (Support("plate", "x0"), Support("plate", "x0", (0.0, 0.0)))
    ]
    moved = [state.gather_displacement("plate") for state in states]
    assert np.abs(moved[0]).max() > 0.0
    np.testing.assert_array_equal(*moved)


def test_a_load_step_holds_a_plane_body_by_default() -> None:
    scene = Scene({"plate": Body(box("triangle"), steel(2))}, [Support("plate", "x0", (0.1, 0.0))])
    assert LoadStep("back", supports=[Support("plate", "x0")]).applied_to(scene).supports[0].value == (
        0.0,
        0.0,
    )
