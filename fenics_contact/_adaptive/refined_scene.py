"""The same scene on refined meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.display import displayed
from fenics_contact._scene.constraints import require_refinable
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cuts import sewn
from fenics_contact.mesh.refinement import Refinement, halves_together, refined


@displayed
@dataclass(frozen=True, eq=False)
class SceneRefinement:
    """A scene on refined meshes, and where their cells come from.

    `refinements`: body name -> its refinement. Bodies that kept their mesh are left out.
    """

    scene: Scene
    refinements: Mapping[str, Refinement]

    def after(self, first: SceneRefinement) -> SceneRefinement:
        """Return the scene with refinements that lead from the meshes before another refinement."""
        both = dict(first.refinements)
        for name, found in self.refinements.items():
            both[name] = found.after(both[name]) if name in both else found
        return SceneRefinement(self.scene, both)


def refine_scene(scene: Scene, marked: Mapping[str, ArrayLike]) -> SceneRefinement:
    """Refine the meshes of some bodies; supports, loads and pairs are those of the same surfaces.

    Bodies with sections of preloads are refined as wholes and cut again.

    Args:
        scene: The scene.
        marked: Body name -> marked cells, see `fenics_contact.mesh.refined`; those that are not named
            keep their mesh. Quadratic quadrilaterals and hexahedra are refined all together.

    Raises:
        InvalidInputError: If there is no such body, its cells cannot be refined, one of its surfaces is
            refined so that a new node lies off its shape, or a linear constraint is by numbers of nodes.
    """
    unknown = sorted(set(marked) - set(scene.bodies))
    if unknown:
        raise InvalidInputError(
            f"marked must name bodies, got {unknown[0]!r}: take one of {sorted(scene.bodies)}"
        )
    require_refinable(scene.constraints, scene.bodies)
    bodies, refinements = dict(scene.bodies), {}
    for name, cells in marked.items():
        mesh = sewn(bodies[name].mesh)
        refinements[name] = refined(mesh, np.arange(mesh.n_cells) if halves_together(mesh) else cells)
        bodies[name] = replace(bodies[name], mesh=refinements[name].mesh)
    return SceneRefinement(replace(scene, bodies=bodies), refinements)


def refined_again(
    found: SceneRefinement, marked: Callable[[Scene], Mapping[str, np.ndarray]], halvings: int
) -> SceneRefinement:
    """Halve some cells of refined meshes some more times, as long as there are some."""
    for _ in range(halvings):
        cells = {name: each for name, each in marked(found.scene).items() if len(each)}
        if not cells:
            break
        found = refine_scene(found.scene, cells).after(found)
    return found
