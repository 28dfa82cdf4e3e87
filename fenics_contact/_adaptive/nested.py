"""A state on fine meshes by nested iteration: coarser ones are solved roughly, and each starts the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from fenics_contact._adaptive.levels import unknowns_of
from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._base.checks import check_count, check_numbers
from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.errors.kinds import user_code
from fenics_contact.mesh.refinement import Refinement
from fenics_contact.qp.solve import DualSolver
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import Tolerance


@collectively("solve_nested", lambda scene, halvings, comm, **_: comm)
def solve_nested(
    scene: Scene,
    halvings: int,
    comm: MPI.Comm,
    *,
    solver: DualSolver | None = None,
    tolerance: Tolerance = None,
    coarse_tolerance: float = 0.1,
    callback: Callable[[LinearState], None] | None = None,
) -> LinearState:
    """Compute the equilibrium of a scene with all cells halved some times, by nested iteration. Collective.

    The scene is solved on its own meshes, all their cells are halved, the state starts the next one, and so
    on. The answer is that of `fenics_contact.solve_scene` on the last meshes, to its tolerance, in fewer
    products with F on these. Halved cells lie on the true shapes that meshes carry.

    The coarser meshes are solved roughly: what interpolation from one to the next misses is more. With
    residuals of 0.1, 0.01 and 1e-4 on them the last mesh took the same products, up to two, in five scenes of
    six, in the sixth 30, 36 and 37; on the coarser ones they took 15, 23 and 37 on average, all together.

    Args:
        scene: The scene on its coarsest meshes.
        halvings: How often all cells are halved, ≥ 0; each time meshes get 2^dim times as many.
        comm: Communicator over which the subdomains are spread; each mesh is cut anew.
        solver: As for `fenics_contact.solve_scene`, on all meshes.
        tolerance: As for `fenics_contact.solve_scene`, on the last meshes.
        coarse_tolerance: Largest relative residual on the meshes before, between 0 and 1.
        callback: Called on all ranks with the state on every mesh, the last one included.

    Returns:
        The state on the last meshes; its scene is ``state.scene``.

    Raises:
        InvalidInputError: If ``halvings`` is not an integer of at least 0, ``coarse_tolerance`` not between 0
            and 1, a material is nonlinear, or the cells of a mesh cannot be halved.
        InfeasibleError: If nothing holds some body against its load.
        ConvergenceError: If the solver does not reach its tolerance on some mesh.

    References:
        W. Hackbusch: Multi-Grid Methods and Applications. Springer (1985), chapter 5 (nested iteration).

    Example:
        >>> state = solve_nested(scene, 2, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> state.scene.bodies  # on the last meshes  # doctest: +SKIP
    """
    with together(comm):
        check_nested(scene, halvings, coarse_tolerance)
    problem = ContactProblem(scene, comm, solver=solver, tolerance=tolerance)
    warnings = problem.defer_warnings()
    state: LinearState | None = None
    refinements: Mapping[str, Refinement] | None = None
    with Task("meshes", most=halvings + 1) as task:
        for level in range(halvings + 1):
            rough = coarse_tolerance if level < halvings else None
            found = problem.solve(start=state, refinements=refinements, tolerance=rough)
            assert isinstance(found, LinearState)
            state = found
            if callback is not None:
                with user_code("the callback of meshes"):
                    callback(state)
            words = f"{unknowns_of(problem.scene)} unknowns, {state.solution.products} products"
            task.step(level + 1, words=words)
            if level < halvings:
                with together(comm):
                    finer = _halved(problem.scene)
                problem, refinements = problem.on(finer.scene), finer.refinements
    warnings.tell()
    assert state is not None
    return state


def _halved(scene: Scene) -> SceneRefinement:
    """Return a scene with all cells halved but those that carry the motions of tools."""
    return refine_scene(scene, {name: np.arange(body.mesh.n_cells) for name, body in scene.deforming.items()})


def check_nested(scene: Scene, halvings: int, coarse_tolerance: float = 0.1) -> None:
    """Reject what cannot be nested."""
    check_count(halvings, "halvings", least=0)
    check_numbers(coarse_tolerance=coarse_tolerance)
    if not 0.0 < coarse_tolerance < 1.0:
        raise InvalidInputError(
            f"coarse_tolerance must lie between 0 and 1, got {coarse_tolerance:g}: leave it out"
        )
    if scene.is_nonlinear:
        raise InvalidInputError(
            "coarser meshes start finer ones where all materials are linear, but a body of the scene deforms "
            "much or yields, and its loads are followed on the mesh itself: give the fine mesh to solve_scene"
        )
