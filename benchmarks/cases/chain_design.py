"""The shape problem of the demo: crown of link 1 on a net of 7 x 4 control points."""

from __future__ import annotations

from mpi4py import MPI

from benchmarks.cases.scene_data import PAPER_BOXES, PAPER_CELLS
from fenics_contact.contact import ContactProblem
from fenics_contact.partition import box_partition
from fenics_contact.shape import ShapeProblem, SurfaceDesign, TotalPotential
from fenics_contact.study.scenes.chain_links import chain, graded_links

#: Largest displacement of a control point, [mm].
BOUND = 0.25


def chain_shape_problem(comm: MPI.Comm) -> ShapeProblem:
    """Mesh the chain of the published experiment and make its crown designable. Collective."""
    links = graded_links(PAPER_CELLS, comm)
    scene = chain(links)
    partitions = {name: box_partition(body.mesh, PAPER_BOXES) for name, body in scene.bodies.items()}
    design = SurfaceDesign("link 1", links.first.crown, net=(7, 4))
    return ShapeProblem(ContactProblem(scene, comm, partitions=partitions), design, TotalPotential())
