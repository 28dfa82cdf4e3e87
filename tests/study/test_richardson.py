"""Extrapolation to mesh size zero: exact for powers, refused for what does not converge."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.study.results import extrapolate, measured_rate


@pytest.mark.parametrize("rate", [0.5, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("spacing", [(1.0, 0.5, 0.25), (0.5, 1 / 3, 0.25, 1 / 6)])
def test_a_power_is_extrapolated_exactly_with_its_rate(rate: float, spacing: tuple[float, ...]) -> None:
    found = extrapolate(spacing, [-3.0 + 0.7 * h**rate for h in spacing])
    assert not found.refused
    assert found.value == pytest.approx(-3.0, abs=1e-9)
    assert found.rate == pytest.approx(rate, abs=1e-9)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ((1.0, 2.0), "three meshes are needed, there are 2"),
        ((1.0, 2.0, 1.5), "does not converge monotonically"),
        ((1.0, 2.0, 3.5), "changes from mesh to mesh do not fall"),
        ((1.0, 2.0, 2.0 + 1e-6), "fall too fast"),
        ((2.0, 2.0, 2.0), "the meshes give the same"),
    ],
)
def test_what_does_not_converge_like_a_power_is_refused_with_the_reason(
    values: tuple[float, ...], reason: str
) -> None:
    found = extrapolate([1.0, 0.5, 0.25][: len(values)], values)
    assert reason in found.refused
    assert found.value == values[-1]
    assert found.rate is None


def test_the_rate_of_errors_is_that_of_the_three_finest_meshes() -> None:
    h = np.array([1.0, 0.5, 0.25, 0.125])
    errors = 3.0 * h**1.5
    errors[0] = 1.0
    assert measured_rate(h, errors) == pytest.approx(1.5)
    assert measured_rate(h[:1], errors[:1]) is None
    assert measured_rate(h, np.zeros(4)) is None
