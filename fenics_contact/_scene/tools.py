"""Rigid tools: obstacles that move as one piece, as forces, moments, springs and prescribed motions ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import GivenVector, checked
from fenics_contact._base.display import displayed
from fenics_contact._scene.body import Body, Modes
from fenics_contact._scene.checks import check_known
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.obstacles import RigidTool
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.supports import TOOL, AnySupport, ToolMotion
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import (
    IsotropicElasticity,
    Material,
    PlaneStrain,
    isotropic_constants,
)
from fenics_contact.materials.hyperelastic import StVenantKirchhoff
from fenics_contact.materials.kernels import motions_about
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import boundary_faces


@displayed
@dataclass(frozen=True)
@checked("material")
class ToolBody(Body):
    """What carries the motion of a tool in a scene: one cell around its point, whose nodes move as one piece.

    The displacement of any point of the tool is an affine function of those of the nodes of the cell: rows of
    contact, prescribed motions, forces and reactions are those of a body with a rigid surface.
    The cell has no strain; springs act on its nodes.

    Attributes:
        tool: The tool.
        springs: Stiffness along and around the axes, see `ToolMotion.springs`.
    """

    effect = EffectName.RIGID_TOOL
    is_rigid = True
    tool: RigidTool = field(kw_only=True)
    springs: GivenVector = field(default=(), kw_only=True)

    @property
    def in_words(self) -> str:
        """What it is."""
        return f"rigid {type(self.tool.shape).__name__} at {self.tool.at}"

    def modes(self, points: np.ndarray) -> np.ndarray:
        """Return the displacement of points for unit motions of the tool, (n, dim) -> (n, dim, n_modes)."""
        return motions_about(points, np.array(self.tool.at))

    def kernel(self, points: np.ndarray, elastic: Modes) -> np.ndarray:
        """Return the motions that no spring resists, (n, dim, n_modes), turns by size of cell."""
        return self._motions(points, ~self._sprung)

    def sprung_modes(self, points: np.ndarray) -> np.ndarray:
        """Return the motions that springs resist, (n, dim, n_modes), turns by size of cell."""
        return self._motions(points, self._sprung)

    @property
    def _sprung(self) -> np.ndarray:
        """Marks of the motions that springs resist."""
        return np.array(self.springs or np.zeros(3 * self.tool.dim - 3)) > 0.0

    def _motions(self, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Return some of the motions about its point, turns by size of cell."""
        if self.axisymmetric:  # other motions strain a body of revolution
            chosen = chosen & [False, True, False]
        modes, dim = self.modes(points), self.tool.dim
        modes[:, :, dim:] /= np.abs(self.mesh.points - np.array(self.tool.at)).max()
        return modes[:, :, chosen]

    def spring_matrix(self, points: np.ndarray) -> np.ndarray:
        """Return the stiffness of the springs on nodes that move with the tool, (n · dim, n · dim)."""
        arm, dim = np.abs(self.mesh.points - np.array(self.tool.at)).max(), self.tool.dim
        units = np.repeat([1.0, arm], [dim, 2 * dim - 3])
        motion = np.linalg.pinv(self.modes(points).reshape(points.size, -1) / units)
        return np.asarray(motion.T @ np.diag(self.springs / units**2) @ motion)

    def sprung(self, matrix: sp.csr_matrix, points: np.ndarray) -> sp.csr_matrix:
        """Return a stiffness matrix of its nodes at points with that of its springs."""
        return (matrix + sp.csr_matrix(self.spring_matrix(points))).tocsr() if self.springs else matrix

    def frame(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation R and translation c of the tool, R x + c, from places of its nodes, (n, dim)."""
        arms, at = self.mesh.points - self.mesh.points.mean(axis=0), self.mesh.points.mean(axis=0)
        middle = places.mean(axis=0)
        left, _, right = np.linalg.svd((places - middle).T @ arms)
        turn = left @ right
        return turn, middle - turn @ at

    def weights(self, points: np.ndarray) -> np.ndarray:
        """Return affine weights of the nodes in points of the tool, (n, dim) -> (n, n_nodes)."""
        slopes = self.weight_slopes
        return np.asarray(1.0 / len(slopes) + (points - np.array(self.tool.at)) @ slopes.T)

    @property
    def weight_slopes(self) -> np.ndarray:
        """Gradients of the weights, shape (n_nodes, dim), [1 / length]; zero along the axis of revolution."""
        return np.zeros(self.mesh.points.shape) if self.axisymmetric else self.cell_slopes

    @property
    def cell_slopes(self) -> np.ndarray:
        """Gradients of weights that are affine over the cell, shape (n_nodes, dim), [1 / length]."""
        arms = self.mesh.points - self.mesh.points.mean(axis=0)
        return np.asarray(arms * self.tool.dim / np.einsum("jd,jd->", arms, arms))


def tools_in(bodies: Mapping[str, Body]) -> dict[str, ToolBody]:
    """Return the bodies that carry the motions of tools."""
    return {name: cast("ToolBody", body) for name, body in bodies.items() if body.is_rigid}


def tools_of(contacts: Sequence[ContactPair]) -> dict[str, tuple[RigidTool, str]]:
    """Return the tools of contact pairs by name, with the body of the first slave that each meets."""
    found: dict[str, tuple[RigidTool, str]] = {}
    for pair in (each for each in contacts if each.tool):
        tool = cast("RigidTool", pair.master)
        known = found.setdefault(tool.name, (tool, pair.slave.body))[0]
        if known != tool:
            raise InvalidInputError(
                f"two different tools have the name {tool.name!r}: rename one, or give both pairs one tool"
            )
    return found


def bodies_with_tools(bodies: Mapping[str, Body], contacts: Sequence[ContactPair]) -> Mapping[str, Body]:
    """Return the bodies of a scene and those of its tools."""
    tools = tools_of(contacts)
    before = tools_in(bodies)
    if not tools and not before:
        return bodies
    own = {name: body for name, body in bodies.items() if name not in before}
    if both := sorted(set(tools) & set(own)):
        raise InvalidInputError(
            f"tools and bodies must have different names, got {both} for both: rename the tool"
        )
    much = any(body.deforms_much for body in own.values())
    made = dict(own)
    for name, (tool, slave) in tools.items():
        if name in before and before[name].tool == tool and before[name].deforms_much == much:
            made[name] = before[name]
        elif slave in own:  # a wrong name is an error of its own
            if tool.dim != own[slave].mesh.dim:
                raise InvalidInputError(
                    f"tool {name!r} must lie in the space of body {slave!r}, got {tool.dim} dimensions: give "
                    f"{own[slave].mesh.dim} coordinates"
                )
            turned = own[slave].axisymmetric
            if turned:
                _require_on_axis(tool)
            cell, material = _cell(tool, own[slave].mesh, turned), _material(own[slave], much)
            made[name] = ToolBody(cell, material, turned, tool=tool)
    return made


def with_motions(
    bodies: Mapping[str, Body], supports: Sequence[AnySupport]
) -> tuple[Mapping[str, Body], tuple[AnySupport, ...]]:
    """Return the bodies with the springs of tools, and the supports with all motions of tools as surfaces."""
    tools = tools_in(bodies)
    made: list[AnySupport] = []
    changed: dict[str, Body] = {}
    for support in supports:
        if not isinstance(support, ToolMotion):
            made.append(support)
            continue
        words = f"a ToolMotion names tool {support.tool!r}, the contact pairs of the scene have"
        check_known(support.tool, tools, words)
        body = tools[support.tool]
        if support.tool in changed:
            raise InvalidInputError(
                f"tool {support.tool!r} must have one ToolMotion, got several: give all components in one"
            )
        springs = support.springs(body.tool.at)
        changed[support.tool] = body if springs == body.springs else replace(body, springs=springs)
        made.append(support.of(body.tool.at))
    driven = {support.body for support in made}
    for name, body in tools.items():
        if name not in driven:
            turns = 0.0 if body.tool.dim == 2 else (0.0, 0.0, 0.0)
            made.append(ToolMotion(name, (0.0,) * body.tool.dim, turns).of(body.tool.at))
            changed[name] = replace(body, springs=()) if body.springs else body
    return ({**bodies, **changed} if changed else bodies), tuple(made)


def with_tool_parts(
    bodies: Mapping[str, Body], partitions: Mapping[str, np.ndarray]
) -> Mapping[str, np.ndarray]:
    """Return partitions of bodies with those of the cells of tools, which no one cuts."""
    known = isinstance(partitions, Mapping)  # others are rejected where all ranks have them
    tools = [name for name in tools_in(bodies) if known and name not in partitions]
    return {**partitions, **{name: np.zeros(1, dtype=np.int64) for name in tools}} if tools else partitions


def check_partitions(bodies: Mapping[str, Body], partitions: Mapping[str, np.ndarray]) -> None:
    """Reject partitions of other bodies, or of other numbers of cells."""
    if not isinstance(partitions, Mapping):
        raise InvalidInputError(f"partitions must be by names of bodies, got {partitions!r}: leave it out")
    for name, body in bodies.items():
        if name not in partitions:
            raise InvalidInputError(f"every body needs a partition, {name!r} has none: pass its cells")
        partition, cells = partitions[name], body.mesh.n_cells
        if not isinstance(partition, np.ndarray) or partition.shape != (cells,):
            given = partition.shape if isinstance(partition, np.ndarray) else repr(partition)
            raise InvalidInputError(f"partitions[{name!r}] needs shape ({cells},), got {given}")


def _material(slave: Body, much: bool) -> Material:
    """Return a material of about the stiffness of a body, in which rotations cause no stress where large."""
    known = [isotropic_constants(each) or (1.0, 0.3) for each in slave.materials]
    young = min((young for young, _ in known), default=1.0)
    if much:
        return StVenantKirchhoff(young, 0.3)
    solid = slave.mesh.dim == 3 or slave.axisymmetric
    return IsotropicElasticity(young, 0.3) if solid else PlaneStrain(young, 0.3)


def _require_on_axis(tool: RigidTool) -> None:
    """Reject a point off the axis of revolution: a tool of revolution moves along it only."""
    if tool.at[0] != 0.0:
        raise InvalidInputError(
            f"the point of tool {tool.name!r} must lie on the axis of revolution, r = 0, got {tool.at!r}: a "
            "tool of revolution moves along the axis"
        )


def _cell(tool: RigidTool, slave: BodyMesh, turned: bool) -> BodyMesh:
    """Return a mesh of one regular cell around the tool's point, of the size of a body and its type of cells.

    Around the point: a rotation that nothing resists then does not depend on the displacement. Of bodies of
    revolution, where nodes lie on one side of the axis, beside it.
    """
    dim, corners = slave.dim, slave.linear.cells.shape[1]
    if corners > dim + 1:
        flat = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
        raised = [np.pad(flat, ((0, 0), (0, 1)), constant_values=z) for z in (-1, 1)]
        arms = flat if dim == 2 else np.vstack(raised)
    elif dim == 2:
        angle = 2.0 * np.pi * np.arange(3) / 3.0
        arms = np.column_stack([np.cos(angle), np.sin(angle)])
    else:
        arms = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]], dtype=np.float64)
    size = 0.5 * float(np.ptp(slave.points, axis=0).max())
    points = np.array(tool.at) + size * (arms + np.array([2.0, 0.0]) if turned else arms)
    cells = np.arange(len(arms))[None]
    return BodyMesh(points, cells, {TOOL: boundary_faces(cells, dim)[0]})
