"""Shallow ironing with friction, by nodes and by mortar, beside what others have published.

K. A. Fischer, P. Wriggers, Mortar based frictional contact formulation for higher order interpolations using
the moving friction cone, Comput. Methods Appl. Mech. Eng. 195 (2006); S. Hartmann, J. Oliver (2009);
V. A. Yastrebov (2011); K. Poulios, Y. Renard, Comput. Struct. 153 (2015); code_aster (2020).
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Status, Support, Surface
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from tests.nonlinear.ironing import die
from tests.nonlinear.mortar_scenes import followed

#: Lowest and highest published force [N/mm] at the end of the press and after 2.5 mm of the way: vertical,
#: horizontal.
PUBLISHED = {1.0: ((267.9, 332.0), (55.3, 71.0)), 1.25: ((334.9, 419.7), (100.2, 190.4))}
MODULUS = 689.6  # N/mm²


def ironed(way: str, time: float) -> Scene:
    """A stiff die 0.2 above a block, pressed by 1 mm until time 1 and then drawn, 10 mm in a unit of time."""
    bodies = {
        "block": Body(rectangle((0.0, 0.0), (12.0, 4.0), (48, 16)), NeoHooke(MODULUS, 0.32)),
        "die": Body(die(12), NeoHooke(10.0 * MODULUS, 0.32)),
    }
    moved = (10.0 * max(time - 1.0, 0.0), -min(time, 1.0))
    pair = ContactPair(Surface("die", "y0"), Surface("block", "y1"), Coulomb(0.3), way)  # type: ignore[arg-type]
    return Scene(bodies, [Support("block", "y0"), Support("die", "y1", moved)], contacts=[pair])


@pytest.mark.slow
@pytest.mark.parametrize("way", ["node", pytest.param("mortar", marks=pytest.mark.claim)])
def test_shallow_ironing_lies_within_the_published_spread(way: str) -> None:
    times = [0.25, 0.5, 0.75, 1.0, 1.05, 1.1, 1.15, 1.2, 1.25]
    states = followed([ironed(way, time) for time in times], MPI.COMM_SELF, 1e-8)
    for time, published in PUBLISHED.items():
        horizontal, vertical = states[times.index(time)].reactions()[1].force
        for found, (low, high) in zip((-vertical, horizontal), published, strict=True):
            assert low < found < high, (time, found)
    assert states[-1].contact.count(Status.SLIP) > 5
    assert max(state.balance().imbalance for state in states) < 1e-7
    assert np.ptp([-state.reactions()[1].force[1] for state in states[-2:]]) < 0.05 * PUBLISHED[1.25][0][0]
