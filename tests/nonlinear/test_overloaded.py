"""Load steps that are far beyond what bodies carry end soon, and say how far they came."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    Scene,
    Surface,
    solve_scene,
)
from fenics_contact._base import progress
from fenics_contact._base.progress import Event, Kind
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke


def test_an_overloaded_pad_gives_up_attempts_in_vain_and_reports_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its residuals do not fall: four stalls are enough, in place of 25 steps."""
    events = list[Event]()
    monkeypatch.setattr(progress, "LISTENERS", [events.append])
    pad = Body(rectangle((0.0, 0.0), (10.0, 5.0), (6, 3)), NeoHooke(5.0, 0.45))
    floor = ContactPair(Surface("pad", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.3))
    scene = Scene({"pad": pad}, [], [Pressure("pad", "y1", 100.0)], [floor])
    with pytest.raises(ConvergenceError, match=r"can be followed up to 0\.\d+ of this step") as error:
        solve_scene(scene, MPI.COMM_SELF, steps=AutomaticSteps(smallest=1.0 / 16.0))
    history = error.value.history
    starts = [i for i, line in enumerate(history) if line.iteration == 0] + [len(history)]
    attempts = [history[i:j] for i, j in pairwise(starts)]
    vain = [len(each) for each in attempts if each[-1].residuals.worst > 1e-2]
    assert len(vain) > 2
    assert max(vain) <= 18
    told = [each for each in events if each.what == "load step in parts"]
    reached = re.search(r"up to (0\.\d+) of", str(error.value))
    assert reached is not None
    assert any(re.match(r"0 of the load reached, 1 of it fails: \w+", each.words) for each in told)
    assert any(f"{reached[1]} of the load reached" in each.words for each in told)
    assert told[-1].kind is Kind.FAILED
