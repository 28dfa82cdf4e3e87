"""Deformation and temperatures in time, against their equations in one dimension and their own balances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_ivp

from fenics_contact import Body, Coulomb, Scene, Support
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.heat import (
    Conductor,
    FrictionHeat,
    HeatedState,
    HeatHistory,
    HeatScene,
    PlasticHeat,
    heat_in_time,
    heated_in_time,
    solve_heated,
)
from fenics_contact.heat.coupled import Passes
from fenics_contact.materials import HistoryMaterial, J2Plasticity
from fenics_contact.mesh.quadratic import quadratic
from fenics_contact.output import write_heat_balance
from tests.heat.coupled_bodies import CAPACITY, CLEARANCE, END, closing, ramp, sliding
from tests.heat.heated_bodies import ALPHA, YOUNG, film, rod

#: Of one element of the rod.
LENGTH = 0.25


def exact() -> tuple[np.ndarray, float]:
    """Return the temperatures of the rod's five sections at the end, and when it touches first.

    Linear elements in space, as the rod's, and any accuracy in time.
    """
    size = 5
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for k in range(size - 1):
        own = slice(k, k + 2)
        mass[own, own] += CAPACITY * LENGTH / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        stiffness[own, own] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / LENGTH
    weights = LENGTH * np.array([0.5, 1.0, 1.0, 1.0, 0.5])

    def over(time: float, free: np.ndarray) -> float:
        return float(ALPHA * weights @ np.concatenate([[ramp(time)], free]) - CLEARANCE)

    def rate(time: float, free: np.ndarray) -> np.ndarray:
        closed = over(time, free)
        h = 0.1 * YOUNG * max(closed, 0.0) + 1e-3 / (max(-closed, 0.0) + 0.01)
        right = -stiffness[1:] @ np.concatenate([[ramp(time)], free])
        right[-1] -= h * free[-1]
        right -= mass[1:, 0] * 300.0 * np.exp(-3.0 * time)
        return np.linalg.solve(mass[1:, 1:], right)

    touching: Any = over
    found = solve_ivp(
        rate, (0.0, END), np.zeros(4), "Radau", rtol=1e-9, atol=1e-9, events=touching, max_step=0.01
    )
    return np.concatenate([[ramp(END)], found.y[:, -1]]), float(found.t_events[0][0])


def sections(history: HeatHistory[HeatedState]) -> np.ndarray:
    """Return the temperatures along the rod at the end, from its lower side."""
    points = history.states[-1].geometry.bodies["rod"].mesh.points
    low = np.flatnonzero(points[:, 1] == 0.0)
    return history.values[-1][low[np.argsort(points[low, 0])]]


def error(count: int, scheme: Any) -> float:
    """Return the largest error of so many steps at the end."""
    history = heated_in_time(*closing(), MPI.COMM_SELF, END, 0.0, step=END / count, scheme=scheme)
    assert history.balance.error < 1e-12
    assert history.states[-1].mechanics.contact.pressure.min() > 1.0
    return float(np.abs(sections(history) - exact()[0]).max())


def test_a_rod_that_warms_closes_its_gap_in_time():
    known, touches = exact()
    assert 0.2 < touches < 0.8
    assert error(10, "bdf2") < 0.01 * known.max()


@pytest.mark.claim
@pytest.mark.parametrize(("scheme", "order"), [("bdf2", 2), ("euler", 1)])
def test_both_fields_have_the_order_of_the_scheme_as_a_gap_closes(scheme: Any, order: int):
    assert np.log2(error(10, scheme) / error(20, scheme)) == pytest.approx(order, abs=0.3)


@pytest.mark.claim
@pytest.mark.parametrize("tolerance", [1.0, 0.1])
def test_the_error_of_both_fields_in_time_is_stated_and_held(tolerance: float):
    history = heated_in_time(*closing(), MPI.COMM_SELF, END, 0.0, tolerance=tolerance)
    own = np.abs(sections(history) - exact()[0]).max()
    assert 1e-3 * tolerance < own <= history.error <= tolerance
    assert history.balance.error < 1e-12
    assert history.temperature("rod").shape == (len(history.times), 10)


def pushed(friction: FrictionHeat) -> tuple[Callable[[float], Scene], HeatScene]:
    """Return a block that is pressed down until time 1 and pushed from then on."""
    scene, heat = sliding(friction, Coulomb(0.4))

    def at(time: float) -> Scene:
        way = (0.1 * max(time - 1.0, 0.0), -0.01 * min(time, 1.0))
        return replace(scene, supports=[Support("lower", "y0"), Support("upper", "y1", way)])

    return at, heat


def test_steps_carry_slips_and_heat_by_all_work_of_friction(tmp_path: Path):
    at, heat = pushed(FrictionHeat(part=0.8))
    times = [1.0, 1.5, 2.5, 4.0]
    history = heated_in_time(at, heat, MPI.COMM_SELF, 4.0, 0.0, step=1.5, scheme="euler", outputs=times)
    contacts = [state.mechanics.contact for state in history.states]
    work = [float((contact.friction_force * contact.slip).sum()) for contact in contacts]
    (entered,) = (heat for name, heat in history.balance.by_part.items() if name.startswith("Friction"))
    assert history.steps == 4
    assert entered == pytest.approx(0.8 * sum(work), rel=1e-9)
    assert work[-1] == pytest.approx(1.5 * work[-2], rel=0.1)  # of 0.15 and 0.1 of way
    assert np.abs(contacts[-1].slip).max() < 0.16
    assert history.balance.error < 1e-12
    assert history.times == pytest.approx([0.0, *times])
    table = write_heat_balance(history.states, tmp_path / "balance.csv", times)
    assert len(table.read_text().splitlines()) == 2 + len(times)


@pytest.mark.claim
def test_steps_that_are_done_again_leave_no_slip_behind():
    # The push begins within a step.
    scene, heat = sliding(FrictionHeat(), Coulomb(0.4))

    def at(time: float) -> Scene:
        way = (max(time - 0.05, 0.0), -0.01)
        return replace(scene, supports=[Support("lower", "y0"), Support("upper", "y1", way)])

    pressed = solve_heated(at(0.0), heat, MPI.COMM_SELF)
    history = heated_in_time(at, heat, MPI.COMM_SELF, 0.15, pressed, tolerance=0.02)
    close = heated_in_time(at, heat, MPI.COMM_SELF, 0.15, pressed, step=0.15 / 48)
    assert history.rejected > 0
    assert np.abs(history.values[-1] - close.values[-1]).max() < history.error <= 0.02
    assert close.values[-1].max() > 0.3


def pulled(material: HistoryMaterial, order: int, *loads: PlasticHeat) -> tuple[Any, HeatScene]:
    """Return a bar of length 2 that is free at its sides, whose end moves by 0.02 in time 1, and its heat."""
    mesh = block((0, 0, 0), (2, 1, 1), (3, 1, 2))
    bodies = {"bar": Body(quadratic(mesh) if order == 2 else mesh, material)}
    sides = [
        Support("bar", f"{axis}0", tuple(np.where(np.eye(3)[k], 0.0, None))) for k, axis in enumerate("xyz")
    ]

    def at(time: float) -> Scene:
        return Scene(bodies, [*sides, Support("bar", "x1", (0.02 * time, None, None))])

    return at, HeatScene.on(at(0.0), {"bar": Conductor(1.0, 0.5)}, loads=loads)


@pytest.mark.parametrize("order", [1, 2])
def test_a_bar_that_flows_and_keeps_its_heat_warms_by_its_plastic_work(order: int):
    # σ = 2 + 100 α and ε = σ / E + α: heat is a share of 2 α + 50 α².
    at, heat = pulled(
        J2Plasticity(1000.0, 0.3, 2.0, isotropic_hardening=100.0), order, PlasticHeat("bar", 0.8)
    )
    history = heated_in_time(at, heat, MPI.COMM_SELF, 2.0, 20.0, step=0.5, scheme="euler")
    flow = (0.02 - 2.0 / 1000.0) / 1.1
    heat_per_volume = 0.8 * (2.0 * flow + 50.0 * flow**2)
    assert history.values[-1] - 20.0 == pytest.approx(heat_per_volume / 0.5, rel=1e-8)
    assert history.balance.by_part["PlasticHeat bar"] == pytest.approx(2.0 * heat_per_volume, rel=1e-8)
    assert history.balance.error < 1e-11


class Secret(J2Plasticity):
    """A metal that does not say what it loses."""

    plastic_work = HistoryMaterial.plastic_work


def test_heat_of_plastic_work_needs_a_material_that_has_some():
    with pytest.raises(InvalidInputError, match=r"PlasticHeat.share must lie between 0 and 1, got 90"):
        PlasticHeat("bar", 90.0)
    given: Any = dict(initial=0.0, step=1.0)
    at, heat = pulled(Secret(1000.0, 0.3, 2.0, isotropic_hardening=100.0), 1, PlasticHeat("bar"))
    with pytest.raises(InvalidInputError, match="what Secret loses in a step, got no plastic_work"):
        heated_in_time(at, heat, MPI.COMM_SELF, 1.0, **given)
    with pytest.raises(InvalidInputError, match="of body 'bar' needs the work of mechanics, got heat"):
        heat_in_time(heat, MPI.COMM_SELF, 1.0, **given)
    scene, closes = closing()
    heat = replace(closes(0.0), loads=[PlasticHeat("rod")])
    with pytest.raises(InvalidInputError, match="PlasticHeat needs a material of body 'rod' that flows"):
        heated_in_time(scene, heat, MPI.COMM_SELF, 1.0, **given)


def give_up_beyond(longest: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let longer steps not converge."""
    usual = Passes.run

    def run(self: Passes, guess: np.ndarray) -> HeatedState:
        if self.interaction.duration > longest:
            raise ConvergenceError("too far")
        return usual(self, guess)

    monkeypatch.setattr(Passes, "run", run)


