"""Every wrong argument is an error that says what is needed, what was given and what to do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import minimize
from fenics_contact.design import LinearConstraints
from fenics_contact.errors import InvalidInputError


def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(x @ x) + 1.0, 2 * x


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"bounds": (0.0, 1.0, 2.0)}, r"pair \(lower, upper\), got 3"),
        ({"bounds": (np.zeros(3), 1.0)}, r"lower bound must have shape \(2,\) like x0, got \(3,\)"),
        ({"bounds": (-5.0, [np.nan, 1.0])}, "upper bound must hold numbers, got nan"),
        ({"bounds": ([0.0, 3.0], 2.0)}, r"lower bounds must not exceed.*3 > 2 for x\[1\]"),
        ({"bounds": (2.0, 9.0)}, r"x\[0\] = 1 is below its lower bound 2.*nearest_feasible"),
        ({"bounds": (-9.0, [9.0, 0.5])}, r"x\[1\] = 1 is above its upper bound 0.5"),
        ({"constraints": LinearConstraints(np.ones(2), np.ones(1))}, "A must have 2 dim"),
        ({"constraints": LinearConstraints(np.ones((1, 3)), np.ones(1))}, r"A must have shape \(1, 2\)"),
        ({"constraints": LinearConstraints(np.ones((1, 2)), [np.inf])}, "A and b must be finite"),
        ({"constraints": LinearConstraints([[2.0, 1.0]], [1.0])}, "row 0 of A x ≤ b is exceeded by 2"),
        (
            {"constraints": LinearConstraints([[2.0, 1.0]], [9.0], [[1.0, 0.0]], [2.0])},
            "row 0 of E x = e is missed by -1",
        ),
        (
            {"constraints": LinearConstraints([[2.0, 1.0]], [9.0], [[1.0, 0.0]])},
            "both equality_matrix and equality_value",
        ),
        ({"scale": [1.0, -1.0]}, "scale must be positive"),
        ({"scale": np.ones(3)}, r"scale must be positive, a number or of shape \(2,\)"),
    ],
)
def test_wrong_feasible_set_is_refused(arguments: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(bowl, [1.0, 1.0], **arguments)


@pytest.mark.parametrize(
    ("start", "text"),
    [
        ([[1.0, 2.0]], r"x0 must have shape \(n,\).*got \(1, 2\)"),
        ([], "n ≥ 1"),
        ([1.0, np.nan], r"x0 must be finite, got x0\[1\] = nan"),
    ],
)
def test_wrong_start_is_refused(start: Any, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(bowl, start)


def test_many_violations_are_counted() -> None:
    with pytest.raises(InvalidInputError, match=r"x\[2\].* and 7 more"):
        minimize(bowl, np.zeros(10), bounds=(1.0, 2.0))


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (3.0, r"must return \(value, subgradient\), got float at evaluation 1"),
        ((3.0, np.ones(3)), r"subgradient of shape \(2,\), got shapes \(\) and \(3,\)"),
        ((np.ones(2), np.ones(2)), r"must return a number and.*got shapes \(2,\)"),
        ((np.nan, np.ones(2)), "finite value, got nan in entry 0 at evaluation 1: raise InvalidDesignError"),
        ((1.0, np.array([0.0, -np.inf])), "finite subgradient, got -inf in entry 1 at evaluation 1"),
    ],
)
def test_answer_of_the_function_is_checked(answer: Any, text: str) -> None:
    with pytest.raises(InvalidInputError, match=text):
        minimize(lambda x: answer, [1.0, 1.0])


def test_nan_in_a_later_evaluation_is_named_with_its_number() -> None:
    calls = []

    def fun(x: np.ndarray) -> tuple[float, np.ndarray]:
        calls.append(x)
        return (np.nan if len(calls) == 3 else bowl(x)[0]), bowl(x)[1] + [0.0, 0.1]

    with pytest.raises(InvalidInputError, match="got nan in entry 0 at evaluation 3"):
        minimize(fun, [4.0, 1.0])


def test_number_as_array_of_one_entry_is_a_number() -> None:
    result = minimize(lambda x: (np.array([bowl(x)[0]]), list(bowl(x)[1])), [1.0, 1.0])  # type: ignore[arg-type,return-value]
    assert result.value == pytest.approx(1.0, abs=2e-4)
