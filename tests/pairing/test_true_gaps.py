"""Gaps between true surfaces over quadratic facets are those of the surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._pairing.mortar.coupling import mortar_coupling
from fenics_contact._surfaces.true_surface import reconstructed
from tests.pairing.mortar_surfaces import shell


@pytest.mark.parametrize("kinds", [("edges3", "edges3"), ("quads9", "triangles6")])
def test_the_gap_between_true_shells_is_that_of_their_radii(kinds: tuple[str, str]) -> None:
    """What quadratic facets bulge over their linear pieces is no part of the height of the true surface."""
    slave = reconstructed(shell(kinds[0], 4, 1.0, convex=True, span=(0.4, 1.4)))
    master = reconstructed(shell(kinds[1], 5, 1.05, convex=False, span=(0.0, 2.0)))
    np.testing.assert_allclose(mortar_coupling(slave, master).gap, 0.05, atol=2e-4)