@pytest.mark.claim
def test_a_step_that_does_not_converge_is_done_again_shorter(monkeypatch: pytest.MonkeyPatch):
    give_up_beyond(0.01, monkeypatch)
    history = heated_in_time(*closing(), MPI.COMM_SELF, 0.1, 0.0, tolerance=50.0)
    assert history.rejected > 0
    assert 0.005 < np.diff(history.times).max() <= 0.01


def test_steps_that_never_converge_end_the_history(monkeypatch: pytest.MonkeyPatch):
    give_up_beyond(0.0, monkeypatch)
    with pytest.raises(ConvergenceError, match=r"steps must be longer than .* the last step failed, too far"):
        heated_in_time(*closing(), MPI.COMM_SELF, END, 0.0, tolerance=50.0)
    with pytest.raises(ConvergenceError, match=r"^too far"):
        heated_in_time(*closing(), MPI.COMM_SELF, END, 0.0, step=0.5)


def test_a_history_goes_on_from_a_state_of_both_fields():
    scene, at = closing()
    warm = at(5.0)
    steady = solve_heated(scene, warm, MPI.COMM_SELF)
    history = heated_in_time(scene, warm, MPI.COMM_SELF, 2.0, steady, step=1.0)
    assert np.abs(history.values - steady.heat.values).max() < 1e-4
    assert history.balance.stored == pytest.approx(0.0, abs=1e-4)
    assert history.states[-1].mechanics.contact.pressure.min() > 1.0


