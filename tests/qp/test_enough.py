"""Where a face is solved no further: when what it does not know exceeds what is left of it."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import solve_scene
from fenics_contact.qp import DualSolution, Stop, newton_steps
from fenics_contact.qp.krylov import projected_cg, projected_gmres
from tests.random_scenes.generator import sample


def test_a_face_is_solved_no_further_than_what_it_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    """A block on a floor and a wall with friction: statuses stay, but slipping forces turn."""
    made = sample(81177)

    def solved() -> DualSolution:
        state = solve_scene(made.scene, MPI.COMM_SELF, partitions=made.cut, tolerance=1e-8)
        return cast("DualSolution", state.solution)

    found = solved()
    assert any(Stop.ENOUGH.value in step.note for step in found.history)
    for name, method in (("projected_cg", projected_cg), ("projected_gmres", projected_gmres)):
        monkeypatch.setattr(newton_steps, name, lambda *given, method=method: method(*given[:-1]))
    to_the_end = solved()
    assert not any(Stop.ENOUGH.value in step.note for step in to_the_end.history)
    assert found.products < 0.7 * to_the_end.products
    assert found.multiplier == pytest.approx(to_the_end.multiplier, abs=1e-6 * np.abs(found.multiplier).max())
