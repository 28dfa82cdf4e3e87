"""Bodies whose temperatures and deformation depend on each other, by variables: numbers, laws and shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface, Tie
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    Conductance,
    Conductor,
    Convection,
    FrictionHeat,
    GapConductance,
    HeatScene,
    HeatSource,
    HeldTemperature,
    PressureConductance,
    TemperatureTable,
    ThermalContact,
)
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.quadratic import quadratic

Scenes = tuple[Scene, HeatScene]

#: Of Barber's rod: Young's modulus, expansion, conductivity, length, clearance, all without dimension.
YOUNG, ALPHA, CONDUCTIVITY = 1000.0, 1e-3, 1.0

#: Conductivity, film, temperature that is held, how far a surface bulges, thermal expansion.
GAP = np.array([1.5, 3.0, 80.0, 0.05, 4e-4])
#: Conductivity, hardness, temperature that is held, interference, thermal expansion.
RING = np.array([2.0, 1.0, 20.0, 0.2, 1e-3])
#: Conductivity, film, how far a block is pushed, and pressed, thermal expansion.
RUB = np.array([1.5, 2.0, 0.3, 0.01, 1e-5])
#: As for the gap, of surfaces that touch in part.
CURVED = np.array([1.5, 3.0, 60.0, 0.02, 1e-5])
#: Conductivity, thickness, temperature that is held, how far a side bulges, thermal expansion.
LAYERS = np.array([1.5, 0.7, 60.0, 0.05, 4e-4])
#: As for the gap, of cubes whose sides lean.
CUBES = np.array([1.5, 3.0, 60.0, 0.05, 4e-4])
#: As for surfaces that touch in part, where nothing does.
APART = np.array([1.5, 3.0, 60.0, 0.02, 1e-4])


def bulging(mesh: BodyMesh, far: float, middle: float, height: float) -> BodyMesh:
    """Lift the lower side of a body by a parabola that ends at a height."""
    points = mesh.points.copy()
    points[:, 1] += far * (points[:, 0] - middle) ** 2 * (height - points[:, 1])
    return mesh.moved(points)


def gap_that_closes(p: np.ndarray) -> Scenes:
    """Return two blocks, 0.01 apart, that grow until they press each other."""
    k, film, hot, far, expansion = p
    material = PlaneStrain(1000.0, 0.3, thermal_expansion=expansion)
    upper = bulging(rectangle((0.1, 1.01), (0.9, 2.0), (3, 3)), far, 0.5, 2.0)
    bodies = {
        "lower": Body(rectangle((0.0, 0.0), (1.0, 1.0), (4, 3)), material),
        "upper": Body(upper, material),
    }
    sides = Surface("upper", "y0"), Surface("lower", "y1")
    held = [Support("lower", "y0"), Support("upper", "y1")]
    law = PressureConductance(0.2, 1.0, 0.95) + GapConductance(1e-2, least_gap=0.01)
    scene = Scene(bodies, held, contacts=[ContactPair(*sides)])
    return scene, HeatScene.on(
        scene,
        {"lower": Conductor(k), "upper": Conductor(2.0)},
        held=[HeldTemperature("upper", "y1", hot)],
        loads=[Convection("lower", "y0", film, 10.0), HeatSource("lower", 30.0)],
        contacts=[ThermalContact(*sides, law)],
    )


def touching_in_part(p: np.ndarray, *, other_way: bool = False, apart: bool = False) -> Scenes:
    """Return a block with a curved side on another one; `apart`: above it, without a contact pair."""
    k, film, hot, far, expansion = p
    material = PlaneStrain(1000.0, 0.3, thermal_expansion=expansion)
    upper = bulging(rectangle((0.0, 1.0 + 0.01 * apart), (1.0, 2.0), (6, 3)), far, 0.4, 2.0)
    bodies = {
        "lower": Body(rectangle((0.0, 0.0), (1.0, 1.0), (6, 3)), material),
        "upper": Body(upper, material),
    }
    sides = Surface("upper", "y0"), Surface("lower", "y1")
    pressed = Support("upper", "y1", (0.0, 0.02 if apart else -0.004))
    pairs = [] if apart else [ContactPair(*sides)]
    scene = Scene(bodies, [Support("lower", "y0"), pressed], contacts=pairs)
    law = PressureConductance(0.5, 1.0) + GapConductance(1e-2, 0.01)
    return scene, HeatScene.on(
        scene,
        {"lower": Conductor(k), "upper": Conductor(2.0)},
        held=[HeldTemperature("upper", "y1", hot)],
        loads=[Convection("lower", "y0", film, 0.0)],
        contacts=[ThermalContact(*(sides[::-1] if other_way else sides), law)],
    )


def layers(p: np.ndarray) -> Scenes:
    """Return a block under a tied layer that grows against another block, and one without heat."""
    k, thickness, hot, far, expansion = p
    material = PlaneStrain(1000.0, 0.3, thermal_expansion=expansion, thickness=thickness)
    meshes = {
        "beside": rectangle((3.0, 0.0), (4.0, 1.0), (1, 1)),
        "upper": rectangle((0.1, 1.305), (0.9, 2.0), (3, 2)),
        "layer": rectangle((0.0, 1.0), (1.0, 1.3), (3, 1)),
        "lower": bulging(rectangle((0.0, 0.0), (1.0, 1.0), (4, 3)), far, 0.5, 1.0),
    }
    bodies = {name: Body(mesh, material) for name, mesh in meshes.items()}
    sides = Surface("upper", "y0"), Surface("layer", "y1")
    tie = Tie(Surface("layer", "y0"), Surface("lower", "y1"))
    held = [Support("lower", "y0"), Support("upper", "y1"), Support("beside", "y0")]
    scene = Scene(bodies, held, contacts=[ContactPair(*sides)], ties=[tie])
    law = PressureConductance(0.05, 1.0) + GapConductance(1e-2, 0.01)
    return scene, HeatScene.on(
        scene,
        {"lower": Conductor(k), "layer": Conductor(3.0), "upper": Conductor(2.0)},
        held=[HeldTemperature("upper", "y1", hot)],
        loads=[Convection("lower", "y0", 2.0, 0.0)],
        contacts=[ThermalContact(*sides, law)],
    )


def cubes(p: np.ndarray, lower: BodyMesh) -> Scenes:
    """Return a cube of given cells that grows against one of hexahedra."""
    k, film, hot, far, expansion = p
    points = lower.points.copy()
    points[:, 0] += far * np.sin(2.0 * points[:, 2]) * points[:, 0]
    material = IsotropicElasticity(1000.0, 0.3, thermal_expansion=expansion)
    upper = block((0.0, 0.0, 1.005), (1.0, 1.0, 2.0), (2, 2, 2))
    bodies = {"lower": Body(lower.moved(points), material), "upper": Body(upper, material)}
    sides = Surface("lower", "z1"), Surface("upper", "z0")
    held = [Support("lower", "z0"), Support("upper", "z1")]
    scene = Scene(bodies, held, contacts=[ContactPair(*sides)])
    law = PressureConductance(0.05, 1.0) + GapConductance(1e-2, 0.01)
    return scene, HeatScene.on(
        scene,
        {"lower": Conductor(k), "upper": Conductor(2.0)},
        held=[HeldTemperature("upper", "z1", hot)],
        loads=[Convection("lower", "z0", film, 0.0)],
        contacts=[ThermalContact(*sides, law)],
    )


def shrink_fit(p: np.ndarray) -> Scenes:
    """Return a ring that is shrunk on a shaft and heats."""
    k, hardness, hot, overlap, expansion = p
    material = IsotropicElasticity(1000.0, 0.3, thermal_expansion=expansion)
    bodies = {
        name: Body(quadratic(rectangle((a, 0.0), (b, 0.5), (count, 1))), material, axisymmetric=True)
        for name, a, b, count in (("shaft", 1.0, 2.0, 4), ("ring", 2.0, 4.0, 5))
    }
    sides = Surface("shaft", "x1"), Surface("ring", "x0")
    flat = [Support(name, side, (None, 0.0)) for name in bodies for side in ("y0", "y1")]
    scene = Scene(bodies, flat, contacts=[ContactPair(*sides, interference=overlap)])
    return scene, HeatScene.on(
        scene,
        {"shaft": Conductor(k), "ring": Conductor(1.0)},
        held=[HeldTemperature("shaft", "x0", 0.0), HeldTemperature("ring", "x1", hot)],
        contacts=[ThermalContact(*sides, PressureConductance(0.4, hardness))],
    )


def rubbing(
    p: np.ndarray, *, dim: int = 2, speed: float = 20.0, falling: bool = False, how: str = "node"
) -> Scenes:
    """Return a block that rubs on another one; `falling`: friction falls with the temperature."""
    k, film, pushed, pressed, expansion = p
    make, solid = ((rectangle, PlaneStrain), (block, IsotropicElasticity))[dim - 2]
    material, up = solid(1000.0, 0.3, thermal_expansion=expansion), "yz"[dim - 2]
    ends = {"lower": ((0.0, 0.0, 0.0), (3.0, 1.0, 1.0)), "upper": ((0.5, 0.1, 1.0), (1.5, 0.8, 2.0))}
    cells = {"lower": ((9, 2), (5, 2, 2)), "upper": ((4, 3), (2, 2, 2))}
    chosen = [0, 2] if dim == 2 else [0, 1, 2]
    bodies = {
        name: Body(make(*(np.array(end)[chosen] for end in ends[name]), cells[name][dim - 2]), material)
        for name in ends
    }
    sides = Surface("upper", f"{up}0"), Surface("lower", f"{up}1")
    moved = (pushed, -pressed) if dim == 2 else (pushed, 0.3 * pushed, -pressed)
    held = [Support("lower", f"{up}0"), Support("upper", f"{up}1", moved)]
    scene = Scene(bodies, held, contacts=[ContactPair(*sides, Coulomb(0.4), discretisation=how)])
    coefficient = TemperatureTable((0.0, 100.0), (0.5, 0.1)) if falling else 0.3
    rubbed = FrictionHeat(coefficient, speed, share=0.4)
    law = PressureConductance(3.0, 1.0) + GapConductance(0.5, 0.1)
    return scene, HeatScene.on(
        scene,
        {"lower": Conductor(k, 1.0), "upper": Conductor(2.0, 1.0)},
        held=[HeldTemperature("upper", f"{up}1", 0.0)],
        loads=[Convection("lower", f"{up}0", film, 5.0)],
        contacts=[ThermalContact(*sides, law, friction=rubbed, discretisation=how)],
    )


def rod(law: Conductance, fixed: float, wall: float, clearance: float) -> tuple[Scene, HeatScene]:
    """Return a rod of length 1 whose left end is held, at one temperature, before a wall at another one."""
    material = PlaneStrain(YOUNG, 0.0, thermal_expansion=ALPHA)
    body = Body(rectangle((0.0, 0.0), (1.0, 0.25), (4, 1)), material)
    plane, end = RigidPlane((1.0 + clearance, 0.0), (-1.0, 0.0)), Surface("rod", "x1")
    scene = Scene(
        {"rod": body},
        [Support("rod", "x0", (0.0, None)), *(Support("rod", side, (None, 0.0)) for side in ("y0", "y1"))],
        contacts=[ContactPair(end, plane)],
    )
    joint = ThermalContact(end, plane, law, temperature=wall)
    held = [HeldTemperature("rod", "x0", fixed)]
    return scene, HeatScene.on(scene, {"rod": Conductor(CONDUCTIVITY)}, held=held, contacts=[joint])


def film(rough: float, least: float) -> Conductance:
    """Return h = rough p + 0.001 / (g + least)."""
    return PressureConductance(rough, 1.0) + GapConductance(1e-3, least_gap=least)


def ends(
    rough: float, least: float, fixed: float, wall: float, clearance: float, conductivity: float = 1e-3
) -> list[float]:
    """Return the temperatures that the free end may have: roots of k (T_A − T) = h(p, g) (T − T_B)."""

    def excess(end: float) -> float:
        over = ALPHA * 0.5 * (fixed + end) - clearance
        h = rough * YOUNG * max(over, 0.0) + conductivity / (max(-over, 0.0) + least)
        return CONDUCTIVITY * (fixed - end) - h * (end - wall)

    low, high = sorted([fixed, wall])
    at = np.linspace(low - 1e-9, high + 1e-9, 4001)
    values = [excess(x) for x in at]
    change = [k for k in range(len(at) - 1) if values[k] * values[k + 1] < 0.0]
    return [brentq(excess, at[k], at[k + 1], xtol=1e-13) for k in change]


def rubbed_rod(speed: float) -> tuple[Scene, HeatScene]:
    """Return a rod pressed by 0.002 of its length against an insulating wall that slides on its end."""
    scene, heat = rod(PressureConductance(1.0, 1.0), 0.0, 0.0, 0.0)
    scene = replace(scene, contacts=[replace(scene.contacts[0], interference=2e-3)])
    rubbing = FrictionHeat(0.25, speed, share=1.0)
    (joint,) = heat.contacts
    return scene, replace(heat, contacts=[replace(joint, conductance=1e-9, friction=rubbing)])
