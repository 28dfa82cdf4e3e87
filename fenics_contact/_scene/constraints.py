"""Linear constraints between displacements of nodes: Σ c d·u = b."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.checks import GivenVector, brief, checked, floats
from fenics_contact._base.display import displayed
from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_known, plain_numbers
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.part import Around, Part, body_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh

_AXES = ("x", "y", "z")


@displayed
@dataclass(frozen=True, eq=False)
@checked("nodes", "direction", "factor", "equation")
class ConstraintTerm:
    """A term c d·u of equations between displacements of nodes.

    A term of several nodes belongs to as many equations, one for each of its nodes in their order, unless
    `equation` says otherwise; a term of one node belongs to all of them.

    Attributes:
        body: Name of the body.
        nodes: A node set or a surface of its mesh, whose nodes ascend, or numbers of nodes, shape (n,).
        direction: d: "x", "y" or "z" (on bodies of revolution "x" is the radius and "y" the axis), a vector
            of any length, or one for each node, shape (n, dim).
        factor: c, or one for each node, shape (n,).
        equation: Number of the equation from 0 to which all nodes belong, or of that of each, shape (n,).

    Raises:
        InvalidInputError: If arrays do not fit each other or have numbers that are not finite, or a direction
            or a factor is zero everywhere.

    Example:
        >>> corner = ConstraintTerm("plate", "corner", (1.0, -1.73))  # u_x − 1.73 u_y of one node
        >>> mean = ConstraintTerm("plate", "edge", "x", 0.1, equation=0)  # 0.1 Σ u_x of all nodes
    """

    body: str
    nodes: str | Sequence[int] | np.ndarray
    direction: Literal["x", "y", "z"] | GivenVector | Sequence[GivenVector] | np.ndarray
    factor: float | Sequence[float] | np.ndarray = 1.0
    equation: int | Sequence[int] | np.ndarray | None = None

    def __post_init__(self) -> None:
        """Make arrays, and reject those that do not fit."""
        if not self.set_name:
            self._set("nodes", self._array("nodes", np.int64, (1,)))
        if self.axis not in _AXES:
            given = self._array("direction", np.float64, (1, 2))
            self._set("direction", given if given.ndim == 2 else floats(given))
        factor = self._array("factor", np.float64, (0, 1))
        self._set("factor", factor if factor.ndim else float(factor))
        if not self.is_by_node:
            number = self._array("equation", np.int64, (0, 1))
            if (number < 0).any():
                raise InvalidInputError(
                    f"ConstraintTerm.equation must count from 0, got {brief(self.equation)}"
                )
            self._set("equation", number if number.ndim else int(number))
        for name in ("factor",) if self.axis else ("direction", "factor"):
            if not np.any(getattr(self, name)):
                raise InvalidInputError(f"ConstraintTerm.{name} must not be zero: leave the term out")
        sizes = {len(each) for each in self._by_node}
        if len(sizes) > 1:
            raise InvalidInputError(
                f"arrays of a ConstraintTerm must have one entry for each node, got {sorted(sizes)} of body "
                f"{self.body!r}: give as many of each"
            )

    @property
    def set_name(self) -> str:
        """Name of its nodes, empty if they are given by numbers."""
        return self.nodes if isinstance(self.nodes, str) else ""

    @property
    def axis(self) -> str:
        """Name of the axis along which it acts, empty if it has vectors."""
        return self.direction if isinstance(self.direction, str) else ""

    @property
    def is_by_node(self) -> bool:
        """Whether each of its nodes has an equation of its own."""
        return self.equation is None

    @property
    def numbers(self) -> np.ndarray:
        """Number of the equation of all its nodes, shape (), or of each, (n,); nothing if it is by node."""
        given: Any = () if self.is_by_node else self.equation
        return np.asarray(given, dtype=np.int64)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _array(self, name: str, kind: type, dimensions: tuple[int, ...]) -> np.ndarray:
        """Return a field as an array of finite numbers."""
        given = getattr(self, name)
        try:
            array = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            array = np.full((), np.nan)
        whole = kind is np.float64 or (array == np.round(array)).all()
        if not np.isfinite(array).all() or not whole or array.ndim not in dimensions or array.size == 0:
            words = {"nodes": "the name of a node set or numbers of nodes", "equation": "whole numbers"}
            needed = words.get(name, "finite numbers, one for all nodes or one for each")
            raise InvalidInputError(f"ConstraintTerm.{name} must be {needed}, got {brief(given)}: correct it")
        return array.astype(kind)

    @property
    def _by_node(self) -> list[np.ndarray]:
        given: tuple[Any, ...] = (self.nodes, self.direction, self.factor, self.equation)
        return [each for each in given if isinstance(each, np.ndarray)]

    def __eq__(self, other: object) -> bool:
        """Return whether another term has the same entries."""
        if not isinstance(other, ConstraintTerm):
            return NotImplemented
        names = ("nodes", "direction", "factor", "equation")
        pairs = ((getattr(self, name), getattr(other, name)) for name in names)
        return self.body == other.body and all(
            type(a) is type(b) and (np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b)
            for a, b in pairs
        )

    def __hash__(self) -> int:
        """Return a hash of what is no array."""
        return hash((self.body, self.set_name or len(self.nodes)))

    @property
    def in_words(self) -> str:
        """Which nodes it has."""
        if self.set_name:
            return f"{self.body} {self.set_name}"
        return f"{len(self.nodes)} nodes of {self.body}"

    def nodes_of(self, mesh: BodyMesh) -> np.ndarray:
        """Return its nodes in the mesh of its body."""
        return mesh.nodes_to_hold(self.set_name) if self.set_name else np.asarray(self.nodes)

    def vectors(self, count: int, dim: int) -> np.ndarray:
        """Return c d of its nodes, shape (count, dim)."""
        if self.axis:
            along = np.eye(3)[_AXES.index(self.axis), :dim]
        else:
            along = np.asarray(self.direction)
        return np.broadcast_to(np.asarray(self.factor).reshape(-1, 1) * along, (count, dim))


@displayed
@dataclass(frozen=True)
@checked("value")
class LinearConstraint(Part):
    """Equations Σ c d·u = b between displacements of nodes, of one or several bodies.

    They hold exactly, as rows of multipliers, and stay linear in the displacements where bodies deform much.
    Their forces are on the nodes of the terms, in proportion to the factors: a constraint between equal
    displacements has no resultant, others hold their bodies as supports do. Equations that follow from others
    are left out, as the log says; those that contradict each other or supports are an error.

    Attributes:
        terms: The terms. Those of n nodes make n equations, node by node; those of one node are in all.
        value: b, or one for each equation, [length] where factors have no unit. Load steps may change it.
        name: Name in results and load steps; by default its terms.
        paired: How nodes of several terms belong together: in their order, or by a "translation" of the
            middle of the first ones onto that of the others, as on opposite sides of a periodic cell.

    Raises:
        InvalidInputError: If there are no terms. When the scene is made: if a term names what is not there or
            has directions of another space, terms have different numbers of nodes, or nodes have no partner.

    Example:
        >>> lever = [ConstraintTerm("rod", "tip", "y"), ConstraintTerm("arm", "eye", "x", -2.0)]
        >>> geared = LinearConstraint(lever)  # u_y of the tip is twice u_x of the eye
        >>> sides = [ConstraintTerm("cell", "x1", "y"), ConstraintTerm("cell", "x0", "y", -1.0)]
        >>> periodic = LinearConstraint(sides, value=0.01, paired="translation", name="shear")
    """

    effect = EffectName.LINEAR_CONSTRAINT
    terms: Sequence[ConstraintTerm]
    value: float | Sequence[float] = 0.0
    name: str = ""
    paired: Literal["order", "translation"] = "order"

    def __post_init__(self) -> None:
        """Reject constraints without terms, and values that are not finite."""
        if not self.terms:
            raise InvalidInputError("a LinearConstraint needs terms, got none: give at least one")
        object.__setattr__(self, "terms", tuple(self.terms))
        object.__setattr__(self, "value", _values(self.value, self.label))

    def check(self, scene: Around) -> None:
        """Reject terms of what is not there, and those that do not fit each other or their bodies."""
        if any(body.torsion for body in scene.bodies.values()):
            raise InvalidInputError(
                "scenes with torsion have no linear constraints, got some: leave the torsion or these out"
            )
        for term in self.terms:
            mesh = body_of(scene, term.body, "ConstraintTerm").mesh
            if term.set_name:
                words = f"ConstraintTerm names nodes {term.nodes!r} of body {term.body!r}, which has"
                known = [*mesh.surfaces, *mesh.node_sets]
                check_known(term.set_name, known, words, "use one of them, or numbers")
        self.entries(scene.bodies)

    @property
    def label(self) -> str:
        """Its name, by default its terms."""
        return self.name or " and ".join(dict.fromkeys(term.in_words for term in self.terms))

    @property
    def key(self) -> tuple[object, ...]:
        """What stays through load steps."""
        return self.terms, self.paired

    @property
    def place(self) -> str:
        """What it is, in words."""
        value = self.value if isinstance(self.value, float) else f"{len(self.value)} values"
        return f"{self.label}, {len(self.terms)} terms = {value}"

    def with_value(self, value: float | Sequence[float]) -> LinearConstraint:
        """Return the same constraint with another value."""
        return replace(self, value=value)

    def entries(self, bodies: Mapping[str, Body]) -> list[TermEntries]:
        """Return the entries of all terms.

        Raises:
            InvalidInputError: If terms do not fit each other or their bodies.
        """
        found = [self._nodes(term, bodies[term.body].mesh) for term in self.terms]
        several = {len(n) for t, n in zip(self.terms, found, strict=True) if t.is_by_node and len(n) > 1}
        if len(several) > 1:
            raise InvalidInputError(
                f"terms of LinearConstraint {self.label!r} must have as many nodes as each other, or one, "
                f"got {' and '.join(map(str, sorted(several)))}: give sets of as many, or equations"
            )
        numbers = [int(t.numbers.max()) + 1 for t in self.terms if not t.is_by_node]
        count = max([1, *several, *numbers])
        first = next((k for k, n in enumerate(found) if len(n) > 1), 0)
        entries = []
        for number, (term, nodes) in enumerate(zip(self.terms, found, strict=True)):
            if self.paired == "translation" and number > first and len(nodes) > 1 and term.is_by_node:
                start = bodies[self.terms[first].body].mesh.points[found[first]]
                nodes = nodes[self._partners(start, bodies[term.body].mesh.points[nodes])]
            if term.is_by_node:
                equation = np.arange(count if len(nodes) == 1 else len(nodes))
            else:
                equation = np.broadcast_to(term.numbers, nodes.shape)
            vectors = term.vectors(len(nodes), bodies[term.body].mesh.dim)
            if len(nodes) == 1 and len(equation) > 1:
                nodes, vectors = np.repeat(nodes, len(equation)), np.repeat(vectors, len(equation), axis=0)
            entries.append(TermEntries(term.body, nodes, equation, vectors))
        return entries

    def count(self, bodies: Mapping[str, Body]) -> int:
        """Return the number of its equations."""
        return 1 + max(int(each.equation.max()) for each in self.entries(bodies))

    def _nodes(self, term: ConstraintTerm, mesh: BodyMesh) -> np.ndarray:
        """Return the nodes of a term, and reject what its mesh does not have."""
        nodes, dim = term.nodes_of(mesh), mesh.dim
        if not term.set_name and (nodes.min() < 0 or nodes.max() >= mesh.n_nodes):
            raise InvalidInputError(
                f"ConstraintTerm.nodes of body {term.body!r} must lie between 0 and {mesh.n_nodes - 1}, got "
                f"{nodes.min()} to {nodes.max()}: its mesh has no others"
            )
        if any(len(each) != len(nodes) for each in term._by_node):
            raise InvalidInputError(
                f"arrays of the term {term.in_words!r} must have one entry for each of its {len(nodes)} "
                f"nodes, got {[len(each) for each in term._by_node]}"
            )
        given = _AXES.index(term.axis) + 1 if term.axis else 0
        width = dim if given else np.shape(term.direction)[-1]
        if given > dim or width != dim:
            raise InvalidInputError(
                f"ConstraintTerm.direction of {term.in_words!r} must be in {dim} dimensions, got "
                f"{brief(term.direction)}: give {dim} numbers, or one of {', '.join(_AXES[:dim])}"
            )
        return nodes

    def _partners(self, start: np.ndarray, points: np.ndarray, near: float = 1e-4) -> np.ndarray:
        """Return for each point of the first term its place among those of another.

        `near`: distance up to which points are partners, relative to the size of all.
        """
        shifted = start + (points.mean(axis=0) - start.mean(axis=0))
        away, place = cKDTree(points).query(shifted)
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        if away.max() > near * size or len(np.unique(place)) < len(place):
            at = ", ".join(f"{x:.6g}" for x in start[int(np.argmax(away))])
            raise InvalidInputError(
                f"LinearConstraint {self.label!r} needs partners of all translated nodes, that at ({at}) has "
                f"none within {near * size:.3g}: mesh both sides alike, or take a Tie"
            )
        return np.asarray(place)


@dataclass(frozen=True, eq=False)
class TermEntries:
    """The entries c d of a term: of which nodes of a body, in which equations; all of shape (n, ...)."""

    body: str
    nodes: np.ndarray
    equation: np.ndarray
    vectors: np.ndarray


def _values(value: float | Sequence[float], label: str) -> float | GivenVector:
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.full((), np.nan)
    if numbers.ndim > 1 or not np.isfinite(numbers).all() or not numbers.size:
        raise InvalidInputError(
            f"the value of LinearConstraint {label!r} must be a finite number, or one for each equation, got "
            f"{brief(value)}: give [length] where factors have no unit"
        )
    return plain_numbers(numbers)


def with_values(
    constraints: Sequence[LinearConstraint], values: Mapping[str, float | Sequence[float]]
) -> tuple[LinearConstraint, ...]:
    """Return constraints with the values of a load step.

    Raises:
        InvalidInputError: If there is no constraint of a name.
    """
    known = [each.label for each in constraints]
    for name in values:
        check_known(name, known, f"LoadStep.constraints names {name!r}, the scene has")
    return tuple(
        each.with_value(values[each.label]) if each.label in values else each for each in constraints
    )


def require_refinable(constraints: Sequence[LinearConstraint], bodies: Mapping[str, Body]) -> None:
    """Reject constraints whose nodes would have other numbers, or another order, on finer meshes."""
    for each in constraints:
        several = [
            term for term in each.terms if term.is_by_node and len(term.nodes_of(bodies[term.body].mesh)) > 1
        ]
        arrays = any(term._by_node for term in each.terms)
        if arrays or (each.paired == "order" and len(several) > 1):
            raise InvalidInputError(
                f"meshes with LinearConstraint {each.label!r} cannot be refined, as numbers and order of "
                "nodes change: name node sets and surfaces, and pair several by 'translation'"
            )
