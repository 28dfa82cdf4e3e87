"""Heat and mechanics that depend on each other, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidSphere,
    Scene,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.gallery.blocks import rectangle_lattice
from fenics_contact.heat import (
    ConductanceTable,
    Conductor,
    FrictionHeat,
    GapConductance,
    HeatedState,
    HeatScene,
    HeldTemperature,
    PressureConductance,
    TemperatureTable,
    ThermalContact,
    solve_heated,
)
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, TemperatureDependentElasticity
from fenics_contact.mesh.quadratic import quadratic
from tests.heat.coupled_bodies import sliding
from tests.heat.heated_bodies import ALPHA, CONDUCTIVITY, YOUNG, ends, film, rod, rubbed_rod

#: Weights of its nodes in integrals along it.
QUARTERS = np.array([0.125, 0.25, 0.25, 0.25, 0.125])


def end_of(state: HeatedState) -> float:
    """Return the temperature of the free end."""
    return float(state.heat.contacts[0].slave.mean())


def test_a_rod_that_cools_where_it_touches_has_one_state():
    for rough in (1.0, 30.0):
        (exact,) = ends(rough, 0.01, 100.0, 0.0, 0.04)
        state = solve_heated(*rod(film(rough, 0.01), 100.0, 0.0, 0.04), MPI.COMM_SELF)
        assert end_of(state) == pytest.approx(exact, rel=1e-6)
        assert state.gain < 0.0


def test_a_film_that_opens_within_a_millionth_of_the_length_has_a_state():
    # A pass returns hundreds of times what temperatures change by.
    law = PressureConductance(1.0, 1.0) + GapConductance(1e-5, least_gap=1e-6)
    (exact,) = ends(1.0, 1e-6, 100.0, 0.0, 0.08, conductivity=1e-5)
    state = solve_heated(*rod(law, 100.0, 0.0, 0.08), MPI.COMM_SELF)
    assert end_of(state) == pytest.approx(exact, rel=1e-6)
    assert state.gain < -100.0
    assert state.passes < 60


@pytest.mark.claim
def test_films_steeper_than_mechanics_is_accurate_need_a_smaller_tolerance():
    law = PressureConductance(1.0, 1.0) + GapConductance(1e-6, least_gap=1e-7)
    (exact,) = ends(1.0, 1e-7, 100.0, 0.0, 0.08, conductivity=1e-6)
    scenes = rod(law, 100.0, 0.0, 0.08)
    with pytest.raises(ConvergenceError, match=r"do not settle: after .* give a smaller tolerance if little"):
        solve_heated(*scenes, MPI.COMM_SELF)
    state = solve_heated(*scenes, MPI.COMM_SELF, tolerance=1e-12)
    assert end_of(state) == pytest.approx(exact, rel=1e-7)


@pytest.mark.claim
def test_a_block_that_touches_at_many_points_and_conducts_nowhere_else_has_a_state():
    # Each point opens and closes with its neighbours: no steady state lies between two passes.
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (12, 6))
    points = mesh.points - 1e-3 * np.outer(mesh.points.prod(axis=1), (0.0, 1.0))
    bodies = {
        "lower": Body(replace(mesh, points=points), PlaneStrain(YOUNG, 0.3, thermal_expansion=1e-4)),
        "upper": Body(rectangle((-0.2, 1.011), (2.2, 2.011), (15, 6)), PlaneStrain(10.0 * YOUNG, 0.3)),
    }
    sides = Surface("lower", "y1"), Surface("upper", "y0")
    held = [Support("lower", "y0"), Support("upper", "y1")]
    scene = Scene(bodies, held, contacts=[ContactPair(*sides)])
    ends_held = [HeldTemperature("lower", "y0", 100.0), HeldTemperature("upper", "y1", 0.0)]
    joint = ThermalContact(*sides, PressureConductance(1000.0, 1.0))
    conductors = {"lower": Conductor(1.0), "upper": Conductor(2.0)}
    heat = HeatScene.on(scene, conductors, held=ends_held, contacts=[joint])
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    again = solve_heated(scene, heat, MPI.COMM_SELF, start=state.heat.temperature)
    assert 4 < (state.mechanics.contact.normal_force > 0.0).sum() < 9
    assert state.heat.contacts[0].total > 50.0
    assert np.abs(again.heat.values - state.heat.values).max() < 1e-4
    assert state.heat.balance.error < 1e-11


@pytest.mark.claim
def test_a_rod_that_warms_where_it_touches_has_the_state_that_its_start_leads_to():
    apart, between, touching = ends(30.0, 0.02, 0.0, 100.0, 0.035)
    bodies, heat = rod(film(30.0, 0.02), 0.0, 100.0, 0.035)
    along = bodies.bodies["rod"].mesh.points[:, 0]
    for temperature, found in ((0.0, apart), (between - 1.0, apart), (between + 1.0, touching)):
        state = solve_heated(bodies, heat, MPI.COMM_SELF, start={"rod": temperature * along})
        assert end_of(state) == pytest.approx(found, rel=1e-6)
        assert state.start == "the given temperatures"
        assert 0.0 < state.gain < 1.0


@pytest.mark.claim
def test_a_rod_that_loses_all_conductance_as_it_parts_has_no_state():
    # Closed, the end is at 100/6 and the mean too cold to touch; open, at 100 and too warm to part.
    bodies, heat = rod(ConductanceTable((0.0,), (5.0,)), 100.0, 0.0, 0.08)
    with pytest.raises(ConvergenceError, match=r"no steady state.*part.*Barber.* at 16.6667 or 100 in turn"):
        solve_heated(bodies, heat, MPI.COMM_SELF)


def two_bars(hot: float, discretisation: str = "best") -> tuple[Scene, HeatScene]:
    """Return two bars of lengths 1 and 2 between walls, 0.01 apart, heated at their ends."""
    short = Body(rectangle((0.0, 0.0), (1.0, 0.5), (3, 1)), PlaneStrain(YOUNG, 0.0, thermal_expansion=ALPHA))
    long = Body(
        rectangle((1.01, 0.0), (3.01, 0.5), (4, 1)), PlaneStrain(2 * YOUNG, 0.0, thermal_expansion=2 * ALPHA)
    )
    sides = Surface("short", "x1"), Surface("long", "x0")
    held = [Support("short", "x0", (0.0, None)), Support("long", "x1", (0.0, None))]
    held += [Support(name, side, (None, 0.0)) for name in ("short", "long") for side in ("y0", "y1")]
    scene = Scene({"short": short, "long": long}, held, contacts=[ContactPair(*sides)])
    heat = HeatScene.on(
        scene,
        {"short": Conductor(3.0), "long": Conductor(1.0)},
        held=[HeldTemperature("short", "x0", hot), HeldTemperature("long", "x1", 10.0)],
        contacts=[ThermalContact(*sides, 4.0, discretisation=discretisation)],
    )
    return scene, heat


def test_two_bars_that_close_their_gap_press_each_other():
    # 1/3 + 1/4 + 2/1 of resistance between 30 and 10, strain free at 5 degrees.
    flux = 20.0 / (1.0 / 3.0 + 0.25 + 2.0)
    left, right = 0.5 * (30.0 + 30.0 - flux / 3.0) - 5.0, 0.5 * (10.0 + 10.0 + 2.0 * flux) - 5.0
    pressure = (ALPHA * left + 2.0 * ALPHA * right * 2.0 - 0.01) / (1.0 / YOUNG + 2.0 / (2.0 * YOUNG))
    assert pressure > 0.0
    state = solve_heated(*two_bars(30.0), MPI.COMM_SELF, stress_free=5.0)
    assert state.mechanics.contact.pressure == pytest.approx(pressure, rel=1e-7)
    assert state.heat.contacts[0].flux == pytest.approx(flux, rel=1e-9)
    assert state.passes == 1


@pytest.mark.parametrize("other_way", [False, True])
def test_pressures_come_from_the_pair_with_the_same_surfaces(other_way: bool):
    scene, heat = two_bars(30.0)
    (even,) = heat.contacts
    slave, master = (even.master, even.slave) if other_way else (even.slave, even.master)
    assert isinstance(slave, Surface)
    law = PressureConductance(0.5, 1.0) + GapConductance(1e-3, least_gap=0.01)
    heat = replace(heat, contacts=[ThermalContact(slave, master, law)])
    state = solve_heated(scene, heat, MPI.COMM_SELF, stress_free=5.0)
    (joint,) = state.heat.contacts
    assert joint.conductance == pytest.approx(0.5 * state.mechanics.contact.pressure + 0.1, rel=1e-9)
    resistance = 1.0 / 3.0 + 2.0 + 1.0 / joint.conductance[0]
    assert np.abs(joint.flux) == pytest.approx(20.0 / resistance, rel=1e-6)
    assert state.passes > 1


@pytest.mark.slow
def test_without_a_pair_gaps_are_what_displacements_leave():
    scene, heat = two_bars(8.0)
    heat = replace(
        heat, contacts=[replace(heat.contacts[0], conductance=GapConductance(1e-3, least_gap=1e-9))]
    )
    alone = replace(scene, contacts=[])
    found = [solve_heated(each, heat, MPI.COMM_SELF, stress_free=9.0) for each in (scene, alone)]
    flux = [each.heat.contacts[0].flux[0] for each in found]
    assert found[0].mechanics.contact.normal_force == pytest.approx(0.0)
    assert flux[0] == pytest.approx(flux[1], rel=1e-7)
    assert abs(flux[0]) > 1e-2


def test_a_ring_shrunk_on_a_shaft_loosens_as_it_heats():
    """Lamé's rings of infinite length with the heat between them, whose film follows the pressure."""
    inner, middle, outer, overlap = 1.0, 2.0, 4.0, 0.15
    young, poisson, shaft_k, ring_k, law = 1000.0, 0.3, 2.0, 1.0, PressureConductance(0.4, 1.0)

    def parts(pressure: float) -> tuple[float, float]:
        """Return the flux and the overlap that a pressure leaves, of rings in plane strain."""
        flow = 50.0 / (np.log(2.0) / shaft_k + np.log(2.0) / ring_k + 1.0 / (0.4 * pressure * middle))
        hot, cold = 50.0 - flow * np.log(2.0) / ring_k, flow * np.log(2.0) / shaft_k

        def mean(at_inner: float, at_outer: float, a: float, b: float) -> float:
            """Return the mean temperature of a ring's section, of T = c + d ln r."""
            slope = (at_outer - at_inner) / np.log(b / a)
            return at_inner + slope * (b**2 * np.log(b / a) / (b**2 - a**2) - 0.5)

        grown = (1.0 + poisson) * ALPHA * middle  # of a free surface of a ring in plane strain
        apart = grown * (mean(hot, 50.0, middle, outer) - mean(0.0, cold, inner, middle))
        lame = (1.0 + poisson) / young * middle * pressure
        ring = lame * ((1.0 - 2.0 * poisson) * middle**2 + outer**2) / (outer**2 - middle**2)
        shaft = lame * ((1.0 - 2.0 * poisson) * middle**2 + inner**2) / (middle**2 - inner**2)
        return flow / middle, overlap - apart - ring - shaft

    pressure = brentq(lambda p: parts(p)[1], 1e-6, 100.0)
    material = IsotropicElasticity(young, poisson, thermal_expansion=ALPHA)
    bodies = {
        name: Body(quadratic(rectangle((a, 0.0), (b, 0.5), (count, 1))), material, axisymmetric=True)
        for name, a, b, count in (("shaft", inner, middle, 10), ("ring", middle, outer, 12))
    }
    sides = Surface("shaft", "x1"), Surface("ring", "x0")
    flat = [Support(name, side, (None, 0.0)) for name in bodies for side in ("y0", "y1")]
    scene = Scene(bodies, flat, contacts=[ContactPair(*sides, interference=overlap)])
    cold = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)
    heat = HeatScene.on(
        scene,
        {"shaft": Conductor(shaft_k), "ring": Conductor(ring_k)},
        held=[HeldTemperature("shaft", "x0", 0.0), HeldTemperature("ring", "x1", 50.0)],
        contacts=[ThermalContact(*sides, law)],
    )
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    assert state.mechanics.contact.pressure == pytest.approx(pressure, rel=1e-3)
    assert state.heat.contacts[0].flux == pytest.approx(-parts(pressure)[0], rel=1e-4)
    assert pressure < 0.8 * cold.contact.pressure.min()


