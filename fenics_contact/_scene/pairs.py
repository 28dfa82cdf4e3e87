"""Contact pairs with their friction laws, and tied surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, TypeAlias, cast

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._base.display import Table, in_notebooks, in_short, name_in_words, tabled
from fenics_contact._base.late_names import warn_of_old_name
from fenics_contact._scene.checks import check_known, check_not_negative, check_positive
from fenics_contact._scene.choice import NO_CHOICE, Choice, Chosen
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.fields import OfPosition, not_negative
from fenics_contact._scene.fluid import FluidPressure
from fenics_contact._scene.obstacles import MovingObstacle, RigidObstacle, RigidTool
from fenics_contact._scene.part import Around, Part, require_linear, require_surface
from fenics_contact._scene.surface_laws import (
    ClosureLaw,
    FrictionCurve,
    SlipTable,
    check_closing,
    check_rising,
)
from fenics_contact._scene.wear import Wear
from fenics_contact._surfaces.true_surface import Geometry
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.hyperelastic import is_nonlinear

#: Where contact is enforced: at the slave's nodes, or weighted by its shape functions (mortar).
Discretisation: TypeAlias = Literal["node", "mortar"]
#: What a pair may be given: one of them, or the better one of its scene, see `chosen_discretisation`.
AnyDiscretisation: TypeAlias = Literal["best"] | Discretisation


@dataclass(frozen=True)
@checked()
class Surface:
    """A named surface of a named body.

    Attributes:
        body: Name of the body in the scene.
        name: Name of the surface in the body's mesh.
    """

    body: str
    name: str

    @property
    def in_words(self) -> str:
        """Body and surface, by which results are found: "upper z0"."""
        return f"{self.body} {self.name}"


def _check_stiffness(name: str, given: float | None) -> None:
    if given is not None:
        remedy = "give the friction traction per tangential displacement, or none for points that do not move"
        check_positive(f"{name}.stick_stiffness", given, remedy)


@dataclass(frozen=True)
@checked()
class Coulomb:
    """Coulomb friction: ‖τ‖ ≤ friction_coefficient · λ_N, as long as that is below a shear limit.

    Slip is that of the whole load step, of points that were open at its start as well, see `LoadStep`.

    Attributes:
        friction_coefficient: Friction coefficient μ ≥ 0, dimensionless. Zero is frictionless contact. A
            function receives points of the slave, shape (n, dim), and returns μ there, shape (n,). One that
            depends on the pressure is a `FrictionTable`, or a `FrictionCurve` of your own; on the slip, with
            linear materials, a `SlipTable`.
        shear_limit: Largest friction traction by undeformed area, > 0, whatever the pressure, [force /
            length²], such as the shear strength of the softer body; a number, or a function of points as
            before. None: no limit.
        stick_stiffness: Friction traction per tangential displacement of a point that sticks, > 0, [force /
            length³]: before it slips it gives way elastically, and springs back. None: it does not move.

    Example:
        >>> hot_rolling = Coulomb(0.3, shear_limit=80.0)
        >>> dry = Coulomb(FrictionTable(pressure=(0.0, 100.0), coefficient=(0.3, 0.2)))
    """

    effect = EffectName.COULOMB
    friction_coefficient: float | OfPosition | FrictionCurve | SlipTable
    shear_limit: float | OfPosition | None = None
    stick_stiffness: float | None = None

    def __post_init__(self) -> None:
        """Refuse negative coefficients and limits, and laws that fall."""
        _check_stiffness("Coulomb", self.stick_stiffness)
        limit = self.shear_limit
        if not (limit is None or callable(limit)):
            check_positive("shear_limit", limit, "give the largest friction force per area, or none")
        for curve in self.curves:
            check_rising(curve)
        if not callable(self.value):
            remedy = "steel on steel has about 0.3; omit friction for a frictionless pair"
            check_not_negative("friction_coefficient", self.value, remedy)

    @property
    def curves(self) -> tuple[FrictionCurve, ...]:
        """How friction follows the pressure, if it is not proportional to it."""
        given = self.friction_coefficient
        return (given,) if isinstance(given, FrictionCurve) else ()

    @property
    def tables(self) -> tuple[SlipTable, ...]:
        """How the coefficient follows the slip, if it does."""
        given = self.friction_coefficient
        return (given,) if isinstance(given, SlipTable) else ()

    @property
    def value(self) -> Any:
        """The coefficient, the largest of any pressure and slip."""
        largest = [curve.largest_coefficient for curve in self.curves]
        largest += [max(table.coefficient) for table in self.tables]
        return next(iter(largest), self.friction_coefficient)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The coefficient, if it is one number."""
        return () if self.curves or self.tables or callable(self.value) else (self.value,)


