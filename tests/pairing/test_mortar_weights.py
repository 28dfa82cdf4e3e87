"""Derivatives of mortar weights by both surfaces, one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact._pairing.mortar.coupling import mortar_coupling
from fenics_contact._pairing.mortar.derivatives import weight_derivatives
from fenics_contact._surfaces.facets import FacetedSurface
from tests.pairing.mortar_surfaces import KINDS, plate, shell


def moved(surface: FacetedSurface, by: np.ndarray) -> FacetedSurface:
    return replace(surface, points=surface.points + by, relief=None)


@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
@pytest.mark.parametrize("name", ["plates", "rim", "shells"])
def test_weights_change_as_their_derivatives_say(name: str, kinds: tuple[str, str]) -> None:
    """At the rim of the master and on quadrilaterals that warp, dual functions change as well."""
    if name == "shells":
        slave, master = (
            shell(kind, cells, radius, convex=convex, span=span)
            for kind, cells, radius, convex, span in (
                (kinds[0], 9, 1.0, True, (0.2, 0.9)),
                (kinds[1], 7, 1.02, False, (0.0, 1.0)),
            )
        )
        # No rim of the master over a rim of the slave, where derivatives differ on both sides.
        aside = 1.3 * master.points[:, 2:] - 0.15
        master = replace(master, points=np.hstack([master.points[:, :2], aside]))
    else:
        low, high = (0.2, 0.9) if name == "plates" else (0.2, 1.2)
        slave = plate(kinds[0], 5, height=0.01, up=False, low=low, high=high, turn=0.3)
        master = plate(kinds[1], 7)
    random, step = np.random.default_rng(5), 1e-6
    ways = [random.standard_normal(each.points.shape) for each in (slave, master)]
    coupling = mortar_coupling(slave, master)
    found = weight_derivatives(slave, master, coupling, np.ones(len(coupling.node), dtype=bool))
    slope = found.rows @ np.concatenate([way.ravel() for way in ways])
    ahead, behind = (
        mortar_coupling(moved(slave, sign * step * ways[0]), moved(master, sign * step * ways[1])).weight
        for sign in (1, -1)
    )
    quotient = np.asarray((ahead - behind)[found.point, found.node]).ravel() / (2 * step)
    error = np.abs(slope - quotient).max() / np.abs(quotient).max()
    assert np.abs(quotient).max() > 1.0
    assert error < 1e-7
