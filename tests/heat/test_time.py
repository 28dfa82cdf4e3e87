"""Temperatures in time against Carslaw and Jaeger's solutions, and the error that histories state."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import quad
from scipy.special import k0

from fenics_contact import Surface, Tie
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    HeatFlux,
    HeatHistory,
    HeatScene,
    HeldTemperature,
    Radiation,
    TemperatureTable,
    heat_in_time,
    solve_heat,
)
from fenics_contact.mesh import quadratic

#: k = 1 and c = 4, from 0 to 2: its diffusivity is 1/4, and times are those of L²/α = 16.
SLAB = ConductingBody(quadratic(rectangle((0.0, 0.0), (2.0, 0.1), (16, 1))), Conductor(1.0, 4.0))
HELD = HeatScene({"slab": SLAB}, [HeldTemperature("slab", "x0", 10.0)])
HEATED = HeatScene({"slab": SLAB}, loads=[HeatFlux("slab", "x0", 3.0)])
COARSE = ConductingBody(rectangle((0.0, 0.0), (2.0, 0.1), (16, 1)), Conductor(1.0, 4.0))


def history(scene: Any, duration: float, initial: Any = 0.0, **given: Any) -> HeatHistory:
    return heat_in_time(scene, MPI.COMM_SELF, duration, initial, **given)


def held(x: np.ndarray, time: float) -> np.ndarray:
    """Return temperatures of a slab at 0 whose face is held at 10 (Carslaw and Jaeger, 3.3 and 3.4)."""
    m = (np.arange(60) + 0.5) * np.pi
    return 10.0 * (1.0 - np.sin(np.outer(x / 2.0, m)) @ (2.0 / m * np.exp(-(m**2) * time / 16.0)))


def heated(x: np.ndarray, time: float) -> np.ndarray:
    """Return temperatures of a slab at 0 into whose face a flux of 3 enters (Carslaw and Jaeger, 3.8)."""
    m, y = np.arange(1, 60) * np.pi, 1.0 - x / 2.0
    waves = np.cos(np.outer(y, m)) @ (np.cos(m) / m**2 * np.exp(-(m**2) * time / 16.0))
    return 3.0 * 2.0 * (time / 16.0 + (3.0 * y**2 - 1.0) / 6.0 - 2.0 * waves)


def errors(scene: HeatScene, exact: Callable[..., np.ndarray], counts: Sequence[int], **given: Any) -> Any:
    """Return the largest errors at t = 4 of so many steps."""
    found = []
    for count in counts:
        result = history(scene, 4.0, step=4.0 / count, **given)
        assert result.balance.error < 1e-12
        assert result.steps == count
        found.append(np.abs(result.values[-1] - exact(SLAB.mesh.points[:, 0], 4.0)).max())
    return np.array(found)


@pytest.mark.parametrize(
    ("scheme", "order", "scene", "exact"),
    [
        ("euler", 1, HELD, held),
        ("bdf2", 2, HELD, held),
        ("bdf2", 2, HEATED, heated),
        pytest.param("crank-nicolson", 2, HELD, held, marks=pytest.mark.slow),
        pytest.param("crank-nicolson", 2, HEATED, heated, marks=pytest.mark.slow),
        pytest.param("euler", 1, HEATED, heated, marks=pytest.mark.slow),
    ],
)
def test_slabs_are_those_of_carslaw_and_jaeger(
    scheme: str, order: int, scene: HeatScene, exact: Callable[..., np.ndarray]
):
    begin = 4 if scheme == "crank-nicolson" else 1
    coarse, fine = errors(scene, exact, (16, 32), scheme=scheme, begin=begin)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.12)
    assert fine < (0.15, 0.02)[order - 1]


@pytest.mark.claim
def test_steps_that_change_keep_the_second_order():
    found = []
    for count in (16, 32):
        ends = 4.0 * np.cumsum(np.tile([1.0, 2.0, 0.7, 1.3], count // 4)) / (1.25 * count)
        result = history(HEATED, 4.0, step=1.0, outputs=ends[:-1])
        assert result.times == pytest.approx([0.0, *ends])
        found.append(np.abs(result.values[-1] - heated(SLAB.mesh.points[:, 0], 4.0)).max())
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.claim
@pytest.mark.parametrize(
    ("scheme", "tolerance"), [("bdf2", 0.05), pytest.param("euler", 0.3, marks=pytest.mark.slow)]
)
def test_the_error_of_the_whole_history_is_stated_and_held(scheme: Any, tolerance: float):
    result = history(HEATED, 16.0, tolerance=tolerance, scheme=scheme)
    x, times = SLAB.mesh.points[:, 0], result.times
    true = np.array(
        [np.abs(own - heated(x, time)).max() for own, time in zip(result.values, times, strict=True)]
    )
    late = times > 0.05  # before it the mesh errs more
    assert late.sum() > 10
    assert (true[late] <= result.errors[late]).all()
    assert result.error == result.errors.max()
    assert 0.1 * tolerance < result.error <= tolerance
    assert np.diff(times)[-3] > 100.0 * np.diff(times)[0]
    assert result.balance.error < 1e-12
    assert result.balance.stored == pytest.approx(3.0 * 0.1 * 16.0, rel=1e-10)
    assert "error by steps" in str(result)


@pytest.mark.claim
def test_outputs_are_hit_and_kept_alone():
    given = (0.7, 2.0, 1.3)
    result = history(HELD, 2.5, tolerance=2.0, outputs=given)
    assert result.times.tolist() == [0.0, 0.7, 1.3, 2.0, 2.5]
    assert result.rejected > 0
    assert result.steps > 20
    for state, values in zip(result.states, result.values[1:], strict=True):
        assert np.array_equal(state.values, values)
    assert result.values == pytest.approx(
        np.array([held(SLAB.mesh.points[:, 0], time) for time in result.times]) * (result.times > 0)[:, None],
        abs=2.0,
    )
    assert result.temperature("slab").shape == (5, SLAB.mesh.n_nodes)


def halves(loads: Sequence[HeatFlux] = (), ties: Sequence[Tie] = (), start: float = 0.0) -> HeatHistory:
    """Heat two half-spaces of effusivities 1 and 3 which do not see their ends."""
    bodies = {
        "left": ConductingBody(
            rectangle((-1.0, 0.0), (0.0, 0.05), (24, 1), grading=(-2.0, 0.0)), Conductor(1.0, 1.0)
        ),
        "right": ConductingBody(
            rectangle((0.0, 0.0), (1.5, 0.05), (24, 1), grading=(2.0, 0.0)), Conductor(4.0, 2.25)
        ),
    }
    return history(HeatScene(bodies, loads=loads, ties=ties), 0.02, {"left": start, "right": 0.0}, step=1e-3)


def at_contact(result: HeatHistory) -> tuple[float, float]:
    bodies = result.states[-1].scene.bodies
    left, right = (
        float(result.temperature(name)[-1][np.abs(bodies[name].mesh.points[:, 0]) < 1e-12].mean())
        for name in ("left", "right")
    )
    return left, right


PERFECT = Tie(Surface("left", "x1"), Surface("right", "x0"))


def test_bodies_in_perfect_contact_share_by_effusivities():
    result = halves(ties=[PERFECT], start=100.0)
    assert at_contact(result) == pytest.approx((25.0, 25.0), abs=0.05)
    assert result.balance.error < 1e-12


def test_heat_of_an_interface_is_shared_by_effusivities():
    exact = 2.0 * 8.0 * np.sqrt(0.02 / np.pi) / (1.0 + 3.0)
    loads = [HeatFlux("left", "x1", 2.0), HeatFlux("right", "x0", 6.0)]
    assert at_contact(halves(loads)) == pytest.approx((exact, exact), rel=5e-3)
    joined = halves([HeatFlux("left", "x1", 8.0)], [PERFECT])
    assert at_contact(joined) == pytest.approx((exact, exact), rel=5e-3)
    assert joined.states[-1].ties.sum() == pytest.approx(6.0 * 0.05, rel=1e-3)


@pytest.mark.claim
def test_a_band_source_that_moves_is_jaegers():
    # Half-width 1, k = α = 1, v = 2, so that Jaeger's L = v l / (2 α) is 1; edges lie between nodes.
    h, speed, first = 1.0 / 4.5, 2.0, 13 / 4.5
    body = ConductingBody(
        rectangle((0.0, -6.0), (63 * h, 0.0), (63, 16), grading=(0.0, -2.5)), Conductor(1.0, 1.0)
    )

    def scene(time: float) -> HeatScene:
        band = HeatFlux("body", "y1", lambda p: (abs(p[:, 0] - first - speed * time) < 1.0).astype(float))
        return HeatScene({"body": body}, loads=[band])

    def quasi_steady(x: float) -> float:
        edges = (0.0,) if abs(x) < 1.0 else None
        return 1.0 / np.pi * quad(lambda u: np.exp(-u) * k0(abs(u)), x - 1.0, x + 1.0, points=edges)[0]

    end = 39 * h / speed
    result = history(scene, end, step=h / speed, outputs=[end])
    top = np.flatnonzero(body.mesh.points[:, 1] == 0.0)
    x = body.mesh.points[top, 0] - first - speed * end
    near = np.abs(x) < 1.4
    exact = np.array([quasi_steady(each) for each in x[near]])
    assert near.sum() == 13
    assert np.abs(result.values[-1][top[near]] - exact).max() < 0.015 * exact.max()
    assert result.balance.stored == pytest.approx(2.0 * end, rel=1e-10)


@pytest.mark.claim
def test_heat_is_balanced_with_capacities_by_temperature():
    # A body of one temperature whose heat is T + T²/2: what enters, 0.3 t, says which.
    capacity = TemperatureTable((0.0, 100.0), (1.0, 101.0))
    body = ConductingBody(rectangle((0, 0), (1, 1), (2, 2)), Conductor(1e3, capacity))
    scene = HeatScene({"body": body}, loads=[HeatFlux("body", "x0", 3.0)])
    for scheme in ("bdf2", "euler", "crank-nicolson"):
        result = history(scene, 7.0, step=2.0, scheme=scheme)
        assert result.balance.error < 1e-12
        assert result.balance.stored == pytest.approx(21.0, rel=1e-9)
        assert result.values[-1] == pytest.approx(-1.0 + np.sqrt(1.0 + 2.0 * 21.0), rel=5e-4)
        assert all(state.balance.error < 1e-12 for state in result.states)


@pytest.mark.claim
def test_loads_that_change_with_time_heat_as_they_do_in_closed_form():
    # c L T' = −h (T − Tₐ(t)) of a thin wall, Tₐ = sin t.
    body = ConductingBody(rectangle((0, 0), (0.5, 1), (1, 1)), Conductor(1e4, 4.0))

    def scene(time: float) -> HeatScene:
        return HeatScene({"wall": body}, loads=[Convection("wall", "x0", 2.0, np.sin(time))])

    result = history(scene, 3.0, {"wall": 1.0}, tolerance=1e-2)
    t = result.times
    exact = 1.5 * np.exp(-t) + 0.5 * (np.sin(t) - np.cos(t))
    true = np.abs(result.values - exact[:, None]).max(axis=1)
    assert (true[1:] <= result.errors[1:] + 5e-5).all()  # h L / (2 k) is 5e-5
    assert result.error <= 1e-2
    assert result.balance.error < 1e-11


def test_a_steady_state_stays():
    loads = [Radiation("slab", "x1", 0.9, 300.0, constant=1e-8)]
    scene = HeatScene({"slab": SLAB}, [HeldTemperature("slab", "x0", 800.0)], loads)
    steady = solve_heat(scene, MPI.COMM_SELF)
    result = history(scene, 10.0, steady, step=5.0)
    assert result.values[-1] == pytest.approx(steady.values, abs=1e-5)


def warnings(caplog: pytest.LogCaptureFixture, scene: HeatScene, count: int, **given: Any) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        history(scene, count * given["step"], **given)
    return [each.message for each in caplog.records]


def test_steps_that_oscillate_are_reported_once(caplog: pytest.LogCaptureFixture):
    (said,) = warnings(caplog, HELD, 8, step=0.5, scheme="crank-nicolson")
    assert said.startswith("temperatures go up and down by ")
    assert said.endswith("give scheme='bdf2', or begin=4 Euler steps")
    assert not warnings(caplog, HELD, 8, step=0.5, scheme="bdf2")
    assert not warnings(caplog, HELD, 12, step=0.5, scheme="crank-nicolson", begin=4)


def test_steps_that_are_short_for_their_cells_are_reported_once(caplog: pytest.LogCaptureFixture):
    scene = HeatScene({"slab": COARSE}, HELD.held)
    limit = (2.0 / 16) ** 2 * 4.0 / 6.0
    (said,) = warnings(caplog, scene, 4, step=0.5 * limit)
    assert said.startswith("temperatures lie 1.")
    assert "degrees beyond those held" in said
    assert said.endswith("give smaller cells there, or longer steps")
    assert not warnings(caplog, scene, 4, step=1.01 * limit, scheme="euler")


OTHER = HeatScene({"slab": COARSE})
COLD = HeatScene({"slab": ConductingBody(SLAB.mesh, Conductor(1.0))})


@pytest.mark.parametrize(
    ("scene", "given", "words"),
    [
        (COLD, {}, "body 'slab' must have a heat capacity where temperatures change in time, got none"),
        (HELD, {"step": np.inf}, "step or tolerance must be positive and finite, got inf: give the length"),
        (HELD, {"scheme": "leapfrog"}, "scheme must be one of .*, or θ from 0.5 to 1, got 'leapfrog': give"),
        (HELD, {"scheme": 0.3}, "scheme must be one of .*, or θ from 0.5 to 1, got 0.3: give 'bdf2'"),
        (HELD, {"begin": 0}, "begin must be at least 1 and outputs lie above 0 and up to 4, got 0 and"),
        (HELD, {"outputs": (5.0,)}, r"up to 4, got 1 and \(5.0,\): correct them"),
        (HELD, {"initial": {"slab": np.ones(3)}}, "the initial temperature of body 'slab' must be a finite"),
        (HELD, {"initial": {"slap": 1.0}}, r"initial names body 'slap', the scene has \['slab'\]"),
        (HELD, {"initial": {}}, "initial must have body 'slab', it has none: add it"),
        (lambda t: HELD if t < 0.5 else OTHER, {}, "a scene must have the same bodies at all times, got"),
    ],
)  # fmt: skip
def test_what_is_missing_or_wrong_is_named(scene: Any, given: dict[str, Any], words: str):
    with pytest.raises(InvalidInputError, match=words):
        heat_in_time(scene, MPI.COMM_SELF, 4.0, **{"initial": 0.0, "step": 1.0, **given})


def test_steps_that_are_never_short_enough_end_the_history():
    def scene(time: float) -> HeatScene:
        return HeatScene({"slab": COARSE}, [HeldTemperature("slab", "x0", 1e9 * np.sin(1e12 * time))])

    with pytest.raises(ConvergenceError, match="at 0 shorter ones err too much: loosen the tolerance, or"):
        history(scene, 4.0, tolerance=0.5)


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import Surface
from fenics_contact.gallery import rectangle
from fenics_contact.heat import *
bodies = {
    name: ConductingBody(rectangle((x, 0.0), (x + 1.0, 0.5), (8, 5 + x)), Conductor(1.0 + x, 2.0))
    for name, x in (("left", 0), ("right", 1))
}
film = ThermalContact(Surface("right", "x0"), Surface("left", "x1"), 3.0)
def scene(time):
    return HeatScene(bodies, [HeldTemperature("left", "x0", 10.0 * time)], contacts=[film])
parts = {
    name: (body.mesh.points[body.mesh.cells].mean(axis=1)[:, 0] % 1.0 > 0.5).astype(int)
    for name, body in bodies.items()
}
result = heat_in_time(scene, MPI.COMM_WORLD, 0.2, 1.0, HOW, partitions=parts)
if MPI.COMM_WORLD.rank == 0:
    print(result.steps, result.balance.error < 1e-11, *result.values[-1].tolist())
"""


@pytest.mark.claim
@pytest.mark.parametrize(
    ("how", "ranks"),
    [("step=0.05", (1, 2)), pytest.param("tolerance=0.1", (1, 2, 4), marks=pytest.mark.slow)],
)
def test_histories_are_the_same_on_ranks(mpirun: Callable[..., str], how: str, ranks: Sequence[int]):
    one, *others = (mpirun(ON_RANKS.replace("HOW", how), number).split() for number in ranks)
    assert one[1] == "True"
    assert len(one) == 2 + 9 * 6 + 9 * 7
    for other in others:
        assert other[:2] == one[:2]
        assert np.array(other[2:], dtype=float) == pytest.approx(np.array(one[2:], dtype=float), abs=1e-8)