def test_scenes_of_other_times_must_have_the_same_bodies():
    scene, at = closing()
    other, _ = rod(film(0.1, 0.01), 0.0, 0.0, CLEARANCE)
    with pytest.raises(InvalidInputError, match=r"the same bodies at all times, got others at 0\.5"):
        heated_in_time(lambda time: other if time > 0.0 else scene, at, MPI.COMM_SELF, 1.0, 0.0, step=0.5)
    with pytest.raises(InvalidInputError, match="stress_free needs a temperature of body 'rod'"):
        heated_in_time(scene, at, MPI.COMM_SELF, 1.0, 0.0, step=0.5, stress_free={"bar": 0.0})


ON_RANKS = """
from mpi4py import MPI
from tests.heat.coupled_bodies import closing
from fenics_contact.heat import heated_in_time
history = heated_in_time(*closing(), MPI.COMM_WORLD, 1.0, 0.0, step=0.25, mechanics_tolerance=1e-11)
if MPI.COMM_WORLD.rank == 0:
    print(history.balance.error < 1e-12, history.steps, *history.values[-1].tolist())
"""


@pytest.mark.claim
def test_histories_of_both_fields_are_the_same_on_ranks(mpirun: Callable[..., str]):
    one, two = (mpirun(ON_RANKS, number).split() for number in (1, 2))
    assert one[:2] == two[:2] == ["True", "4"]
    assert len(one) == 12
    assert np.array(two[2:], dtype=float) == pytest.approx(np.array(one[2:], dtype=float), abs=1e-7)
