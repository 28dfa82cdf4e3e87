"""What steady heat cannot be computed from, and constants that are hardly meant, in words."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface, Tie
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    Conductance,
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    HeatFlux,
    HeatObjective,
    HeatOfContact,
    HeatOfHeld,
    HeatScene,
    HeldTemperature,
    JointResistance,
    PlasticHeat,
    PressureConductance,
    Radiation,
    TemperatureMean,
    ThermalContact,
    heat_adjoint,
    heat_goal_error,
    solve_heat,
    solve_heat_to,
    solve_heated,
)
from fenics_contact.heat.conductance import Touch
from fenics_contact.heat.plausible import odd_power, odd_values
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, PlaneStrain, PlaneStress


def bars(count: int = 3, conductivity: float = 2.0, size: float = 1.0, **parts: Any) -> HeatScene:
    """Return bars a, b, c in a row."""
    bodies = {
        name: ConductingBody(
            rectangle((k * size, 0.0), ((k + 1) * size, size), (2, 2)), Conductor(conductivity)
        )
        for k, name in enumerate("abc"[:count])
    }
    return HeatScene(bodies, **parts)


def joint(slave: str, master: str, law: Any = 5.0, **own: Any) -> ThermalContact:
    return ThermalContact(Surface(slave, "x1"), Surface(master, "x0"), law, **own)


HELD = HeldTemperature("a", "x0", 20.0)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"held": [HELD], "loads": [HeatFlux("c", "x1", 3.0)], "contacts": [joint("b", "c")]},
            "needs a temperature that is given to each body, 'b' and 'c' have none and heat of HeatFlux c x1 "
            "has no way out: hold a temperature there, add Convection",
        ),
        ({"held": [HELD], "contacts": [joint("b", "c")]}, "'b' and 'c' have none and no heat: any temper"),
        ({"held": [HELD], "ties": [Tie(Surface("b", "x0"), Surface("a", "x1"))]}, "each body, 'c' have none"),
        ({}, "'a' and 'b' and 'c' have none and no heat"),
        (
            {
                "held": [HELD],
                "contacts": [joint("a", "b"), joint("b", "c", PressureConductance(1.0, 100.0))],
            },
            "'c' have none .*; no heat passes through b x1 - c x0, by conductance, pressure and gap",
        ),
        (
            {"loads": [Convection("a", "y0", 0.0, 20.0)], "contacts": [joint("a", "b"), joint("b", "c")]},
            "'a' and 'b' and 'c' have none and heat of Convection a y0 has no way out",
        ),
    ],
)
def test_bodies_without_a_temperature_are_named(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(InfeasibleError, match=message):
        solve_heat(bars(**parts), MPI.COMM_SELF)


@pytest.mark.parametrize(
    "parts",
    [
        {"held": [HELD]},
        {"loads": [Convection("a", "y0", 1e-3, 20.0)]},
        {"loads": [Radiation("a", "y0", 0.5, 20.0, constant=1e-6)]},
        {"obstacle": True},
    ],
)
def test_a_way_to_one_temperature_is_enough(parts: dict[str, Any]) -> None:
    plane = ThermalContact(Surface("a", "y0"), RigidPlane((0, 0), (0, 1)), 3.0, temperature=20.0)
    given = {name: value for name, value in parts.items() if name != "obstacle"}
    contacts = [joint("b", "c", GapConductance(0.1, 0.1)), *([plane] if "obstacle" in parts else [])]
    tie = Tie(Surface("b", "x0"), Surface("a", "x1"))
    state = solve_heat(bars(contacts=contacts, ties=[tie], **given), MPI.COMM_SELF)
    assert state.values == pytest.approx(20.0)


def test_the_conductivity_of_a_metal_in_metres_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    held = [HELD, HeldTemperature("a", "x1", 30.0)]
    for conductivity, size, warned in ((45.0, 60.0, 1), (45.0, 1.0, 0), (0.045, 60.0, 0), (2.0, 60.0, 0)):
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="fenics_contact"):
            solve_heat(bars(1, conductivity, size, held=held), MPI.COMM_SELF)
        assert len(caplog.messages) == warned
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        solve_heat(bars(1, 45.0, 60.0, held=held), MPI.COMM_SELF)
    (words,) = caplog.messages
    assert "odd units in body 'a'? a conductivity of 45 is that of a metal in W/(m K)" in words
    assert "in W and mm it would be 0.045" in words


def test_capacities_in_n_and_mm_show_that_conductivities_are_too(caplog: pytest.LogCaptureFixture) -> None:
    mesh = rectangle((0.0, 0.0), (60.0, 1.0), (2, 2))
    held = [HELD]
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        solve_heat(HeatScene({"a": ConductingBody(mesh, Conductor(45.0, 3.6))}, held), MPI.COMM_SELF)
        assert not caplog.messages
        solve_heat(HeatScene({"a": ConductingBody(mesh, Conductor(45.0, 3.6e6))}, held), MPI.COMM_SELF)
    assert len(caplog.messages) == 1


def test_the_constant_of_radiation_in_metres_is_warned_of() -> None:
    warm = [Radiation("a", "x1", 0.8, 300.0, constant=each) for each in (5.670374419e-8, 5.670374419e-14)]
    (words,) = odd_values(bars(1, 0.1, 60.0, loads=warm))
    assert "Radiation a x1? its constant is in W/(m² K⁴), the body is 60 long: in W and mm give" in words
    assert not list(odd_values(bars(1, 0.1, 1.0, loads=warm)))


def test_power_in_watts_does_not_go_with_moduli_in_newtons_and_millimetres(
    caplog: pytest.LogCaptureFixture,
) -> None:
    heat = bars(2, 0.045)
    steel, soft = PlaneStrain(2.1e5, 0.3), PlaneStrain(5.0, 0.3)
    scene = Scene({"a": Body(heat.bodies["a"].mesh, steel), "b": Body(heat.bodies["b"].mesh, soft)})
    (words,) = odd_power(scene, heat)
    assert "body 'a'? a conductivity of 0.045 is that of a metal in W/(mm K)" in words
    assert words.endswith("power is then in N mm/s and the conductivity 45")
    assert not list(odd_power(scene, bars(2, 45.0)))
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        heat, held = bars(1, 0.045, held=[HELD]), [Support("a", "x0")]
        solve_heated(Scene({"a": scene.bodies["a"]}, held), heat, MPI.COMM_SELF)
    assert caplog.messages == [words]


def plate(x: float = 0.0) -> ConductingBody:
    """Return a plate with odd numbers of cells."""
    return ConductingBody(rectangle((x, 0.0), (x + 1.0, 1.0), (3, 3)), Conductor(1.0))


def test_temperatures_that_meet_and_differ_are_named():
    held = [HeldTemperature("a", "x0", 1.0), HeldTemperature("a", "y0", 2.0)]
    with pytest.raises(InvalidInputError, match="a y0 and a x0 must agree where both meet, got 2 and 1"):
        solve_heat(HeatScene({"a": plate()}, held), MPI.COMM_SELF)
    along = HeldTemperature("a", "y0", lambda x: 1.0 + x[:, 0])
    state = solve_heat(HeatScene({"a": plate()}, [held[0], along]), MPI.COMM_SELF)
    assert state.values.max() == pytest.approx(2.0)


@pytest.mark.parametrize("how", ["node", "mortar"])
def test_temperatures_that_a_tie_joins_and_differ_are_named(how: Any):
    bodies = {"a": plate(), "b": plate(1.0)}
    held = [HeldTemperature("a", "y0", 1.0), HeldTemperature("b", "y0", 2.0)]
    tie = Tie(Surface("a", "x1"), Surface("b", "x0"), discretisation=how)
    words = r"the tie of a x1 on b x0 joins them, got 1 and 2 at \[1\. 0\.\]"
    with pytest.raises(InvalidInputError, match=words):
        solve_heat(HeatScene(bodies, held, ties=[tie]), MPI.COMM_SELF)
    level = [held[0], replace(held[1], value=1.0)]
    assert solve_heat(HeatScene(bodies, level, ties=[tie]), MPI.COMM_SELF).values == pytest.approx(1.0)


def test_temperatures_that_differ_by_rounding_agree():
    along = HeldTemperature("a", "y0", lambda x: np.sin(np.pi * x[:, 0]))
    state = solve_heat(HeatScene({"a": plate()}, [along, HeldTemperature("a", "x1", 0.0)]), MPI.COMM_SELF)
    assert state.values.max() == pytest.approx(np.sin(np.pi / 3.0))


def test_a_function_of_held_temperatures_is_named_as_one():
    held = [HeldTemperature("a", "x0", lambda x: x)]
    with pytest.raises(InvalidInputError, match="HeldTemperature on a x0 must return"):
        solve_heat(HeatScene({"a": plate()}, held), MPI.COMM_SELF)


def test_a_law_of_your_own_must_not_fall_with_the_pressure():
    class Falling(Conductance):
        def at(self, touch: Touch) -> np.ndarray:
            return 1.0 / (1.0 + touch.pressure)

    with pytest.raises(InvalidInputError, match="Falling of a x1 - b x0 must be a number at each point and"):
        ThermalContact(Surface("a", "x1"), Surface("b", "x0"), Falling())


def test_heat_does_not_pass_between_surfaces_of_one_body():
    contact = ThermalContact(Surface("a", "x1"), Surface("a", "y1"), 1.0)
    with pytest.raises(InvalidInputError, match="surfaces of two bodies, got a x1 - a y1 of one: split"):
        HeatScene({"a": plate()}, contacts=[contact])


def test_only_scenes_of_heat_are_solved_for_temperatures():
    with pytest.raises(InvalidInputError, match="must be a HeatScene, got an int"):
        solve_heat(3, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("objective", "words"),
    [
        (HeatOfContact(7), "HeatOfContact.contact must be the number of a contact of the scene, which has 0"),
        (JointResistance(-1), "JointResistance.contact must be the number of a contact"),
        (HeatOfHeld("a", "y0"), r"HeatOfHeld needs a HeldTemperature of a y0, the scene holds \['a x0'\]"),
        (TemperatureMean("q"), "TemperatureMean names body 'q', the scene has"),
        (TemperatureMean("a", "q"), "TemperatureMean names surface 'q', the body has"),
    ],
)
def test_quantities_of_what_is_not_there_are_refused(objective: HeatObjective, words: str):
    scene = HeatScene({"a": plate()}, [HeldTemperature("a", "x0", 1.0)])
    with pytest.raises(InvalidInputError, match=words):
        heat_adjoint(solve_heat(scene, MPI.COMM_SELF), objective)
    with pytest.raises(InvalidInputError, match=words):
        solve_heat_to(scene, objective, 0.1, MPI.COMM_SELF)


@pytest.mark.parametrize("exponent", [0.0, -1.0, np.inf, np.nan])
def test_powers_of_which_there_is_no_mean(exponent: float):
    with pytest.raises(InvalidInputError, match=r"TemperatureMean\.exponent must be"):
        TemperatureMean("a", exponent=exponent)


def test_heat_and_mechanics_of_other_kinds_of_bodies():
    mesh, elastic = rectangle((1.0, 0.0), (2.0, 1.0), (2, 2)), IsotropicElasticity(1e3, 0.3)
    turned = Scene({"a": Body(mesh, elastic, axisymmetric=True)}, [Support("a", "y0", (None, 0.0))])
    flat = HeatScene({"a": ConductingBody(mesh, Conductor(1.0))}, [HeldTemperature("a", "x0", 1.0)])
    words = r"both of revolution or none, got .* axisymmetric=False and True"
    with pytest.raises(InvalidInputError, match=words):
        solve_heated(turned, flat, MPI.COMM_SELF)
    thin = Scene({"a": Body(mesh, PlaneStress(1e3, 0.3, thickness=2.0))}, [Support("a", "y0")])
    with pytest.raises(InvalidInputError, match=r"need body 'a' of one thickness, .* got 1 and \[2.0\]"):
        solve_heated(thin, flat, MPI.COMM_SELF)


def test_errors_of_states_with_mechanics_are_not_estimated():
    scene = Scene({"a": Body(plate().mesh, PlaneStrain(1e3, 0.3))}, [Support("a", "y0")])
    both = solve_heated(scene, HeatScene({"a": plate()}, [HeldTemperature("a", "x0", 1.0)]), MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match="errors are estimated of temperatures alone"):
        heat_goal_error(both, TemperatureMean("a"))  # type: ignore[arg-type]


def test_contacts_that_pass_nothing_and_radiation_in_celsius_are_named(caplog: pytest.LogCaptureFixture):
    held = [HeldTemperature("a", "x0", 80.0), HeldTemperature("b", "x1", 20.0)]
    for pressure, count in ((0.0, 1), (3.0, 0)):
        caplog.clear()
        law = PressureConductance(1.0, 1.0)
        joint = ThermalContact(Surface("a", "x1"), Surface("b", "x0"), law, pressure=pressure)
        solve_heat(bars(2, held=held, contacts=[joint]), MPI.COMM_SELF)
        found = [
            each for each in caplog.messages if "no heat passes through a x1 - b x0: its conductance" in each
        ]
        assert len(found) == count
    for ambient, zero, words in ((20.0, 0.0, 1), (20.0, -273.15, 0), (300.0, 0.0, 0)):
        loads = [Radiation("a", "y0", 0.5, ambient, absolute_zero=zero)]
        odd = [
            each for each in odd_values(bars(2, held=held, loads=loads)) if "absolute_zero=-273.15" in each
        ]
        assert len(odd) == words


def test_changes_of_temperature_that_are_rounding_strain_nothing():
    # An open gap beside strains of 1e-14 is more than mechanics resolves.
    steel = IsotropicElasticity(2.1e5, 0.0, thermal_expansion=1.2e-5)
    boxes = {"a": ((0, 0, 0), (10, 2, 2)), "b": ((10.005, 0, 0), (16.005, 2, 2))}
    bodies = {name: Body(block(*ends, (3, 1, 1)), steel) for name, ends in boxes.items()}
    held = [Support("a", "x0", (0.0, None, None)), Support("b", "x1", (0.0, None, None))]
    for name in bodies:
        held += [Support(name, side, (None, 0.0, None)) for side in ("y0", "y1")]
        held += [Support(name, side, (None, None, 0.0)) for side in ("z0", "z1")]
    sides = Surface("a", "x1"), Surface("b", "x0")
    scene = Scene(bodies, held, contacts=[ContactPair(*sides)])
    law = PressureConductance(1.0, 1.0) + GapConductance(0.001, least_gap=0.01)
    for apart in (0.0, 1e-9, 1e-3):
        ends = [HeldTemperature("a", "x0", 20.0 + apart), HeldTemperature("b", "x1", 20.0 + apart)]
        conduct = {name: Conductor(50.0) for name in bodies}
        heat = HeatScene.on(scene, conduct, held=ends, contacts=[ThermalContact(*sides, law)])
        both = solve_heated(scene, heat, MPI.COMM_SELF, stress_free=20.0)
        assert not both.mechanics.contact.normal_force.any()
        moved = both.mechanics.gather_displacement("a")[:, 0].max()
        assert moved == pytest.approx(1.2e-5 * 10.0 * apart, rel=1e-5, abs=1e-12)


def test_heat_passes_between_surfaces_in_one_way():
    sides = Surface("a", "x1"), Surface("b", "x0")
    with pytest.raises(InvalidInputError, match="a x1 - b x0 by a ThermalContact and by a Tie"):
        bars(2, contacts=[ThermalContact(*sides, 1.0)], ties=[Tie(*sides[::-1])])


@pytest.mark.parametrize("given", ["5", True])
def test_numbers_are_no_words(given: Any):
    with pytest.raises(InvalidInputError, match=r"HeatFlux\.value must be a finite number"):
        HeatFlux("a", "y0", given)
    with pytest.raises(InvalidInputError, match=r"Conductor\.conductivity must be a number"):
        Conductor(given)


def test_plastic_work_becomes_heat_once():
    metal = Scene({"a": Body(plate().mesh, J2Plasticity(1e3, 0.3, 1.0))}, [Support("a", "y0")])
    heat = HeatScene.on(
        metal, {"a": Conductor(1.0, 1.0)}, loads=[PlasticHeat("a", 0.5), PlasticHeat("a", 0.4)]
    )
    with pytest.raises(InvalidInputError, match="got several PlasticHeat of 'a': add up shares"):
        solve_heated(metal, heat, MPI.COMM_SELF)


def test_arguments_of_other_kinds_are_named():
    scene = Scene({"a": Body(plate().mesh, PlaneStrain(1e3, 0.3))}, [Support("a", "y0")])
    heat = HeatScene({"a": plate()}, [HeldTemperature("a", "x0", 1.0)])
    with pytest.raises(InvalidInputError, match="scene"):
        solve_heated(heat, scene, MPI.COMM_SELF)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="limits"):
        solve_heat_to(heat, TemperatureMean("a"), 0.1, MPI.COMM_SELF, limits={"levels": 2})  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="stress_free"):
        solve_heated(scene, heat, MPI.COMM_SELF, stress_free="20")  # type: ignore[arg-type]


def test_mechanics_gives_pressures_and_needs_a_temperature_free_of_stress():
    bodies = {
        "a": Body(plate().mesh, PlaneStrain(1e3, 0.3)),
        "b": Body(plate(1.0).mesh, PlaneStrain(1e3, 0.3)),
    }
    sides = Surface("a", "x1"), Surface("b", "x0")
    scene = Scene(bodies, [Support("a", "x0"), Support("b", "x1")], contacts=[ContactPair(*sides)])
    conduct = {name: Conductor(50.0) for name in bodies}
    ends = [HeldTemperature("a", "x0", 1.0), HeldTemperature("b", "x1", 0.0)]
    for given, words in (
        (ThermalContact(*sides, 1.0, pressure=2.0), "pressures of the contact pair"),
        (ThermalContact(*sides[::-1], 1.0, pressure=lambda x: x[:, 0]), "pressures of the contact pair"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            solve_heated(scene, HeatScene.on(scene, conduct, held=ends, contacts=[given]), MPI.COMM_SELF)
    heat = HeatScene.on(scene, conduct, held=ends, contacts=[ThermalContact(*sides, 1.0)])
    with pytest.raises(InvalidInputError, match="stress_free of body 'a' must be finite"):
        solve_heated(scene, heat, MPI.COMM_SELF, stress_free=np.nan)