@dataclass(frozen=True)
@checked()
class Tresca:
    """Friction with a slip bound that does not depend on the pressure.

    It also acts on points across an open gap, as in the classical problem with given friction. Use it where
    surfaces are known to touch.

    Attributes:
        traction: Largest tangential traction by undeformed area, ≥ 0, [force / length²]; a number, or a
            function of points as for `Coulomb`.
        stick_stiffness: Friction traction per tangential displacement of a point that sticks, > 0, [force /
            length³]: before it slips it gives way elastically, and springs back. None: it does not move.
    """

    effect = EffectName.TRESCA
    #: Neither follows the pressure or the slip, nor has a coefficient.
    curves = tables = numbers = ()
    #: The traction is one.
    shear_limit = None
    traction: float | OfPosition
    stick_stiffness: float | None = None

    def __post_init__(self) -> None:
        """Refuse a negative bound."""
        _check_stiffness("Tresca", self.stick_stiffness)
        if not callable(self.traction):
            remedy = "give the largest tangential force per unit area that the surfaces can carry"
            check_not_negative("Tresca.traction", self.traction, remedy)

    @property
    def value(self) -> Any:
        """The traction."""
        return self.traction


#: A law of friction, or none.
Friction: TypeAlias = Coulomb | Tresca | None
FRICTIONLESS = Coulomb(0.0)


class PairPart(Chosen, Part):
    """Two sides that touch or stay together: what contact pairs, ties and sides of sectors answer alike.

    Attributes:
        sliding: Whether surfaces that stay together may slide along each other.
    """

    slave: Surface
    master: Any
    sliding = False

    @property
    def geometry(self) -> Geometry:
        """Facets, as the gap between surfaces that stay together is not used."""
        return "faceted"

    @property
    def given_gap(self) -> str:
        """What the pair gives in place of measured gaps, in words; empty if nothing."""
        return ""

    @property
    def single_nodes(self) -> str:
        """Name of the node set of the slave's body whose nodes alone may touch; empty if all may."""
        return ""

    @property
    def is_self_contact(self) -> bool:
        """Whether a body meets itself, which needs large deformations."""
        return False

    @property
    def sectors(self) -> tuple[Any, ...]:
        """The pair, if it is a `CyclicSymmetry`."""
        return ()

    @property
    def tool(self) -> str:
        """Name of the rigid tool that is its master, empty if none is."""
        return ""

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Its sides that are surfaces of bodies, the slave first: all but obstacles."""
        return self.slave, self.master

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that it acts on, that of the slave first; a tool is one."""
        return tuple(side.body for side in self.surfaces)

    @property
    def between_bodies(self) -> bool:
        """Whether the master is a surface of a body, and no obstacle."""
        return len(self.surfaces) == 2

    @property
    def master_surface(self) -> Surface:
        """The master of a pair between bodies."""
        _, master = self.surfaces
        return master

    @property
    def obstacle(self) -> RigidObstacle:
        """The master of a pair with an obstacle."""
        return cast("RigidObstacle", self.master)

    @property
    def slave_geometry(self) -> Geometry:
        """The geometry of the slave: facets where single nodes touch, which may go around corners."""
        return "faceted" if self.single_nodes else self.geometry

    @property
    def by_mortar(self) -> bool:
        """Whether weighted means are compared: contact with a rigid obstacle is always nodal."""
        return self.between_bodies and self.discretisation == "mortar"

    @property
    def place(self) -> str:
        """Its surfaces: "upper z0 on lower z1", "block z0 on rigid plane"."""
        return f"{self.slave.in_words} on {self.master_in_words}"

    @property
    def master_in_words(self) -> str:
        """The surface or the obstacle that is the master: "lower z1", "rigid plane"."""
        return self.master_surface.in_words

    def _facts(self) -> dict[str, Any]:
        """Return what is given of it, and its discretisation with the reason of the scene's choice."""
        known = fields(self)  # type: ignore[arg-type]
        given = {each.name: getattr(self, each.name) for each in known if each.repr}
        given["discretisation"] = self.explained_discretisation
        return {name: value for name, value in given.items() if value is not None and value is not False}


