"""The shape problem of the demo: the crown of link 1 on a net of 7 x 4 control points."""

from __future__ import annotations

from mpi4py import MPI

from benchmarks.cases.scene_data import FRICTION_COEFFICIENT, PAPER_BOXES, PAPER_CELLS, Counts
from fenics_contact import ContactProblem, ShapeProblem, SurfaceDesign, box_partition
from fenics_contact.design import AdaptiveTolerance, Objective, TotalPotential
from fenics_contact.gallery import TwoLinks
from fenics_contact.study.scenes.chain_links import chain, graded_links

#: Largest displacement of a control point, [mm].
BOUND = 0.25
#: Cells around, through and across each link, and its boxes.
SIZES: dict[str, tuple[Counts, Counts]] = {
    "coarse": ((30, 4, 10), (4, 1, 1)),
    "small": ((36, 6, 14), PAPER_BOXES),
    "paper": (PAPER_CELLS, PAPER_BOXES),
}
_links: dict[Counts, TwoLinks] = {}


def chain_shape_problem(
    comm: MPI.Comm,
    size: str = "paper",
    *,
    objective: Objective | None = None,
    friction: float = FRICTION_COEFFICIENT,
    tolerance: float | AdaptiveTolerance | None = None,
) -> ShapeProblem:
    """Make the crown of a chain designable. Collective.

    Args:
        comm: Communicator; meshes are made once for all problems of a process.
        size: One of `SIZES`.
        objective: What is minimised; the total potential by default.
        friction: Coefficient of friction.
        tolerance: Of the states, as `ShapeProblem` takes it.
    """
    cells, boxes = SIZES[size]
    if cells not in _links:
        _links[cells] = graded_links(cells)
    links = _links[cells]
    scene = chain(links, friction)
    partitions = {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}
    design = SurfaceDesign("link 1", links.first.crown, net=(7, 4))
    problem = ContactProblem(scene, comm, partitions=partitions)
    return ShapeProblem(problem, design, objective or TotalPotential(), tolerance=tolerance)
