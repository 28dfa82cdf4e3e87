"""Formulas as text: arithmetic in x, y, z, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._scene_file.values import Expression, VectorExpression, between
from fenics_contact.errors import InvalidInputError

POINTS = np.array([[0.5, -1.0, 2.0], [0.0, 3.0, -4.0]])
X, Y, Z = POINTS.T


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("2 * x + y - z / 4", 2 * X + Y - Z / 4),
        ("-x**2 + 1e-3", -(X**2) + 1e-3),
        ("sin(pi * x) * exp(-y)", np.sin(np.pi * X) * np.exp(-Y)),
        ("where(z > 0, max(x, y), min(x, y))", np.where(Z > 0, np.maximum(X, Y), np.minimum(X, Y))),
        ("sqrt(x**2 + y**2 + z**2) - 9", np.linalg.norm(POINTS, axis=1) - 9),
        ("abs(y) * atan2(y, x)", np.abs(Y) * np.arctan2(Y, X)),
        ("3", np.full(2, 3.0)),
        ("+".join(["x"] * 400) + "-" + "-".join(["y"] * 400), 400 * X - 400 * Y),
    ],
)
def test_a_formula_has_the_values_of_numpy(text: str, values: np.ndarray) -> None:
    np.testing.assert_allclose(Expression(text)(POINTS), values, rtol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')", "x.real", "(lambda: 1)()", "[1, 2]", "x if y else z", "open",
        "sin", "sin(x, y)", "f'{x}'", "x; y", "x = 1", "True", "1j * x", "sinn(x)", "x @ y", "x << 2",
        "max(x)", "where(x, y)", "'a'", "x and y", "0 < x < 1", "sin(x=1)", "w", "", "(x",
        "-" * 60 + "x", "x" * 3000,
    ],
)  # fmt: skip
def test_anything_else_is_refused_and_not_run(text: str) -> None:
    with pytest.raises(InvalidInputError, match=r"a formula (may hold|must be arithmetic|must have at most)"):
        Expression(text)


def test_a_vector_mixes_numbers_and_formulas() -> None:
    found = VectorExpression((Expression("x"), 0.0, Expression("2 * z")))(POINTS)
    np.testing.assert_array_equal(found, np.column_stack([X, 0 * X, 2 * Z]))


def test_equal_texts_are_equal_values() -> None:
    assert Expression("x") == Expression("x")
    assert len({Expression("x"), Expression("x"), Expression("y")}) == 2


def test_z_is_refused_in_the_plane() -> None:
    with pytest.raises(InvalidInputError, match="depends on z, but the bodies lie in the plane"):
        Expression("x + z")(POINTS[:, :2])


def test_on_the_way_from_one_formula_to_another_is_a_formula() -> None:
    half = between(Expression("x"), Expression("3 * y"), 0.5)
    assert callable(half)
    np.testing.assert_allclose(half(POINTS), 0.5 * X + 1.5 * Y)
    quarter = between(-2.0, Expression("z"), 0.25)
    assert callable(quarter)
    np.testing.assert_allclose(quarter(POINTS), -1.5 + 0.25 * Z)
    assert between(1.0, 3.0, 0.25) == 1.5
    assert between(0.1, 0.3, 1.0) == 0.3
