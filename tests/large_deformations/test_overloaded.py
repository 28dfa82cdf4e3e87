"""Load steps that are far beyond what bodies carry end soon, and say how far they came."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    Scene,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact._base import progress
from fenics_contact._base.progress import Event, Kind
from fenics_contact._large_deformations.newton import TangentNewton
from fenics_contact.errors import ConvergenceError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import NeoHooke, Ogden


def pad(pressure: float) -> Scene:
    """Return a pad of rubber on a floor, under a pressure."""
    body = Body(rectangle((0.0, 0.0), (10.0, 5.0), (6, 3)), NeoHooke(5.0, 0.45))
    floor = ContactPair(Surface("pad", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.3))
    return Scene({"pad": body}, [], [Pressure("pad", "y1", pressure)], [floor])


def test_a_load_that_a_pad_carries_takes_whole_steps() -> None:
    """They put contact in disorder, which was in order, and forces in balance, which were not."""
    state = solve_scene(pad(1.0), MPI.COMM_SELF)
    assert state.contact.normal_force.sum() == pytest.approx(10.0, rel=0.2)  # the pad widens
    assert not any("cut to" in line.note for line in state.solution.history)
    assert len(state.solution.history) < 9


def test_an_overloaded_pad_gives_up_attempts_in_vain_and_reports_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Residuals do not fall: four stalls are enough, two where stress softens more and more motions."""
    events = list[Event]()
    monkeypatch.setattr(progress, "LISTENERS", [events.append])
    with pytest.raises(ConvergenceError, match=r"can be followed up to 0\.\d+ of this step") as error:
        solve_scene(pad(100.0), MPI.COMM_SELF, steps=AutomaticSteps(smallest=1.0 / 16.0))
    history = error.value.history
    starts = [i for i, line in enumerate(history) if line.iteration == 0] + [len(history)]
    attempts = [history[i:j] for i, j in pairwise(starts)]
    vain = [each for each in attempts if each[-1].residuals.worst > 1e-2]
    assert len(vain) > 2
    assert max(len(each) for each in vain) <= 20
    four_stalls = 1 + 4 * TangentNewton().patience
    assert any(len(each) < four_stalls and "7 soft motions held" in each[-1].note for each in vain)
    told = [each for each in events if each.what == "load step in parts"]
    reached = re.search(r"up to (0\.\d+) of", str(error.value))
    assert reached is not None
    assert any(re.match(r"0 of the load reached, 1 of it fails: \w+", each.words) for each in told)
    assert any(f"{reached[1]} of the load reached" in each.words for each in told)
    assert told[-1].kind is Kind.FAILED


def test_a_bar_stretched_sixfold_in_a_step_stays_on_its_side_of_its_planes_of_symmetry() -> None:
    """Both transverse axes of the cell may turn inside out in a Newton step: det F is positive again."""
    bulk = 4000.0

    def transverse_force(across: float) -> float:
        """Return ∂W/∂λ across, with stretches (6, λ, λ)."""
        J = 6.0 * across**2
        along, thin = 6.0 * J ** (-1 / 3), across * J ** (-1 / 3)
        slope = [160 * stretch - 40 * stretch**-3 for stretch in (along, thin)]
        return -2 / 3 * (slope[0] * along - slope[1] * thin) / across + bulk * (J - 1.0) * 12.0 * across

    body = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), Ogden((160.0, -40.0), (2.0, -2.0), bulk))
    sides = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "z0": (None, None, 0.0)}
    held = [Support("bar", surface, value) for surface, value in sides.items()]
    scene = Scene({"bar": body}, [*held, Support("bar", "x1", (5.0, None, None))])
    moved = solve_scene(scene, MPI.COMM_SELF).gather_displacement("bar")
    across = 1.0 + moved[:, 1:].min()
    assert across == pytest.approx(brentq(transverse_force, 0.2, 0.9), rel=1e-6)
    assert np.all(body.mesh.points[:, 1:] * (1.0 + moved[:, 1:]) >= 0.0)
