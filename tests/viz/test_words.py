"""Numbers and titles as readers like them."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import checked_range, headline, nice_number, written


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (15360, "15\u202f360"),
        (np.int64(-7), "−7"),
        (79713.4, "79\u202f710"),
        (-0.13849, "−0.1385"),
        (0.0, "0"),
        (1.234e-5, "1.234e−05"),
        (9.99996, "10.000"),
    ],
)
def test_numbers_are_written_with_spaces_and_a_true_minus(value: float, text: str) -> None:
    assert written(value) == text


@pytest.mark.parametrize(
    ("value", "nice"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (49.0, 20.0), (0.051, 0.05), (0.0, 1.0)]
)
def test_nice_number_is_one_two_or_five_times_a_power_of_ten(value: float, nice: float) -> None:
    assert nice_number(value) == pytest.approx(nice)


def test_headline_starts_with_a_capital() -> None:
    assert headline("", "largest 3") == "Largest 3"
    assert headline("Before", "largest 3") == "Before: largest 3"


@pytest.mark.parametrize("clim", [(1.0, 1.0), (2.0, 1.0), (0.0, np.nan), (-np.inf, 0.0)])
def test_a_range_without_width_is_refused(clim: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"clim must be a finite range .* widen it"):
        checked_range(clim)
