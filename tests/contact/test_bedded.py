"""Bodies whose material resists every motion, as on an elastic bed: no kernel, no coarse space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact.errors import InfeasibleError
from tests.contact.bedded import FORCE, Bedded, pushed


@pytest.mark.parametrize("on_floor", [True, False])
@pytest.mark.parametrize("parts", [(1, 1, 1), (1, 1, 3)])
def test_a_bed_balances_a_load_that_nothing_else_resists(parts: tuple[int, int, int], on_floor: bool) -> None:
    state = pushed(Bedded(1e3, 0.3), parts, on_floor=on_floor)
    assert state.dual.problem.coarse.m == 0
    subdomains = state.torn.subdomains
    forces = [
        part.stiffness @ u
        for part, u in zip(subdomains, np.split(state.torn_displacement, len(subdomains)), strict=True)
    ]
    reaction = np.concatenate(forces).reshape(-1, 3).sum(axis=0)  # strains have no resultant
    np.testing.assert_allclose(reaction, np.add(FORCE, state.contact.force.sum(axis=0)), atol=1e-6)
    assert reaction[0] == pytest.approx(FORCE[0])
    pressed = state.contact.normal_force.sum()
    assert 100.0 < pressed < 3200.0 if on_floor else pressed == 0.0


ON_RANKS = """
    from mpi4py import MPI
    from tests.contact.bedded import Bedded, pushed

    state = pushed(Bedded(1e3, 0.3), (1, 1, 3))
    lowest = float(state.gather_displacement("block").min())
    if MPI.COMM_WORLD.rank == 0:
        print(lowest)
"""


def test_a_bed_is_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    alone = float(pushed(Bedded(1e3, 0.3), (1, 1, 3)).gather_displacement("block").min())
    assert alone < -0.1
    assert float(mpirun(ON_RANKS, 2)) == pytest.approx(alone, rel=1e-8)


def test_a_bed_that_acts_upwards_alone_does_not_hold_sideways() -> None:
    with pytest.raises(InfeasibleError, match=r"translation \(1, 0, 0\) meets no resistance"):
        pushed(Bedded(1e3, 0.3, sideways=False), (1, 1, 1))