@pytest.mark.claim
def test_friction_heats_what_presses_harder_up_to_a_critical_speed():
    # p = E (δ + α T / 2) with T = μ v p / k at the end: p = E δ / (1 − v / v_c), v_c = 2 k / (E α μ) = 8.
    scene, heat = rubbed_rod(6.0)
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    assert state.mechanics.contact.pressure == pytest.approx(2.0 / (1.0 - 6.0 / 8.0), rel=1e-6)
    assert state.gain == pytest.approx(6.0 / 8.0, rel=1e-4)
    with pytest.raises(ConvergenceError, match=r"raise each other without end.*thermoelastic instability"):
        solve_heated(*rubbed_rod(20.0), MPI.COMM_SELF)


@pytest.mark.parametrize("other_way", [False, True])
def test_the_work_of_friction_forces_becomes_heat(other_way: bool):
    scene, heat = sliding(FrictionHeat(part=0.8), Coulomb(0.4), other_way=other_way)
    state = solve_heated(scene, heat, MPI.COMM_SELF, duration=0.05)
    contact, balance = state.mechanics.contact, state.heat.balance
    work = float((contact.friction_force * contact.slip).sum())
    (entered,) = (heat for name, heat in balance.by_part.items() if name.startswith("FrictionHeat"))
    assert work > 0.1
    assert entered == pytest.approx(0.8 * work / 0.05, rel=1e-7)
    assert balance.error < 1e-11
    still = solve_heated(scene, heat, MPI.COMM_SELF)
    assert still.heat.balance.by_part[next(n for n in balance.by_part if n.startswith("Fric"))] == 0.0


