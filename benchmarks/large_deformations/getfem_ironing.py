"""Dies drawn along a bed by GetFEM's large-sliding brick on the same meshes, where `python3-getfem` is there.

The brick integrates contact over the die's skin, finds the bed by rays along the die's normals, and has
Lagrange multipliers on the skin's nodes. GetFEM brings a MUMPS without MPI, so nothing that uses MPI or PETSc
may be imported here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from benchmarks.large_deformations.ironing_meshes import (
    COARSER,
    FRICTION,
    HARD,
    PLACES,
    RATIO,
    SOFT,
    TIMES,
    bed,
    die,
    place,
)
from fenics_contact import BodyMesh

#: Displacement of the die's upper side by time.
Place: TypeAlias = Callable[[float], tuple[float, float]]
#: Numbers of the regions of each body.
TOUCHING, HELD = 1, 2
#: Distance of the brick's search for contact, [mm], and augmentation relative to the bed's modulus.
RELEASE, AUGMENTATION = 0.3, 1.0
#: Load steps until the die is pressed in, and the last time: later Newton's method fails on some meshes.
PRESSING, LAST = 8, 1.5


def in_getfem(gf: Any, body: BodyMesh, touching: str, held: str) -> Any:
    """Return GetFEM's mesh of quadrilaterals with its two regions."""
    mesh, square = gf.Mesh("empty", 2), gf.GeoTrans("GT_QK(2,1)")
    for corners in body.points[body.cells[:, [0, 1, 3, 2]]]:
        mesh.add_convex(square, corners.T)
    faces = mesh.outer_faces()
    ends = (mesh.pts()[:, mesh.pid_in_faces(face[:, None])] for face in faces.T)
    middles = np.array([points.mean(axis=1) for points in ends])
    for number, name in ((TOUCHING, touching), (HELD, held)):
        wanted = body.points[body.surfaces[name]].mean(axis=1)
        apart = np.linalg.norm(middles[:, None] - wanted, axis=2).min(axis=1)
        mesh.set_region(number, faces[:, apart < 1e-9])
    return mesh


def drawn(gf: Any, low: BodyMesh, high: BodyMesh, skin_name: str, stiff: float) -> tuple[Any, Any, list[Any]]:
    """Return GetFEM's model, the integration on the die's skin, and what has to live as long as these.

    Args:
        gf: The module.
        low: Mesh of the bed.
        high: Mesh of the die.
        skin_name: Surface of the die that meets the bed.
        stiff: Young's modulus of the die, [N/mm²].
    """
    model = gf.Model("real")
    meshes = in_getfem(gf, low, "y1", "y0"), in_getfem(gf, high, skin_name, "y1")
    alive: list[Any] = list(meshes)
    for name, mesh, modulus in zip("bd", meshes, (SOFT, stiff), strict=True):
        elements = gf.MeshFem(mesh, 2)
        elements.set_classical_fem(1)
        model.add_fem_variable(f"u{name}", elements)
        model.add_fem_data(f"w{name}", elements)
        shear = modulus / (2 * (1 + RATIO))
        model.add_initialized_data(f"shear{name}", [shear])
        model.add_initialized_data(f"lame{name}", [2 * shear * RATIO / (1 - 2 * RATIO)])
        gradient = f"(Id(2)+Grad_u{name})"
        integration = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(2,3)"))
        alive += [elements, integration]
        model.add_nonlinear_term(
            integration,
            f"shear{name}/2*(Norm_sqr{gradient}-2-2*log(Det{gradient}))+lame{name}/2*sqr(log(Det{gradient}))",
        )
    model.add_Dirichlet_condition_with_simplification("ub", HELD)
    model.add_initialized_data("place", [0.0, 0.0])
    model.add_Dirichlet_condition_with_simplification("ud", HELD, "place")
    forces = gf.MeshFem(meshes[1], 2)
    forces.set_classical_fem(1)
    model.add_filtered_fem_variable("force", forces, TOUCHING)
    model.add_initialized_data("augmentation", [AUGMENTATION * SOFT])
    model.add_initialized_data("friction", [FRICTION])
    model.add_initialized_data("alpha", [1.0])
    fine = gf.Integ("IM_GAUSS_PARALLELEPIPED(2,5)")
    skin, top = (gf.MeshIm(mesh, fine) for mesh in reversed(meshes))
    brick = model.add_integral_large_sliding_contact_brick_raytracing(
        "augmentation", RELEASE, "friction", "alpha", 0
    )
    model.add_slave_contact_boundary_to_large_sliding_contact_brick(
        brick, skin, TOUCHING, "ud", "force", "wd"
    )
    model.add_master_contact_boundary_to_large_sliding_contact_brick(brick, top, TOUCHING, "ub", "wb")
    return model, skin, [*alive, forces, top]


