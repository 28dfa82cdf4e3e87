"""Materials that relax: load steps have a duration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactProblem,
    LoadSequence,
    LoadStep,
    Scene,
    State,
    Support,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import HistoryMaterial, MaterialResponse

UNIT = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
SYMMETRIC = 0.5 * (UNIT + UNIT.swapaxes(2, 3))
SPRING, DAMPED, TIME = 2.0, 3.0, 0.7


@dataclass(frozen=True)
class StandardSolid(HistoryMaterial):
    """A spring beside a spring with a damper, by backward Euler; the history is strain and damped stress."""

    spring: float
    damped: float
    relaxation_time: float
    history_size = 18

    def respond(self, gradient: Any, history: Any, duration: Any) -> MaterialResponse:
        n = len(gradient)
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        before, stress = history.reshape(n, 2, 3, 3).swapaxes(0, 1)
        decay = 1.0 / (1.0 + duration / self.relaxation_time)
        damped = decay * (stress + self.damped * (strain - before))
        tangent = np.broadcast_to((self.spring + decay * self.damped) * SYMMETRIC, (n, 3, 3, 3, 3))
        after = np.concatenate([strain.reshape(n, 9), damped.reshape(n, 9)], axis=1)
        return MaterialResponse(self.spring * strain + damped, tangent, after)


def solid() -> Scene:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), StandardSolid(SPRING, DAMPED, TIME))
    return Scene({"body": body}, [Support("body", "x0"), Support("body", "x1", (0.0, 0.0, 0.0))])


def held(stretch: float) -> list[Support]:
    return [Support("body", "x0"), Support("body", "x1", (stretch, 0.0, 0.0))]


def pull(state: State) -> float:
    return float(state.reactions()[1].force[0])


def relaxed(count: int, steps: AutomaticSteps | None = None) -> float:
    """The force after stretching at once and holding for one unit of time, in some steps."""
    problem = ContactProblem(solid(), MPI.COMM_SELF, tolerance=1e-11, steps=steps)
    times = [0.0, *(np.arange(1, count + 1) / count)]
    states = solve_steps(problem, [LoadStep(f"{t}", supports=held(0.01), time=t) for t in times])
    # Without Poisson's effect the stress is even; a step of no duration is elastic.
    assert pull(states[0]) == pytest.approx((SPRING + DAMPED) * 0.01)
    return pull(states[-1])


def test_relaxation_follows_the_closed_form_in_the_first_order() -> None:
    exact = (SPRING + DAMPED * np.exp(-1.0 / TIME)) * 0.01
    coarse, fine = (relaxed(count) / exact - 1.0 for count in (10, 20))
    assert 0.0 < fine < 0.02
    assert coarse / fine == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("finer", [False, True])
def test_a_load_step_has_its_duration_whole_and_in_parts_if_asked_for(finer: bool) -> None:
    parts = (0.25, 0.375, 0.375) if finer else (1.0,)  # an easy part is followed by longer ones
    decay = 1.0 / np.prod([1.0 + part / TIME for part in parts])
    force = relaxed(1, AutomaticSteps(first=0.25, finer_history=finer))
    assert force == pytest.approx((SPRING + DAMPED * decay) * 0.01, rel=1e-9)


def test_time_must_not_run_backwards() -> None:
    sequence = LoadSequence(ContactProblem(solid(), MPI.COMM_SELF))
    sequence.advance(LoadStep("later", supports=held(0.01), time=2.0))
    with pytest.raises(
        InvalidInputError, match=r"time of load steps must not decrease .* got 1 after 2: give"
    ):
        sequence.advance(LoadStep("earlier", supports=held(0.01), time=1.0))
