"""Press fits with a given or a declared interference have Lamé's pressure, whatever the number of facets."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactProblem,
    Coulomb,
    LoadStep,
    Pressure,
    Scene,
    State,
    Support,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import quadratic
from tests.contact.press_fits import (
    INTERFERENCE,
    SEAT,
    Disc,
    clamped_pressure,
    lame,
    mean_pressure,
    press_fit,
    thick_press_fit,
)

#: Cells around, cells through each ring, and the largest error of the mean pressure.
MESHES = [(24, 8, 0.01), (96, 16, 0.002), (400, 24, 0.001)]
DISCS: list[Disc] = ["node", "mortar"]


def solved(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)


def error(state: State, **where: float) -> float:
    return abs(mean_pressure(state, **where) / lame() - 1)


@pytest.mark.parametrize("disc", DISCS)
@pytest.mark.parametrize(("around", "through", "bound"), MESHES)
def test_a_given_interference_has_lames_pressure(around: int, through: int, bound: float, disc: Disc) -> None:
    state = solved(press_fit(around, through, discretisation=disc, interference=INTERFERENCE))
    np.testing.assert_array_equal(state.contact.points.gap, -INTERFERENCE)
    assert error(state) < bound
    assert np.ptp(state.contact.pressure) < 1e-4 * lame()


@pytest.mark.parametrize("disc", DISCS)
@pytest.mark.parametrize(("around", "through", "bound"), MESHES)
def test_meshes_that_do_not_match_have_it_too(around: int, through: int, bound: float, disc: Disc) -> None:
    for measured in (False, True):
        given: Any = {"interference": "measured", "overlap": INTERFERENCE}
        given = given if measured else {"interference": INTERFERENCE}
        scene = press_fit(around, through, outside=around * 5 // 4, discretisation=disc, **given)
        state = solved(scene)
        assert error(state) < bound
        assert np.ptp(state.contact.pressure) < (0.004 if disc == "mortar" else 0.15) * lame()


def test_surfaces_reconstructed_from_96_nodes_have_it_too() -> None:
    given: Any = {"interference": "measured", "overlap": INTERFERENCE, "shapes": False}
    assert error(solved(press_fit(96, 16, outside=120, **given))) < 0.002


def test_quadratic_cells_need_few_facets() -> None:
    scene = press_fit(24, 4, interference=INTERFERENCE)
    bodies = {name: Body(quadratic(body.mesh), body.material) for name, body in scene.bodies.items()}
    assert error(solved(replace(scene, bodies=bodies))) < 0.0005


@pytest.mark.parametrize("disc", DISCS)
def test_a_quarter_between_planes_of_symmetry_has_it_too(disc: Disc) -> None:
    state = solved(press_fit(96, 16, part=0.25, discretisation=disc, interference=INTERFERENCE))
    assert error(state, part=0.25) < 0.002


@pytest.mark.parametrize("disc", DISCS)
def test_a_thin_ring_in_space_has_it_too(disc: Disc) -> None:
    state = solved(thick_press_fit(48, 12, 2.0, discretisation=disc, interference=INTERFERENCE))
    assert error(state, part=0.25, thickness=2.0) < 0.003


def test_the_pressure_follows_an_interference_that_varies() -> None:
    def waves(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(points[:, 1], points[:, 0])
        return np.asarray(INTERFERENCE * (1.0 + 0.2 * np.cos(4 * angle)))

    state = solved(press_fit(96, 16, discretisation="mortar", interference=waves))
    contact = state.contact
    even = solved(press_fit(96, 16, discretisation="mortar", interference=INTERFERENCE)).contact
    assert error(state) < 0.002
    point = state.scene.bodies["hub"].mesh.points[contact.points.slave - contact.points.slave.min()]
    more, less = np.abs(point).max(axis=1) > 0.999 * SEAT, np.abs(point[:, 0] - point[:, 1]) < 1e-9
    assert more.sum() == 4
    assert (contact.pressure[more] > 1.2 * even.pressure[more]).all()
    assert (contact.pressure[less] < 0.8 * even.pressure[less]).all()


def test_a_clearance_takes_what_closes_it() -> None:
    scene = replace(press_fit(96, 16, part=0.25, gap=0.01), loads=[Pressure("hub", "outer", 20.0)])
    open_, alone = solved(scene), solved(replace(scene, loads=[Pressure("hub", "outer", 40.0)]))
    assert open_.contact.normal_force.max() == 0.0
    closing = 0.01 - open_.contact.gap
    assert np.ptp(closing) < 1e-6
    # The hub alone comes closer in proportion; what is left of twice the pressure presses on the shaft.
    touched = 20.0 * 0.01 / closing.mean()
    assert 20.0 < touched < 40.0
    share = mean_pressure(alone) / (40.0 - touched)
    more = solved(replace(scene, loads=[Pressure("hub", "outer", 80.0)]))
    assert mean_pressure(more) / (80.0 - touched) == pytest.approx(share, rel=1e-3)


def test_an_interference_stays_over_load_steps() -> None:
    scene = press_fit(24, 8, interference=INTERFERENCE)
    steps = [LoadStep(f"{p:g}", loads=[Pressure("hub", "outer", p)]) for p in (0.0, 50.0, 0.0)]
    first, pressed, last = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps)
    assert mean_pressure(pressed) > mean_pressure(first) + 20.0
    assert mean_pressure(last) == pytest.approx(mean_pressure(first), rel=1e-6)


@pytest.mark.parametrize("around", [96, 400])
def test_overlap_without_a_word_is_refused_or_told(around: int, caplog: pytest.LogCaptureFixture) -> None:
    scene = press_fit(around, 8, overlap=INTERFERENCE)
    if around == 400:
        match = r"up to 0\.05 inside .*declare the overlap by ContactPair\(interference='measured'\), or give"
        with pytest.raises(InvalidInputError, match=match):
            solved(scene)
        return
    with caplog.at_level(logging.WARNING):
        silent = solved(scene)
    (told,) = [record.getMessage() for record in caplog.records]
    assert "surfaces of hub inner on shaft outer overlap by up to 0.05 before they are loaded" in told
    declared = solved(press_fit(around, 8, overlap=INTERFERENCE, interference="measured"))
    np.testing.assert_array_equal(silent.contact.normal_force, declared.contact.normal_force)


@pytest.mark.parametrize("friction", [None, Coulomb(0.2)])
@pytest.mark.parametrize("disc", DISCS)
def test_an_interference_alone_loads_bodies_that_are_held(disc: Disc, friction: Coulomb | None) -> None:
    scene = press_fit(96, 16, discretisation=disc, interference=INTERFERENCE, friction=friction)
    held = [Support("shaft", "inner", (0.0, 0.0)), Support("hub", "outer", (0.0, 0.0))]
    for tolerance in (1e-6, 1e-10):
        state = solve_scene(replace(scene, supports=held), MPI.COMM_SELF, tolerance=tolerance)
        assert state.counts["f_products"] < 100
        assert mean_pressure(state) == pytest.approx(clamped_pressure(), rel=0.002)


@pytest.mark.parametrize("disc", DISCS)
def test_friction_holds_the_torque_of_the_pressure(disc: Disc) -> None:
    scene = press_fit(48, 12, discretisation=disc, interference=INTERFERENCE, friction=Coulomb(0.2))

    def turned(angle: float) -> list[Support]:
        way = (lambda x: -angle * x[:, 1], lambda x: angle * x[:, 0])
        return [Support("shaft", "inner", way), Support("hub", "outer", (0.0, 0.0))]

    steps = [LoadStep(f"{angle:g}", supports=turned(angle)) for angle in (0.0, 0.01, 0.02)]
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8), steps)
    limits = [0.2 * state.contact.normal_force.sum() * SEAT for state in states]
    torques = [abs(float(state.resultants((0.0, 0.0)).contacts[0].moment)) for state in states]
    assert mean_pressure(states[0]) == pytest.approx(clamped_pressure(), rel=0.005)
    assert torques[0] < 1e-6 * limits[0]
    for torque, limit in zip(torques[1:], limits[1:], strict=True):
        assert torque == pytest.approx(limit, rel=0.005)
    assert limits[1] == pytest.approx(limits[0], rel=0.01)