@in_notebooks
@dataclass(frozen=True)
@checked()
class ContactPair(PairPart):
    """Two surfaces that may touch. The slave may not penetrate the master.

    Attributes:
        slave: Surface whose nodes carry the contact forces: the finer or softer one, or that with a corner
            or an edge that touches. With ``discretisation="best"`` the scene exchanges both sides where the
            master alone has one that touches first, see ``reason``, unless functions of points, gaps, nodes
            or a fluid are given, which belong to the slave.
        master: Surface of another body, or a rigid obstacle; another one of the same body where it
            deforms so much that these meet.
        friction: Law of friction; without one (None) contact is frictionless.
        discretisation: ``"node"`` keeps the gap of every slave node non-negative; ``"mortar"`` does so for
            weighted means of the gap. The former is simple. The latter (dual basis, integration over the
            common segments of both meshes) passes the contact patch test on non-matching meshes. By default,
            ``"best"``, the scene takes mortar between bodies whose meshes do not match, and nodes elsewhere.
            Contact with a rigid obstacle is always nodal.
        geometry: What gaps and normals are measured between: ``"best"``, true shapes that the meshes know,
            else smooth surfaces through the nodes; ``"reconstructed"``, always the latter; ``"faceted"``, the
            flat facets, for comparison. Between round bodies the error of facets is often larger than the
            approach of the bodies. For the shapes of meshes see `BodyMesh`.
        gap: Clearance in place of the measured one, ≥ 0, [length]: a number, or a function of the slave
            nodes, shape (n, dim), that returns one for each, shape (n,). None: as measured.
        interference: Overlap in place of the measured gap, ≥ 0, [length], given like ``gap``;
            ``"measured"`` takes the one that the geometry has, which counts as a mistake otherwise.
        closure: How far the surfaces approach under pressure: `LinearClosure`, `ExponentialClosure`,
            `ClosureTable` or a `ClosureLaw` of your own, for rough surfaces, coats and gaskets. None: contact
            is exact. With one, the gap of a closed point is minus its closure.
        fluid: Fluid under pressure that enters where contact opens, see `FluidPressure`.
        wear: Law by which the surfaces lose material as they slide, see `Wear`. None: they lose nothing.
        adjust: Slave points whose measured clearance or overlap is at most this, [length], are put in touch
            without strain, or get ``gap`` or ``interference`` if these are given; all others keep the
            measured gap. None: no point is put in touch, and ``gap`` and ``interference`` hold at all points.
        nodes: Name of a node set of the slave's body, on the slave surface: its nodes alone may touch, as
            those of a tip or an edge, each with its share of the slave surface as its area. Contact is by
            nodes then. None: the whole slave may touch.
        choice: What the scene chose where the best is asked for; see ``reason``.

    Raises:
        InvalidInputError: If the discretisation or geometry is unknown, or both gap and interference, or
            negative lengths, or nodes by mortar or within a body, are given.

    Example:
        >>> pair = ContactPair(Surface("punch", "bottom"), Surface("block", "z1"), Coulomb(0.3), "mortar")
        >>> pair.has_friction
        True
    """

    effect = EffectName.CONTACT
    slave: Surface
    master: Surface | RigidObstacle
    friction: Friction = None
    discretisation: AnyDiscretisation = "best"
    geometry: Geometry = "best"
    gap: float | OfPosition | None = None
    interference: float | OfPosition | Literal["measured"] | None = None
    adjust: float | None = None
    closure: ClosureLaw | None = None
    fluid: FluidPressure | None = None
    wear: Wear | None = None
    nodes: str | None = None
    choice: Choice = field(default=NO_CHOICE, repr=False)

    def __post_init__(self) -> None:
        """Reject gaps that contradict each other or are no lengths."""
        if isinstance(self.master, type):
            raise InvalidInputError(
                f"ContactPair.master must be a Surface or an obstacle, got the class {self.master.__name__}: "
                "write it with where it lies, such as RigidPlane((0, 0, 0), (0, 0, 1))"
            )
        if {"gap", "interference"} <= self._given_gaps.keys():
            raise InvalidInputError(
                f"a contact pair has a gap or an interference, got {self.gap!r} and {self.interference!r}: "
                "keep one of them; a function that changes its sign is no gap but two pairs"
            )
        for name, value in self._given_gaps.items():
            if value != "measured" and not callable(value):
                remedy = "give clearances by gap, overlaps by interference, as positive lengths"
                check_not_negative(f"ContactPair.{name}", value, remedy)
        if self.closure is not None:
            check_closing(self.closure)
        if self.nodes is not None and (self.discretisation == "mortar" or self.is_self_contact):
            given = "a body that meets itself" if self.is_self_contact else "discretisation='mortar'"
            raise InvalidInputError(
                f"contact of nodes {self.nodes!r} alone is by nodes and between two bodies, got {given}: "
                "leave the nodes out, or give no discretisation and a master of another body"
            )

    def effects(self, scene: Around) -> tuple[EffectName, ...]:
        """Return contact, and what its laws call for."""
        law = self._law
        laws = {
            EffectName.CLOSURE: self.closure is not None,
            EffectName.FLUID: bool(self.fluids),
            EffectName.WEAR: bool(self.wears),
            EffectName.FRICTION_CURVE: bool(law.curves or law.tables) or law.shear_limit is not None,
        }
        if self.has_friction:
            laws |= {law.effect: True, EffectName.STICK_STIFFNESS: self.stick_stiffness is not None}
        return self.effect, *(name for name, given in laws.items() if given)

    def check(self, scene: Around) -> None:
        """Reject surfaces that are not there, and what does not suit the bodies."""
        require_surface(scene, self.slave.body, self.slave.name, "ContactPair.slave")
        if self.is_self_contact:
            self._require_deforming(scene)
        for fluid in self.fluids:
            fluid.check(scene, self.slave.body, self.place)
        for wear in self.wears:
            wear.check(scene, self.surfaces)
        if self.nodes is not None:
            self._require_touching(scene, self.nodes)
        if self._law.tables:
            remedy = "give the coefficient of each load step as a number or a function of the place"
            require_linear(scene, f"the SlipTable of {self.place}", remedy)
        for master in self.surfaces[1:]:
            require_surface(scene, master.body, master.name, "ContactPair.master")
        if not self.between_bodies:
            _require_dimension(scene, self.obstacle)

    def _require_deforming(self, scene: Around) -> None:
        """Reject contact of a body with itself unless it may deform much."""
        materials = scene.bodies[self.slave.body].materials
        deforming = any(is_nonlinear(each) and getattr(each, "finite", True) for each in materials)
        if self.discretisation == "mortar" or self.given_gap or not deforming:
            raise InvalidInputError(
                f"contact of body {self.slave.body!r} with itself needs a material for large deformations, "
                "such as NeoHooke, discretisation='node' and gaps as they are: give these, or split the body"
            )

    def _require_touching(self, scene: Around, nodes: str) -> None:
        """Reject nodes that may touch without a node set of the slave's mesh, or off the slave surface."""
        mesh = scene.bodies[self.slave.body].mesh
        words = f"ContactPair.nodes names node set {nodes!r} of body {self.slave.body!r}, which has"
        check_known(nodes, mesh.node_sets, words)
        away = ~np.isin(mesh.node_sets[nodes], mesh.surfaces[self.slave.name])
        if away.any():
            raise InvalidInputError(
                f"nodes of {self.place} that may touch must lie on its slave surface, {int(away.sum())} of "
                f"{len(away)} of {nodes!r} do not: name a slave surface that has them all"
            )

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """Its sides that are surfaces of bodies, the slave first: all but obstacles."""
        return (self.slave, self.master) if isinstance(self.master, Surface) else (self.slave,)

    @property
    def moving(self) -> tuple[MovingObstacle, ...]:
        """The obstacle that is its master, if that moves as prescribed."""
        return (self.master,) if isinstance(self.master, MovingObstacle) else ()

    @property
    def obstacle_at_rest(self) -> RigidObstacle:
        """The obstacle before it moves as prescribed."""
        return next((each.obstacle for each in self.moving), self.obstacle)

    @property
    def single_nodes(self) -> str:
        """Name of the node set of the slave's body whose nodes alone may touch; empty if all may."""
        return self.nodes or ""

    @property
    def tool(self) -> str:
        """Name of the rigid tool that is its master, empty if none is."""
        return self.master.name if isinstance(self.master, RigidTool) else ""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that it acts on, that of the slave first; a tool is one."""
        return (*super().bodies, self.tool) if self.tool else super().bodies

    @property
    def is_self_contact(self) -> bool:
        """Whether a body meets itself, which needs large deformations."""
        return any(master.body == self.slave.body for master in self.surfaces[1:])

    @property
    def within_body(self) -> bool:
        """The old name of `is_self_contact`, until 0.4."""
        warn_of_old_name("ContactPair.within_body", "is_self_contact")
        return self.is_self_contact

    @property
    def depends_on_slave(self) -> bool:
        """Whether something is given of the slave's points, so that the other side cannot take its place."""
        measured = all(value == "measured" for value in self._given_gaps.values())
        varies = self.friction_varies or callable(self.shear_limit)
        return varies or not measured or bool(self.single_nodes or self.fluids or self.wears)

    @property
    def fluids(self) -> tuple[FluidPressure, ...]:
        """The fluid that enters, if one does."""
        return () if self.fluid is None else (self.fluid,)

    @property
    def wears(self) -> tuple[Wear, ...]:
        """The law of wear, if there is one."""
        return () if self.wear is None else (self.wear,)

    def repeated(self, cycles: float) -> ContactPair:
        """Return the pair whose wear, if it has any, is that of so many cycles of a load step."""
        return replace(self, wear=replace(*self.wears, cycles=cycles)) if self.wears else self

    @property
    def of_rows(self) -> ContactPair:
        """The pair in all that its rows depend on: whatever fluid is in it, and however often it slides."""
        if not (self.fluids or self.wears):
            return self
        wear = next((replace(each, cycles=1.0) for each in self.wears), None)
        return replace(self, fluid=None, wear=wear)

    @property
    def _given_gaps(self) -> dict[str, Any]:
        """What is given of gaps, by the names of the fields."""
        given = {"gap": self.gap, "interference": self.interference, "adjust": self.adjust}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def master_in_words(self) -> str:
        """The surface or the obstacle that is the master: "lower z1", "rigid plane"."""
        if self.between_bodies:
            return super().master_in_words
        return self.tool or name_in_words(type(self.master).__name__)

    @property
    def given_gap(self) -> str:
        """What the pair gives in place of measured gaps, in words; empty if nothing."""
        words = {"adjust": "in touch within"}
        given = self._given_gaps.items()
        return ", ".join(f"{words.get(name, name)} {_in_words(value)}" for name, value in given)

    def gap_at(self, points: np.ndarray) -> np.ndarray | None:
        """Return the gap or, as a negative number, the interference that the pair gives; None if none.

        Args:
            points: Coordinates of slave nodes, shape (n, dim), [length].

        Returns:
            Shape (n,), [length].

        Raises:
            InvalidInputError: If a function returns anything but lengths of zero or more.
        """
        given = self._given_gaps
        if "gap" in given:
            return not_negative(f"gap of {self.place}", given["gap"], points)
        if given.get("interference", "measured") == "measured":
            return None
        return -not_negative(f"interference of {self.place}", given["interference"], points)

    @property
    def gives_all_gaps(self) -> bool:
        """Whether no gap of the pair is measured."""
        given = self._given_gaps
        return "adjust" not in given and any(value != "measured" for value in given.values())

    @property
    def has_friction(self) -> bool:
        """Whether tangential forces can be transmitted at all."""
        return self.friction_varies or self.friction_value > 0

    @property
    def friction_varies(self) -> bool:
        """Whether friction is given as a function of position."""
        return callable(self.friction_value)

    @property
    def _law(self) -> Coulomb | Tresca:
        """The law of friction, without one that of a coefficient of zero."""
        return self.friction or FRICTIONLESS

    @property
    def friction_curve(self) -> FrictionCurve | None:
        """How friction follows the pressure where it is not proportional to it."""
        return next(iter(self._law.curves), None)

    @property
    def slip_table(self) -> SlipTable | None:
        """How the friction coefficient follows the slip; None where it does not."""
        return next(iter(self._law.tables), None)

    @property
    def shear_limit(self) -> float | OfPosition | None:
        """Largest friction traction, whatever the pressure; None if there is none."""
        return self._law.shear_limit

    @property
    def stick_stiffness(self) -> float | None:
        """Friction traction per elastic slip; None where points that stick do not move."""
        return self._law.stick_stiffness

    @property
    def friction_value(self) -> Any:
        """Friction coefficient, the largest of any pressure, or Tresca's traction; zero without friction."""
        return self._law.value

    def friction_at(self, points: np.ndarray) -> np.ndarray:
        """Return the friction coefficient, or Tresca's traction, at points of the slave, shape (n,).

        Raises:
            InvalidInputError: If a function returns something other than numbers of at least zero.
        """
        return not_negative(f"friction of {self.place}", self.friction_value, points)

    def limit_at(self, points: np.ndarray) -> np.ndarray:
        """Return the shear limit at points of the slave, infinite where there is none, shape (n,).

        Raises:
            InvalidInputError: If a function returns something other than numbers of at least zero.
        """
        limit = np.inf if self.shear_limit is None else self.shear_limit
        return not_negative(f"shear limit of {self.place}", limit, points)


