"""Load steps that are followed in parts: one step of every history, however they are cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidPlane,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact._large_deformations import moving_contact as meeting
from fenics_contact._large_deformations.loading import Loading
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import J2Plasticity, NeoHooke

SIZE = (2.0, 1.0)
RUBBER, METAL = NeoHooke(1000.0, 0.3), J2Plasticity(1000.0, 0.3, 4.0, 50.0)


def dragged(material: NeoHooke | J2Plasticity, obstacle: RigidObstacle, way: tuple[float, float]) -> Scene:
    """A block on which an obstacle is pressed until time 1, and drawn along, a little back, until time 2."""
    across, down = way

    def path(time: float) -> tuple[None, tuple[float, float]]:
        along = max(time - 1.0, 0.0)
        return None, (across * along * (4.0 - 3.0 * along), -down * min(time, 1.0))

    moving = MovingObstacle(obstacle, path)
    low = Body(rectangle((0.0, 0.0), SIZE, (8, 4)), material)
    pair = ContactPair(Surface("low", "y1"), moving, Coulomb(0.3))
    return Scene({"low": low}, [Support("low", "y0")], contacts=[pair])


def pressed_by_supports(material: NeoHooke | J2Plasticity) -> tuple[Scene, list[LoadStep]]:
    """The same on a plane that stands still, for bodies that do not move far."""
    low = Body(rectangle((0.0, 0.0), SIZE, (8, 4)), material)
    pair = ContactPair(Surface("low", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), Coulomb(0.3))
    at = [[Support("low", "y1", place)] for place in ((0.0, 0.0), (0.0, -0.02), (0.008, -0.02))]
    scene = Scene({"low": low}, at[0], contacts=[pair])
    return scene, [LoadStep(f"{k}", supports=at[k], time=float(k)) for k in (1, 2)]


def followed(scene: Scene, how: AutomaticSteps, steps: list[LoadStep] | None = None) -> list[DeformedState]:
    steps = steps or [LoadStep("down", time=1.0), LoadStep("along", time=2.0)]
    found = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10, steps=how), steps)
    states = [state for state in found if isinstance(state, DeformedState)]
    assert len(states) == 2
    return states


def difference(found: State, other: State) -> float:
    force = found.contact.force
    return float(np.abs(force - other.contact.force).max() / np.abs(force).max())


def plane() -> tuple[Scene, None]:
    return dragged(RUBBER, RigidPlane((0.0, 1.0), (0.0, -1.0)), (0.12, 0.1)), None


def metal() -> tuple[Scene, list[LoadStep]]:
    return pressed_by_supports(METAL)


@pytest.mark.parametrize("posed", [plane, metal])
def test_friction_and_plastic_flow_do_not_depend_on_how_a_load_step_is_cut(
    posed: Callable[[], tuple[Scene, list[LoadStep] | None]],
) -> None:
    """On a plane with large deformations, and with plastic flow and small ones."""
    scene, steps = posed()
    in_parts = AutomaticSteps(first=0.3)
    each_a_step = replace(in_parts, finer_history=True)
    whole, parts, finer = (followed(scene, how, steps) for how in (AutomaticSteps(), in_parts, each_a_step))
    for one, cut, history in zip(whole, parts, finer, strict=True):
        assert one.fractions == (1.0,)
        assert len(cut.fractions) == len(history.fractions) > 1
        products = [line.products for line in cut.solution.history]
        assert min(np.diff(products)) > 0, "they are counted on from part to part"
        assert products[-1] == cut.counts["f_products"]
        assert one.contact.slip_bound @ np.abs(one.contact.slip) > 0.0, "something slips"
        np.testing.assert_allclose(cut.contact.slip, one.contact.slip, atol=1e-8)
        assert difference(one, cut) < 1e-7
        assert one.history.values.keys() == cut.history.values.keys()
        for name, values in one.history.values.items():
            np.testing.assert_allclose(cut.history.values[name], values, atol=1e-8)
        assert cut.since == one.since == 0.0
        assert history.since == history.fractions[-2]
        assert f"histories begin anew at {history.since:.3g}" in str(history)
    apart = [difference(one, history) for one, history in zip(whole, finer, strict=True)]
    assert max(apart) > 1e-3, f"the way to the same place matters: {apart}"


def test_parts_that_the_search_needs_have_the_friction_of_one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = dragged(RUBBER, RigidSphere((0.6, 1.5), 0.5), (0.6, 0.1))
    cut = followed(scene, AutomaticSteps())
    assert len(cut[-1].fractions) > 1, "the disc passes several facets"
    monkeypatch.setattr(meeting, "FACETS", 100.0)
    whole = followed(scene, AutomaticSteps())
    assert whole[-1].fractions == (1.0,)
    assert difference(whole[-1], cut[-1]) < 1e-7


def test_a_plane_that_passes_many_facets_needs_no_parts() -> None:
    scene = dragged(RUBBER, RigidPlane((0.0, 1.0), (0.0, -1.0)), (20.0, 0.1))
    assert followed(scene, AutomaticSteps())[-1].fractions == (1.0,)


def blown(first: Callable[[float], float] | float, last: Callable[[float], float] | float) -> list[Loading]:
    """What acts after two load steps of a cube, with pressures that follow, the times being 1 and 2."""
    scene = Scene({"cube": Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), RUBBER)}, [Support("cube", "z0")])

    def gas(value: Callable[[float], float] | float) -> object:
        if callable(value):
            return lambda time: [Pressure("cube", "z1", value(time))]
        return [Pressure("cube", "z1", value)]

    steps = [LoadStep(f"{k}", loads=gas(value), time=k) for k, value in ((1.0, first), (2.0, last))]  # type: ignore[arg-type]
    return [state.load for state in followed(scene, AutomaticSteps(), steps)]


def lift(load: Loading) -> float:
    """The force of the pressures on the cube stretched by two across them, where they follow."""
    torn = load.torn
    stretched = np.concatenate(
        [mesh.space.tabulate_dof_coordinates() * [1.0, 0.0, 0.0] for mesh in torn.decomposition.meshes]
    )
    return float(load.at(stretched.ravel())[0].reshape(-1, 3)[:, 2].sum())


def test_on_the_way_to_another_pressure_the_old_one_goes_as_the_new_one_comes() -> None:
    before, after = blown(10.0, 30.0)
    assert lift(after) == pytest.approx(-2.0 * 30.0)
    assert lift(after.between(before, 0.25)) == pytest.approx(-2.0 * 15.0)


def test_a_pressure_that_is_a_function_of_time_has_its_value_at_every_part() -> None:
    before, after = blown(10.0, lambda time: 30.0 * (time - 1.0) ** 2)
    assert lift(after) == pytest.approx(-2.0 * 30.0)
    assert lift(after.between(before, 0.5)) == pytest.approx(-2.0 * 7.5)
