"""The block of `sliding_block` by GetFEM with its own contact brick, where `python3-getfem` is installed.

The brick poses the same discrete problem: nodal forces as multipliers, Coulomb's law node by node. GetFEM
brings a MUMPS without MPI, so nothing that uses PETSc may be imported here.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.cases.scene_data import (
    FRICTION_COEFFICIENT,
    LOWER,
    PLANE_HEIGHT,
    POISSON_RATIO,
    TRACTION,
    UPPER,
    YOUNG_MODULUS,
    Counts,
)
from fenics_contact.study.worker import peak_memory

#: Numbers of the three sides of the mesh.
CLAMPED, LOADED, CONTACT = 1, 2, 3
#: Augmentation parameter relative to Young's modulus: the best power of ten, fewest Newton steps.
AUGMENTATION = 10.0


def pressed_block(gf: Any, counts: Counts) -> tuple[Any, Any]:
    """Return GetFEM's finite elements and model of the block."""
    ticks = [np.linspace(LOWER[d], UPPER[d], counts[d] + 1) for d in range(3)]
    mesh = gf.Mesh("cartesian", *ticks)
    faces = mesh.outer_faces()
    normals = mesh.normal_of_faces(faces)
    for region, direction, sign in ((CLAMPED, 0, -1), (LOADED, 2, 1), (CONTACT, 2, -1)):
        mesh.set_region(region, faces[:, sign * normals[direction] > 0.9])
    elements = gf.MeshFem(mesh, 3)
    elements.set_classical_fem(1)
    integration = gf.MeshIm(mesh, 3)
    model = gf.Model("real")
    model.add_fem_variable("u", elements)
    lame = YOUNG_MODULUS * POISSON_RATIO / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
    model.add_initialized_data("lame", [lame])
    model.add_initialized_data("shear", [YOUNG_MODULUS / (2 * (1 + POISSON_RATIO))])
    model.add_isotropic_linearized_elasticity_brick(integration, "u", "lame", "shear")
    model.add_initialized_data("traction", list(TRACTION))
    model.add_source_term_brick(integration, "u", "traction", LOADED)
    model.add_Dirichlet_condition_with_simplification("u", CLAMPED)
    contacts = len(elements.basic_dof_on_region(CONTACT)) // 3
    model.add_variable("normal_force", contacts)
    model.add_variable("friction_force", 2 * contacts)
    model.add_initialized_data("augmentation", [AUGMENTATION * YOUNG_MODULUS])
    model.add_initialized_data("friction", [FRICTION_COEFFICIENT])
    model.add_nodal_contact_with_rigid_obstacle_brick(
        integration,
        "u",
        "normal_force",
        "friction_force",
        "augmentation",
        "friction",
        CONTACT,
        f"z-({PLANE_HEIGHT})",
        1,
    )
    return elements, model


def measure(comm: None, counts: Counts) -> dict[str, Any]:
    """Return the record of the block's state, or a note where GetFEM is missing."""
    try:
        import getfem as gf
    except ImportError as error:
        return {"skipped": f"GetFEM cannot be imported ({error}); on Debian: apt-get install python3-getfem"}
    gf.util("trace level", 0)
    imports = peak_memory()
    start = perf_counter()
    elements, model = pressed_block(gf, counts)
    iterations, converged = model.solve("max_res", 1e-8, "max_iter", 100, "lsolver", "mumps")
    seconds = perf_counter() - start
    normal = -np.asarray(model.variable("normal_force"))
    friction = np.asarray(model.variable("friction_force")).reshape(-1, 2)
    return {
        "counts": {
            "unknowns": elements.nbdof(),
            "newton_steps": int(iterations),
            "closed": int((normal > 1e-12).sum()),
        },
        "converged": bool(converged),
        "normal_force": float(normal.sum()),
        "friction_force": friction.sum(axis=0).tolist(),
        "seconds": seconds,
        "import_memory": imports,
    }
