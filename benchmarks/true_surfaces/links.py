"""The chain of links on finer and finer meshes, with its crowns taken in each way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from mpi4py import MPI

from fenics_contact import box_partition, contact_area, solve_scene
from fenics_contact._scene.pairs import Discretisation
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.gallery import LinkShape, two_links
from fenics_contact.qp import FaceNewton
from fenics_contact.study.scenes.chain_links import GRADING, chain

#: Cells at the spot are a quarter as long as those of the same mesh without grading.
FINEST = 4.0
#: Refinement of the published mesh in all directions, grading, discretisation, geometry.
RUNS: list[tuple[float, float, Discretisation, Geometry]] = [
    *[(1.0, 0.0, way, taken) for way in ("node", "mortar") for taken in ("faceted", "reconstructed", "best")],
    *[(size, 0.0, "node", taken) for size in (1.5, 2.0) for taken in ("faceted", "best")],
    *[(1.0, GRADING, way, taken) for way in ("node", "mortar") for taken in ("faceted", "best")],
    *[(size, GRADING, way, "best") for size in (1.5, 2.0) for way in ("node", "mortar")],
    *[(1.5, FINEST, way, "best") for way in ("node", "mortar")],
    *[(size, 0.0, "mortar", "best") for size in (1.5, 2.0)],
    *[(3.0, 0.0, way, "best") for way in ("node", "mortar")],
]


def measured(
    comm: MPI.Comm, size: float, grading: float, discretisation: Discretisation, geometry: Geometry
) -> dict[str, Any]:
    """Solve the chain on one mesh. Collective."""
    shape = LinkShape(n_around=round(48 * size), n_a=round(8 * size), n_b=round(20 * size), grading=grading)
    scene = chain(two_links(shape))
    pairs = [replace(pair, geometry=geometry, discretisation=discretisation) for pair in scene.contacts]
    scene = replace(scene, contacts=pairs)
    boxes = (8, 1, 2) if size < 2 else (16, 2, 4)
    parts = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
    state = solve_scene(scene, comm, partitions=parts, solver=FaceNewton(tolerance=1e-6))
    return {
        "size": size,
        "grading": grading,
        "discretisation": discretisation,
        "geometry": geometry,
        "unknowns": state.counts["torn_unknowns"],
        "potential": round(state.energies.total_potential, 1),
        "peak": round(float(state.contact.pressure.max()), 1),
        "area": round(contact_area(state), 2),
        "closed": int((state.contact.status > 0).sum()),
        "products": state.solution.products,
    }