def steps(columns: int) -> Iterator[tuple[float, float | None]]:
    """Yield times, sliding by half a facet of the bed or less, and what they are measured for."""
    for number in range(1, PRESSING + 1):
        time = number / PRESSING
        yield time, time if time in TIMES else None
    facet, before = 1.2 / columns, 1.0
    for time in (time for time in TIMES if 1.0 < time <= LAST):
        for share in PLACES:
            at = time + share * facet
            ticks = np.linspace(before, at, int(np.ceil(2.0 * (at - before) / facet - 1e-9)) + 1)[1:]
            yield from ((float(tick), None) for tick in ticks[:-1])
            yield at, time
            before = at


def moved(model: Any, place: Place, start: float, end: float, halvings: int = 4) -> int:
    """Move the die from one time to another, in halves where Newton's method fails; return its steps.

    Raises:
        RuntimeError: If small steps fail, too.
    """
    before = {name: np.array(model.variable(name)) for name in ("ub", "ud", "force")}
    model.set_variable("place", list(place(end)))
    for name in "bd":
        model.set_variable(f"w{name}", before[f"u{name}"])
    taken, solved = model.solve("max_res", 1e-7, "max_iter", 60, "lsearch", "simplest", "alpha min", 0.3)
    if solved:
        return int(taken)
    if not halvings:
        raise RuntimeError(f"GetFEM must reach its tolerance, it does not at time {end:g}")
    for name, values in before.items():
        model.set_variable(name, values)
    middle = 0.5 * (start + end)
    halves = ((start, middle), (middle, end))
    return int(taken) + sum(moved(model, place, *half, halvings - 1) for half in halves)


def force_on(gf: Any, skin: Any, model: Any) -> np.ndarray:
    """Return the force of the bed on the die, shape (2,)."""
    return np.array([gf.asm("generic", skin, 0, f"force({k})", TOUCHING, model) for k in (1, 2)], float)


def missing() -> str | None:
    """Return why GetFEM cannot be used, or None."""
    try:
        import getfem
    except ImportError as error:
        return f"GetFEM cannot be imported ({error}); on Debian: apt-get install python3-getfem"
    getfem.util("trace level", 0)
    return None


def measured(comm: None, columns: int) -> dict[str, Any]:
    """Return forces at the times as `ironing.measured` does, or a note where GetFEM is missing."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    import getfem as gf

    began, newton_steps = perf_counter(), 0
    model, skin, _alive = drawn(gf, bed(columns), die(columns // COARSER), "skin", HARD)
    forces: dict[float, list[np.ndarray]] = {}
    before = 0.0
    for time, wanted in steps(columns):
        newton_steps += moved(model, place, before, time)
        before = time
        if wanted is not None:
            forces.setdefault(wanted, []).append(force_on(gf, skin, model))
    return {
        "columns": columns,
        "discretisation": "GetFEM",
        "times": [
            {
                "time": time,
                "vertical": round(float(np.mean(each, axis=0)[1]), 3),
                "horizontal": round(-float(np.mean(each, axis=0)[0]), 3),
                "ripple": round(float(np.ptp(each, axis=0)[0]), 3),
            }
            for time, each in forces.items()
        ],
        "newton_steps": newton_steps,
        "seconds": round(perf_counter() - began, 1),
    }
