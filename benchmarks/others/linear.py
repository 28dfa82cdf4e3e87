"""Problems of linear elasticity."""

from __future__ import annotations

from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.others.meshes import half_ring, rounded_punch
from benchmarks.others.rows import Row, accurately
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    Scene,
    Support,
    Surface,
    TotalForce,
    gallery,
    solve_scene,
    solve_to,
)
from fenics_contact.design import Movement, PeakPressure, TotalPotential
from fenics_contact.gallery.blocks import split_quadrilaterals
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, PlaneStress, StVenantKirchhoff
from fenics_contact.mesh import quadratic
from fenics_contact.theory import contact_modulus, hertz_line, pin_in_hole

STEEL, ALUMINIUM, POISSON = 2.1e5, 7e4, 0.3


def roller(friction: float) -> Scene:
    """Half of a steel roller of radius 50 mm on an aluminium block of 200 x 200 mm, in plane strain.

    The 17.5 kN/mm act on the plane through the roller's axis, far from the contact.
    """
    round_ = split_quadrilaterals(gallery.half_disc(50.0, 6, grading=1.5))
    block = gallery.rectangle((0.0, -200.0), (100.0, 0.0), (8, 16), "triangle")
    return Scene(
        {
            "roller": Body(round_, PlaneStrain(STEEL, POISSON)),
            "block": Body(block, PlaneStrain(ALUMINIUM, POISSON)),
        },
        [
            Support("roller", "x0", (0.0, None)),
            Support("block", "x0", (0.0, None)),
            Support("block", "y0", (0.0, 0.0)),
        ],
        [TotalForce("roller", "top", (0.0, -17500.0))],
        [_pair(Surface("block", "y1"), Surface("roller", "contact"), friction)],
    )


def _pair(slave: Surface, master: Surface, friction: float) -> ContactPair:
    return ContactPair(slave, master, Coulomb(friction) if friction else None, "mortar")


def roller_rows() -> list[Row]:
    """NAFEMS R0094-1."""
    modulus = contact_modulus(STEEL, POISSON, ALUMINIUM, POISSON)
    peak = hertz_line(35e3, 1 / 50.0, modulus).peak_pressure
    scene = roller(0.0)
    pole = _node(scene, "block", (0.0, 0.0))
    linear = accurately(
        scene, Movement("block", pole, (0.0, 1.0)), 5e-4,
        quantity="u_y of the block under the pole, μ 0 [mm]",
        source="none in small strain",
    )  # fmt: skip
    return [
        accurately(
            scene, PeakPressure(0), 0.002, quantity="largest pressure, μ 0 [N/mm²]", reference=peak,
            source="Hertz, half planes", margin=0.005, others="code_aster 3503 to 3814, by its mesh",
        ),
        linear,
        enlarged(scene, linear, pole),
    ]  # fmt: skip


def enlarged(scene: Scene, linear: Row, pole: int) -> Row:
    """Return the way of the pole with large deformations: by how these change it on two meshes."""
    changes, began = [], process_time()
    for accuracy in (0.02, 0.004):
        small = solve_to(scene, PeakPressure(0), accuracy, MPI.COMM_SELF).state
        moduli = {"roller": STEEL, "block": ALUMINIUM}
        bodies = {
            name: replace(body, material=StVenantKirchhoff(moduli[name], POISSON))
            for name, body in small.scene.bodies.items()
        }
        large = solve_scene(replace(small.scene, bodies=bodies), MPI.COMM_SELF)
        changes.append(float(np.subtract(*(s.gather_displacement("block")[pole, 1] for s in (large, small)))))
    return replace(
        linear, quantity="the same, large deformations [mm]", value=linear.value + changes[-1],
        error=linear.error + abs(changes[1] - changes[0]),
        reference=-1.308019, source="code_aster, quadratic",
        others="code_aster -1.30690, -1.30802, -1.30676, -1.30809", seconds=process_time() - began, levels=(),
    )  # fmt: skip


def _node(scene: Scene, body: str, place: tuple[float, float]) -> int:
    """Return the number of the node at a place, which refined meshes keep."""
    return int(np.argmin(np.linalg.norm(scene.bodies[body].mesh.points - np.array(place), axis=1)))