@in_notebooks
@dataclass(frozen=True)
@checked()
class Tie(PairPart):
    """Two surfaces that stay together: they neither separate nor, unless ``sliding``, shift.

    An initial gap between their meshes stays as it is.

    Attributes:
        slave: Surface whose nodes carry the forces; the finer mesh is the better slave.
        master: Surface of another body, or another one of the same, as where a slit is closed; nodes that
            are on both, as at its end, need no tie.
        sliding: Whether the surfaces may slide along each other: contact known to be closed.
        discretisation: ``"node"`` ties every slave node to its master facet, ``"mortar"`` ties weighted
            means, ``"best"``, the default, leaves it to the scene. See `ContactPair`.
        choice: As in `ContactPair`.
    """

    effect = EffectName.TIE
    slave: Surface
    master: Surface
    sliding: bool = False
    discretisation: AnyDiscretisation = "best"
    choice: Choice = field(default=NO_CHOICE, repr=False)

    def __post_init__(self) -> None:
        """Reject a surface that is tied to itself."""
        if self.slave == self.master:
            raise InvalidInputError(f"Tie needs two surfaces, got {self.place}: name the other as master")

    def check(self, scene: Around) -> None:
        """Reject surfaces that are not there."""
        require_surface(scene, self.slave.body, self.slave.name, "Tie.slave")
        require_surface(scene, self.master.body, self.master.name, "Tie.master")