def test_friction_follows_the_temperature_of_both_surfaces():
    table = TemperatureTable((0.0, 20.0), (0.5, 0.1))
    scene, heat = sliding(FrictionHeat(table, 20.0), Coulomb(0.5))
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    (joint,), contact = state.heat.contacts, state.mechanics.contact
    mean = 0.5 * (joint.slave + joint.master)
    pressed = contact.normal_force > 0.0
    ratio = np.abs(contact.friction_force[pressed, 0]) / contact.normal_force[pressed]
    assert ratio == pytest.approx(table.at(mean)[pressed], rel=1e-5)
    assert mean.max() > 1.0


def test_constants_follow_the_temperatures_that_are_computed():
    soft = TemperatureDependentElasticity(
        ((0.0, 1000.0), (100.0, 500.0)), 0.0, ((0.0, 1e-3), (100.0, 2e-3)), initial_temperature=10.0
    )
    body = Body(rectangle((0.0, 0.0), (1.0, 0.5), (2, 1)), soft)
    walls = [Support("bar", side, (0.0, None)) for side in ("x0", "x1")]
    scene = Scene({"bar": body}, [*walls, Support("bar", "y0", (None, 0.0))])
    held = [HeldTemperature("bar", side, 60.0) for side in ("x0", "x1")]
    heat = HeatScene.on(scene, {"bar": Conductor(1.0)}, held=held)
    state = solve_heated(scene, heat, MPI.COMM_SELF, stress_free=10.0)
    strain = 1.6e-3 * 60.0 - 1.1e-3 * 10.0
    assert state.mechanics.gather_stress("bar")[:, 0, 0] == pytest.approx(-700.0 * strain, rel=1e-6)
    with pytest.raises(InvalidInputError, match=r"its materials, \[10.0\], got stress_free 0"):
        solve_heated(scene, heat, MPI.COMM_SELF)