def punch(friction: float, size: float = 10.0) -> Scene:
    """A steel punch with a rounded edge on an aluminium cylinder of radius 100 and height 200 mm."""
    below = gallery.rectangle((0.0, -200.0), (100.0, 0.0), (round(100 / size), round(200 / size)), "triangle")
    return Scene(
        {
            "punch": Body(rounded_punch(size), IsotropicElasticity(STEEL, POISSON), axisymmetric=True),
            "foundation": Body(below, IsotropicElasticity(ALUMINIUM, POISSON), axisymmetric=True),
        },
        [Support("foundation", "y0", (0.0, 0.0))],
        [Pressure("punch", "top", 100.0)],
        [_pair(Surface("punch", "contact"), Surface("foundation", "y1"), friction)],
    )


def punch_rows() -> list[Row]:
    """NAFEMS R0094-2: by linear cells, and the peak by quadratic cells as well, refined on their own."""
    rows = []
    moved = {0.0: -0.132941, 0.1: -0.130794}
    for friction in (0.0, 0.1):
        scene = punch(friction)
        bodies = {name: replace(body, mesh=quadratic(body.mesh)) for name, body in scene.bodies.items()}
        check = accurately(
            replace(scene, bodies=bodies), PeakPressure(0), 0.002,
            quantity=f"the same by quadratic cells, μ {friction:g} [N/mm²]",
        )  # fmt: skip
        centre = Movement("foundation", _node(scene, "foundation", (0.0, 0.0)), (0.0, 1.0))
        rows += [
            accurately(
                scene, PeakPressure(0), 0.002,
                quantity=f"largest pressure, at the edge, μ {friction:g} [N/mm²]",
                reference=check.value, source="quadratic cells here", margin=check.error / check.value,
                others="Marc, Abaqus, solids4foam 230 to 430, by mesh",
            ),
            check,
            accurately(
                scene, centre, 1e-3, quantity=f"u_z of the foundation on the axis, μ {friction:g} [mm]",
                reference=moved[friction], source="code_aster, quadratic", margin=0.002,
                others="code_aster, linear -0.130734" if not friction else "code_aster, linear -0.128580",
            ),
        ]  # fmt: skip
    return rows


def pin(friction: float = 0.0) -> Scene:
    """Half of a pin of radius 59.99 mm in the bore of radius 60 mm of a large disc, in plane stress.

    The force acts on a hole of radius 3 mm at the pin's centre.
    """
    clearance = 0.01
    shaft = half_ring(3.0, 60.0 - clearance, (6, 16), grading=-1.0)
    disc = half_ring(60.0, 1000.0, (8, 16), grading=3.0)
    low = np.array([0.0, -clearance])
    bodies = {
        "pin": Body(shaft.placed(np.eye(2), low), PlaneStress(STEEL, POISSON)),
        "disc": Body(disc, PlaneStress(STEEL, POISSON)),
    }
    cuts = [Support(name, side, (0.0, None)) for name in bodies for side in ("below", "above")]
    return Scene(
        bodies,
        [*cuts, Support("disc", "outer")],
        [TotalForce("pin", "inner", (0.0, -937.5))],
        [_pair(Surface("disc", "inner"), Surface("pin", "outer"), friction)],
    )


def pin_rows() -> list[Row]:
    """SSNV127."""
    exact = pin_in_hole(1875.0, 60.0, 0.01, STEEL / 2.0).peak_pressure
    known: dict[str, Any] = {
        "source": "Persson, frictionless",
        "others": "code_aster, μ 0.4, off by up to 12.6 %",
    }
    return [
        accurately(
            pin(), PeakPressure(0), 0.002,
            quantity="largest pressure, μ 0 [N/mm²]", reference=exact, margin=0.003,
            **known,
        ),
        accurately(
            pin(0.4), PeakPressure(0), 0.005,
            quantity="largest pressure, μ 0.4 [N/mm²]", source="none with friction",
        ),
    ]  # fmt: skip


