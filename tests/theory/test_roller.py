"""The relief of rollers: published closed forms, and an integral over the half space by other means."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory import roller_relief


def test_under_a_line_it_is_that_of_lundberg() -> None:
    found = roller_relief(np.array([0.0, -0.5, 0.9, 0.99, 1.0]), 2.0)
    np.testing.assert_allclose(found, [0.0, 0.2876821, 1.6607312, 3.9170354, np.inf], rtol=1e-6)


@pytest.mark.parametrize("half_length", [10.0, 50.0])
def test_under_a_strip_the_end_sinks_as_johns_and_gohar_found(half_length: float) -> None:
    (end,) = roller_relief(np.array([half_length]), 2.0 * half_length, 1.0)
    assert end == pytest.approx(1.1932 + np.log(half_length), rel=1e-3)


@pytest.mark.parametrize("place", [0.5, 0.9, 0.99])
def test_it_is_an_integral_over_the_half_space(place: float) -> None:
    half, b = 3.0, 0.3

    def sunk(y: float) -> float:
        """∫ p / r over the strip for p0 = 1, across first."""

        def along(x: float) -> float:
            return float(np.arcsinh((half - y) / x) + np.arcsinh((half + y) / x))

        return 2.0 * quad(lambda x: np.sqrt(1.0 - (x / b) ** 2) * along(x), 0.0, b)[0]

    wanted = (sunk(0.0) - sunk(place * half)) / (np.pi * b / 2)
    assert roller_relief(np.array([place * half]), 2 * half, b)[0] == pytest.approx(wanted, rel=1e-6)


def test_places_beyond_the_ends_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"within half the length, 1, from the middle .*, got 1\.5"):
        roller_relief(np.array([0.0, 1.5]), 2.0)
    with pytest.raises(InvalidInputError, match="half_width"):
        roller_relief(np.array([0.0]), 2.0, 0.0)