@pytest.mark.slow
def test_steps_store_heat_and_end_in_the_steady_state():
    scene, heat = rod(film(1.0, 0.01), 100.0, 0.0, 0.04)
    heat = replace(heat, bodies={"rod": replace(heat.bodies["rod"], material=Conductor(CONDUCTIVITY, 2.0))})
    cold = replace(heat, held=[HeldTemperature("rod", "x0", 0.0)])
    state = solve_heated(scene, cold, MPI.COMM_SELF)
    for duration in (0.1, 0.2, 5.0, 1e4):
        before, state = state, solve_heated(scene, heat, MPI.COMM_SELF, before=state, duration=duration)
        change = state.heat.temperature["rod"] - before.heat.temperature["rod"]
        assert state.heat.balance.error < 1e-11
        stored = 2.0 * 0.25 * (QUARTERS @ change[::2]) / duration
        assert state.heat.balance.stored == pytest.approx(stored, rel=1e-6)
    (exact,) = ends(1.0, 0.01, 100.0, 0.0, 0.04)
    assert end_of(state) == pytest.approx(exact, rel=1e-3)


def test_both_fields_need_the_same_bodies_and_meshes():
    scene, heat = rod(film(1.0, 0.01), 100.0, 0.0, 0.04)
    other = replace(heat, bodies={"rod": replace(heat.bodies["rod"], mesh=rectangle((0, 0), (1, 1), (2, 2)))})
    with pytest.raises(InvalidInputError, match="need the same mesh of body 'rod', got 9 nodes for heat, 10"):
        solve_heated(scene, other, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match="heat is of body 'bar', the scene has"):
        HeatScene.on(scene, {"bar": Conductor(1.0)})
    with pytest.raises(InvalidInputError, match="stress_free needs a temperature of body 'rod', it has"):
        solve_heated(scene, heat, MPI.COMM_SELF, stress_free={"bar": 0.0})
    steady = solve_heated(scene, heat, MPI.COMM_SELF)
    with pytest.raises(
        InvalidInputError, match="a step of a time, got 2, needs heat capacities of all bodies"
    ):
        solve_heated(scene, heat, MPI.COMM_SELF, before=steady, duration=2.0)
    with pytest.raises(InvalidInputError, match="start has temperatures of body 'bar', the heat has"):
        solve_heated(scene, heat, MPI.COMM_SELF, start={"bar": 0.0})