@tabled
class Pairs(tuple[ContactPair, ...]):
    """The contact pairs of a scene, which are shown as a table."""

    def _tables(self) -> list[Table]:
        """Return a table with one line for each pair."""
        head = ("", "surfaces", "friction", "discretisation")
        rows = [
            (
                f"contact {number}", pair.place, in_short(pair.friction or "none"),
                pair.explained_discretisation,
            )
            for number, pair in enumerate(self)
        ]  # fmt: skip
        return [Table([head, *rows], 4)] if rows else []


def _require_dimension(scene: Around, obstacle: RigidObstacle) -> None:
    """Reject an obstacle whose dimension, if it has one, is not that of the bodies."""
    needed = scene.kinematics.dim
    dim = getattr(obstacle, "dim", needed)
    if dim != needed:
        raise InvalidInputError(
            f"an obstacle must lie in the space of the bodies, got a {type(obstacle).__name__} in {dim} "
            f"dimensions: give it {needed} coordinates; in the plane a RigidSphere is a round bar"
        )


def _in_words(value: float | OfPosition | str) -> str:
    if callable(value):
        return "by a function"
    return "measured" if value == "measured" else f"{value:g}"


def named(which: str, surfaces: Sequence[str], places: Sequence[str]) -> list[int]:
    """Return the numbers of all entries of a list that are on a surface, or on a pair of surfaces."""
    found = [k for k, names in enumerate(zip(surfaces, places, strict=True)) if which in names]
    if not found:
        known = ", ".join(dict.fromkeys(map(repr, places))) or "no entry"
        raise InvalidInputError(
            f"a result by name needs the body and the surface of one of the list, which has {known}; got "
            f"{which!r}: name one of them"
        )
    return found


def pair_number(contacts: Sequence[ContactPair], which: int | str) -> int:
    """Return the number of a contact pair that is given by it, by its slave, or by both surfaces."""
    if isinstance(which, str):
        places = [pair.place for pair in contacts]
        first, *others = named(which, [pair.slave.in_words for pair in contacts], places)
        if others:
            raise InvalidInputError(
                f"one contact pair is needed, {which!r} is the slave of {1 + len(others)}: give "
                f"{places[first]!r}, or another of {[places[k] for k in others]}, or a number from 0"
            )
        return first
    if which not in range(len(contacts)):
        raise InvalidInputError(
            f"a contact pair has a number from 0 to {len(contacts) - 1}, or the name of its slave, got "
            f"{which!r}: the scene has {', '.join(repr(pair.place) for pair in contacts) or 'no pair'}"
        )
    return int(which)