def flat_punch(slab_held: list[Support]) -> Scene:
    """Half of a flat, rigid punch of 20 mm on a slab of 400 x 200 mm, in plane stress."""
    slab = gallery.rectangle((0.0, -200.0), (200.0, 0.0), (20, 20), "triangle")
    stamp = gallery.rectangle((0.0, 0.0), (10.0, 10.0), (2, 2), "triangle")
    bodies = {
        "slab": Body(slab, PlaneStress(2e5, POISSON)),
        "punch": Body(stamp, PlaneStress(2e9, POISSON)),
    }
    cuts = [Support(name, "x0", (0.0, None)) for name in bodies]
    return Scene(
        bodies,
        [*cuts, *slab_held],
        [TotalForce("punch", "y1", (0.0, -5000.0))],
        [_pair(Surface("slab", "y1"), Surface("punch", "y0"), 0.0)],
    )


def of_half_plane(points: np.ndarray) -> np.ndarray:
    """Return how a half plane moves under the flat punch, against the point 200 mm below an equal line load.

    Flamant's field, averaged over the punch's pressure F / (π √(a² − x²)) by Gauss and Chebyshev's rule.
    """
    nodes = 10.0 * np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    x, down = points[:, :1] - nodes, -points[:, 1:2]
    radius, angle = np.hypot(x, down), np.arctan2(x, down)
    along = 2.0 * np.log(200.0 / radius)
    radial = along * np.cos(angle) - (1.0 - POISSON) * angle * np.sin(angle)
    turning = (1.0 + POISSON - along) * np.sin(angle) - (1.0 - POISSON) * angle * np.cos(angle)
    sideways = radial * np.sin(angle) + turning * np.cos(angle)
    sinking = radial * np.cos(angle) - turning * np.sin(angle)
    return 1e4 / (np.pi * 2e5) * np.column_stack([sideways.mean(axis=1), -sinking.mean(axis=1)])


def flat_punch_rows() -> list[Row]:
    """A tutorial of solids4foam: its slab, and the same cut out of the half plane of its formula."""
    moved = (lambda x: of_half_plane(x)[:, 0], lambda x: of_half_plane(x)[:, 1])
    cut = flat_punch([Support("slab", side, moved) for side in ("x1", "y0")])
    formula = 1e4 / (np.pi * 2e5) * (2.0 * np.log(2.0 * 200.0 / 10.0) - (1.0 + POISSON))
    return [
        accurately(
            flat_punch([Support("slab", "y0")]), TotalPotential(), 1e-2, scale=-2.0 / 5000.0,
            quantity="way of the punch under 10 kN/mm, base fixed [mm]",
            others="solids4foam: a half plane's formula, 0.0967",
        ),
        accurately(
            cut, Movement("punch", "y1", (0.0, -1.0)), 1e-3,
            quantity="the same, base and sides as in a half plane [mm]",
            reference=formula, source="half plane", margin=1e-4,
        ),
    ]  # fmt: skip


def tube(pressure: float) -> Scene:
    """An inner tube of radii 0.82 and 0.98 in an outer one of radii 1 and 2, between two planes."""
    sides = {"inner": (0.82, 0.98), "outer": (1.0, 2.0)}
    bodies = {
        name: Body(
            gallery.rectangle((a, 0.0), (b, 0.2), (4, 1), "triangle"),
            IsotropicElasticity(1.0, POISSON),
            axisymmetric=True,
        )
        for name, (a, b) in sides.items()
    }
    held = [Support(name, side, (None, 0.0)) for name in bodies for side in ("y0", "y1")]
    pair = ContactPair(Surface("outer", "x0"), Surface("inner", "x1"), discretisation="mortar")
    return Scene(bodies, held, [Pressure("inner", "x0", pressure)], [pair])


def tube_rows() -> list[Row]:
    """The first stage of SSNA105."""
    closing = (1.0 / 0.98 - 1.0) * (0.98**2 - 0.82**2) / (2.0 * 0.82**2 * (1.0 - POISSON**2))
    scene = tube(closing)
    return [
        accurately(
            scene, Movement("inner", "x1", (1.0, 0.0)), 1e-3,
            quantity="u_r of the inner tube at the pressure 0.0048028",
            reference=0.02, source="closed form: the gap", others="code_aster: the same formula",
        )
    ]  # fmt: skip