def test_a_sphere_that_turns_on_a_large_body_heats_it_as_jaeger_says():
    # Slow sliding (Peclet number 0): π q₀ a / (4 k) below the centre of Hertz's pressure (Carslaw and Jaeger,
    # 10.5: T = ∫ q / (2 π k r) dA), and π q₀ (2 a² − r²) / (8 k a) at the radius r.
    young, poisson, radius, size, k, slip = 1000.0, 0.3, 50.0, 20.0, 0.05, 3.0
    fine, coarse = np.linspace(0.0, 1.4, 29), np.geomspace(1.4, size, 16)[1:]
    ticks = np.concatenate([fine, coarse])
    mesh = rectangle_lattice([ticks, -ticks[::-1]])
    ball, top = RigidSphere((0.0, radius), radius), Surface("body", "y1")
    scene = Scene(
        {"body": Body(mesh, IsotropicElasticity(young, poisson), axisymmetric=True)},
        [Support("body", "y0", (None, 0.021))],
        contacts=[ContactPair(top, ball)],
    )
    pressed = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9).contact
    force, modulus = float(pressed.normal_force.sum()), young / (1.0 - poisson**2)
    a = (0.75 * force * radius / modulus) ** (1.0 / 3.0)
    q = 0.2 * 1.5 * force / (np.pi * a**2) * slip

    def far(x: np.ndarray) -> np.ndarray:
        """Return the temperature far from a source at the origin."""
        return 0.2 * slip * force / (2.0 * np.pi * k * np.linalg.norm(x, axis=1))

    rubbed = ThermalContact(top, ball, 1e-9, temperature=0.0, friction=FrictionHeat(0.2, slip, share=1.0))
    cooled = [HeldTemperature("body", side, far) for side in ("x1", "y0")]
    heat = HeatScene.on(scene, {"body": Conductor(k)}, held=cooled, contacts=[rubbed])
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    top_nodes = np.flatnonzero((mesh.points[:, 1] == 0.0) & (mesh.points[:, 0] < 0.9 * a))
    r, found = mesh.points[top_nodes, 0], state.heat.temperature["body"][top_nodes]
    exact = np.pi * q * (2.0 * a**2 - r**2) / (8.0 * k * a)
    assert found == pytest.approx(exact, rel=0.01)
    assert state.heat.balance.by_part[f"FrictionHeat {rubbed.place}"] == pytest.approx(0.2 * slip * force)
    assert state.heat.balance.error < 1e-11


@pytest.mark.slow
def test_a_film_that_is_steep_but_continuous_has_a_state_where_surfaces_curve():
    # Passes alternate by more than twice their changes, at many points: no steady state lies on a line.
    ticks = np.concatenate([np.linspace(0.0, 2.8, 29), np.geomspace(2.8, 20.0, 12)[1:]])
    cold, top = RigidSphere((0.0, 50.0), 50.0), Surface("body", "y1")
    material = IsotropicElasticity(1000.0, 0.3, thermal_expansion=1e-4)
    body = Body(rectangle_lattice([ticks, -ticks[::-1]]), material, axisymmetric=True)
    lifted = Support("body", "y0", (None, 0.06))
    scene = Scene({"body": body}, [lifted], contacts=[ContactPair(top, cold)])
    law = PressureConductance(1.0, 1.0) + GapConductance(1e-5, least_gap=0.01, curved=False)
    joint = ThermalContact(top, cold, law, temperature=-100.0)
    held = [HeldTemperature("body", "y0", 0.0)]
    heat = HeatScene.on(scene, {"body": Conductor(0.05)}, held=held, contacts=[joint])
    state = solve_heated(scene, heat, MPI.COMM_SELF)
    contact, (film_there,) = state.mechanics.contact, state.heat.contacts
    expected = contact.pressure + 1e-5 / (np.maximum(contact.gap, 0.0) + 0.01)
    assert film_there.conductance == pytest.approx(expected, rel=1e-9)
    assert 10 < (contact.normal_force > 0.0).sum() < 20
    assert state.heat.balance.error < 1e-11
