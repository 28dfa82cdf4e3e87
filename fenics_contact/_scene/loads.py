"""Loads, each on one named body or on one of its surfaces.

Loads are dead: they keep direction and size while the body deforms; `Pressure` alone follows the surface of a
body that deforms much. Values are numbers, functions of position
(evaluated at the nodes and interpolated) or `Ufl`. Loads are values: two with the same numbers, or with the
same function object, are equal, and a vector assembled for one is reused for the other. A function must
therefore always return the same values for the same points.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.checks import GivenVector, check_row, checked, floats, naming_arguments, unit_vector
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._scene.body import Body
from fenics_contact._scene.checks import check_entries, check_known, plain_numbers
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.fields import (
    ScalarValue,
    Ufl,
    VectorValue,
    checked_scalar,
    checked_vector,
    evaluate,
    numbers_of_vector,
)
from fenics_contact._scene.load_part import LoadPart, RegionLoad, SurfaceLoad
from fenics_contact._scene.part import Around, body_of, require_nodes, require_surface, require_vector
from fenics_contact._surfaces.facets import gauss_points, quadrature_areas
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import Transverse, can_expand
from fenics_contact.materials.hyperelastic import is_nonlinear
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas


@dataclass(frozen=True)
@checked("value")
class Traction(SurfaceLoad):
    """Dead surface load.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Force per reference area, [force / length²] (in the plane: per unit of thickness). A function
            receives points, shape (n, dim), and returns the traction there, shape (n, dim).

    Example:
        >>> even = Traction("block", "z1", (200.0, 0.0, -500.0))  # N/mm²
        >>> rising = Traction("block", "z1", lambda x: -10.0 * x[:, :1] * (0.0, 0.0, 1.0))
    """

    body: str
    surface: str
    value: VectorValue

    def __post_init__(self) -> None:
        """Reject a value that is not a vector."""
        object.__setattr__(self, "value", checked_vector("Traction.value", self.value))

    def _total(self, body: Body, value: np.ndarray) -> np.ndarray:
        """Return the resultant of a value."""
        facets = body.mesh.surfaces[self.surface]
        return value * float(quadrature_areas(body.mesh.points, facets, body.kinematics.measure).sum())

    def check(self, scene: Around) -> None:
        """Reject a vector of another space, and a surface without an area."""
        require_surface(scene, self.body, self.surface, "Traction")
        of = scene.bodies[self.body].kinematics
        require_vector(self.value, of.components, of.vector_in_words, "Traction", self.body)
        _require_area(scene, self.body, self.surface)


@dataclass(frozen=True)
@checked("value")
class TotalForce(SurfaceLoad):
    """Dead surface load given by its resultant, spread over the surface of the undeformed body.

    Without ``moment`` and ``at`` it is an even traction. With them the traction is a + b × (x − c), c being
    the centroid of the surface, with a and b such that the resultant is exactly the force at the point and
    the moment: even from the force, linear across the surface from the moment. The surface may deform;
    for one that moves as a rigid piece see `RigidSurface`.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Resultant, [force] (in the plane: per unit of thickness).
        moment: Moment besides that of the force, three numbers in space, in the plane one, positive from x to
            y, [force·length]; none by default.
        at: Point at which the force acts, [length]; by default the centroid of the surface.

    Example:
        >>> torque = TotalForce("shaft", "end", (0.0, 0.0, 0.0), moment=(0.0, 0.0, 2e4))  # N, N mm
        >>> eccentric = TotalForce("bracket", "plate", (0.0, 0.0, -500.0), at=(40.0, 0.0, 10.0))
    """

    body: str
    surface: str
    value: GivenVector
    moment: GivenVector | float | None = None
    at: GivenVector | None = None

    def __post_init__(self) -> None:
        """Reject a force, a moment or a point that is not made of finite numbers."""
        for name in ("moment", "at"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, _numbers(f"TotalForce.{name}", given))
        remedy = "give one for x, y and z; what depends on position is a Traction"
        value = numbers_of_vector("TotalForce.value", self.value, remedy)
        object.__setattr__(self, "value", value)

    def check(self, scene: Around) -> None:
        """Reject a resultant, a moment or a point that its body cannot have."""
        require_surface(scene, self.body, self.surface, "TotalForce")
        of, where = scene.bodies[self.body].kinematics, f"surface {self.surface!r} of body {self.body!r}"
        require_vector(self.value, of.resultant_components, of.resultant_in_words, "TotalForce", self.body)
        _require_area(scene, self.body, self.surface)
        if not of.has_moment(self.moment, self.at):
            raise InvalidInputError(
                f"TotalForce on {where} of a body of revolution acts along its axis and outwards alone, got "
                f"moment {self.moment!r} and at {self.at!r}: leave both out"
            )
        dim = scene.bodies[self.body].mesh.dim
        if self.moment is not None and np.shape(self.moment) != (() if dim == 2 else (3,)):
            needed = "one number, positive from x to y" if dim == 2 else "three numbers, about x, y and z"
            raise InvalidInputError(f"TotalForce.moment on {where} must be {needed}, got {self.moment!r}")
        if self.at is not None:
            remedy = "give a point, or none for the centroid of the surface"
            check_entries(f"TotalForce.at of the force on {where}", self.at, dim, remedy)


def _require_area(scene: Around, name: str, surface: str) -> None:
    """Reject a surface on the axis of revolution."""
    body = scene.bodies[name]
    if body.on_axis[body.mesh.surfaces[surface]].all():
        raise InvalidInputError(
            f"a load needs an area, {surface!r} of body {name!r} lies on the axis of revolution: take another"
        )


def _numbers(name: str, given: GivenVector | float) -> GivenVector | float:
    """Return finite numbers as plain ones."""
    if not np.isfinite(given).all():
        raise InvalidInputError(f"{name} must be finite numbers, got {given!r}: correct it")
    return plain_numbers(given)


@dataclass(frozen=True)
@checked("value")
class Pressure(SurfaceLoad):
    """Load normal to a surface; positive presses on the body, traction = −p n.

    On a body of a material for large deformations it follows the surface, f = −p cof F N per undeformed area:
    it stays normal to the surface as it lies now, and grows with its area. Elsewhere surfaces keep their
    places.

    Attributes:
        body: Name of the body.
        surface: Name of its surface.
        value: Pressure p, [force / length²]; a function of position is one of the undeformed body.
        dead: Whether it keeps the direction and size that it has on the undeformed surface.

    Example:
        >>> gas = Pressure("tyre", "inside", 0.2)  # N/mm²
        >>> weight_of_snow = Pressure("membrane", "top", 1e-3, dead=True)
    """

    kind = "pressure"
    is_scalar = True
    body: str
    surface: str
    value: ScalarValue
    dead: bool = False

    def __post_init__(self) -> None:
        """Reject a value that is not a scalar."""
        object.__setattr__(self, "value", checked_scalar("Pressure.value", self.value))

    def effects(self, scene: Around) -> tuple[EffectName, ...]:
        """Return that of a load on a surface, and whether it follows that."""
        return self.effect, *(EffectName.FOLLOWING_PRESSURE for _ in self.following(scene))

    def following(self, scene: Around) -> tuple[Pressure, ...]:
        """Return it if it follows its surface, as on bodies that deform much, else nothing."""
        return (self,) if scene.bodies[self.body].deforms_much and not self.dead else ()

    def _total(self, body: Body, value: np.ndarray) -> np.ndarray:
        """Return the resultant of a value."""
        points, facets = body.mesh.points, body.mesh.surfaces[self.surface]
        measure = body.kinematics.measure
        if measure.varies:
            normals = sum(at.normals.sum(axis=0) for at in gauss_points(points, facets, measure))
            return np.asarray(-value * normals)
        return np.asarray(-value * vector_areas(points, facets).sum(axis=0))

    def check(self, scene: Around) -> None:
        """Reject a surface without an area."""
        require_surface(scene, self.body, self.surface, "Pressure")
        _require_area(scene, self.body, self.surface)


@dataclass(frozen=True)
@checked("value")
class BodyForce(RegionLoad):
    """Dead load on the volume; for weight see `gravity`.

    Attributes:
        body: Name of the body.
        value: Force per volume, [force / length³].
        region: Name of the region of its mesh that is loaded; all of the body by default.
    """

    kind = "body force"
    effect = EffectName.BODY_FORCE
    body: str
    value: VectorValue
    region: str | None = None

    def __post_init__(self) -> None:
        """Reject a value that is not a vector."""
        object.__setattr__(self, "value", checked_vector("BodyForce.value", self.value))

    def _total(self, body: Body, value: np.ndarray) -> np.ndarray:
        """Return the resultant of a value."""
        return value * body.volume_of(self.on_region)

    def check(self, scene: Around) -> None:
        """Reject a vector of another space, an unknown region and an axis that the body does not have."""
        of = body_of(scene, self.body, "BodyForce").kinematics
        require_vector(self.value, of.components, of.vector_in_words, "BodyForce", self.body)
        require_region(self, scene.bodies[self.body].mesh)
        for spinning in self._spinning:
            spinning.require_axis(scene.kinematics)

    @property
    def _spinning(self) -> tuple[Spinning, ...]:
        """Its value, if it is a centrifugal force."""
        return (self.value,) if isinstance(self.value, Spinning) else ()

    def in_scene(self, scene: Around) -> BodyForce:
        """Return the load with as many components as its body has; what spins has nothing around the axis."""
        of = scene.kinematics
        if of.components > of.dim and self._spinning:
            return replace(self, value=replace(*self._spinning, components=of.components))
        return self


@dataclass(frozen=True)
@checked("temperature_change")
class ThermalStrain(LoadPart):
    """A temperature change that would strain the body if it were free: σ = C : (ε(u) − ΔT α).

    Its work is ∫ ΔT (C : α) : ε(v). Several on one body add up. The energy of a state counts it as the work
    of a load, so that a freely expanding body has the strain energy of its expansion although it is free of
    stress. In nonlinear materials it is no load: metals of small strain have the stress of ∇u − ΔT α I,
    others that of F / θ with θ = 1 + ΔT α, of which the energy per undeformed volume is θ³ W(F / θ).

    Attributes:
        body: Name of the body, whose materials must have a thermal expansion.
        temperature_change: ΔT relative to the stress-free temperature, in degrees; no `Ufl` where materials
            are nonlinear.
    """

    kind = "thermal strain"
    is_scalar = by_materials = True
    effect = EffectName.THERMAL_STRAIN
    body: str
    temperature_change: ScalarValue

    def __post_init__(self) -> None:
        """Reject a value that is not a scalar."""
        value = checked_scalar("ThermalStrain.temperature_change", self.temperature_change)
        object.__setattr__(self, "temperature_change", value)

    def resultant(self, body: Body) -> np.ndarray:
        """Return zero."""
        return np.zeros(body.mesh.dim)

    @property
    def temperatures(self) -> tuple[ThermalStrain, ...]:
        """Itself."""
        return (self,)

    def check(self, scene: Around) -> None:
        """Reject materials that do not expand."""
        materials = body_of(scene, self.body, "ThermalStrain").materials
        stiff = [material for material in materials if not can_expand(material)]
        if stiff:
            raise InvalidInputError(
                f"ThermalStrain needs a thermal expansion of every material of body {self.body!r}, got none "
                f"for {stiff[0]!r}: give the material its thermal_expansion"
            )

    @property
    def value(self) -> ScalarValue:
        """ΔT, under the name that all loads have."""
        return self.temperature_change


@dataclass(frozen=True)
@checked("value")
class InitialStress(RegionLoad):
    """A stress that a body has before anything loads or moves it: of welding, rolling, an earlier process.

    The body relaxes it as far as its supports let it: σ = σ₀ + C : ε(u), and the work of σ₀ is
    −∫ σ₀ : ε(v). A field that is in equilibrium with free surfaces moves nothing. Several add up. As with
    `ThermalStrain` the energy of a state counts it as the work of a load.

    Attributes:
        body: Name of the body, whose materials must be linear.
        value: σ₀, [force / length²], six numbers: xx, yy, zz, yz, xz, xy; of plane bodies yz and xz are
            zero, in plane stress also zz; of bodies of revolution x, y and z are the radius, the axis and the
            way around. A function receives the centres of cells (means of their nodes), shape (n, dim), and
            returns the stress there, shape (n, 6), which is constant on each cell.
        region: Name of the region of its mesh that has it; all of the body by default.

    Example:
        >>> skin = InitialStress("plate", (-300.0, -300.0, 0, 0, 0, 0), region="peened")  # N/mm²
        >>> rolled = InitialStress("bar", lambda x: np.outer(x[:, 2] ** 2 - 8.3, (12.0, 0, 0, 0, 0, 0)))
    """

    kind = "initial stress"
    by_cell = True
    effect = EffectName.INITIAL_STRESS
    body: str
    value: VectorValue
    region: str | None = None

    def __post_init__(self) -> None:
        """Reject a value that is neither six numbers nor a function."""
        _refuse_ufl("InitialStress.value", self.value)
        if not callable(self.value):
            check_row(self.value, "InitialStress.value", 6)
            object.__setattr__(self, "value", floats(np.asarray(self.value, dtype=np.float64)))

    def resultant(self, body: Body) -> np.ndarray:
        """Return zero."""
        return np.zeros(body.mesh.dim)

    @property
    def stresses(self) -> tuple[InitialStress, ...]:
        """Itself."""
        return (self,)

    def width(self, components: int) -> tuple[int, ...]:
        """Return the shape of its value at a point: six numbers."""
        return (6,)

    def check(self, scene: Around) -> None:
        """Reject nonlinear materials, an unknown region and numbers for components that are zero."""
        body = body_of(scene, self.body, "InitialStress")
        require_region(self, body.mesh)
        stiff = [type(each).__name__ for each in body.materials if is_nonlinear(each)]
        if stiff:
            raise InvalidInputError(
                f"InitialStress needs linear materials, body {self.body!r} has {stiff[0]}: take one of small "
                "strains without a history, such as IsotropicElasticity"
            )
        if not callable(self.value):
            self.require_components(np.array([self.value]), body)

    def require_components(self, stress: np.ndarray, body: Body) -> None:
        """Reject components that are not zero but have no place in a body; `stress`: (n, 6)."""
        places = {"zz": 2, "yz": 3, "xz": 4}
        across = all(isinstance(each, Transverse) for each in body.materials)
        without = [word for word in body.kinematics.zero_stress if not (across and word == "zz")]
        given = [word for word in without if stress[:, places[word]].any()]
        if given:
            raise InvalidInputError(
                f"the InitialStress of body {self.body!r} must be zero in {' and '.join(without)}, got "
                f"others in {' and '.join(given)}: leave them zero; the order is xx, yy, zz, yz, xz, xy"
            )

    def on_cells(self, mesh: BodyMesh) -> np.ndarray:
        """Return the stress of all cells of a mesh, (n_cells, 6).

        Raises:
            InvalidInputError: If a function does not return six finite numbers per point, or components
                are not zero that plane bodies do not have.
        """
        where = mesh.regions[self.on_region] if self.on_region else np.arange(mesh.n_cells)
        found = np.zeros((mesh.n_cells, 6))
        if callable(self.value):
            centres = mesh.points[mesh.cells[where]].mean(axis=1)
            found[where] = evaluate(f"InitialStress on body {self.body!r}", self.value, centres, (6,))
        else:
            found[where] = self.value
        return found


@dataclass(frozen=True)
@checked("value")
class PointForce(LoadPart):
    """Dead forces at single nodes.

    Under a force at a point an elastic body has no finite displacement or stress: both grow as its mesh is
    refined, and only what is far away has a limit. Where the force comes through an area give a `TotalForce`.

    Attributes:
        body: Name of the body.
        nodes: Name of a node set or of a surface of its mesh, each of whose nodes is loaded.
        value: The force on each node, [force] (in the plane: per unit of thickness; on bodies of revolution:
            per revolution). A function receives their points, shape (n, dim), and returns the forces there,
            shape (n, dim).

    Example:
        >>> tip = PointForce("beam", "tip", (0.0, 0.0, -100.0))  # N
    """

    effect = EffectName.POINT_FORCE
    body: str
    nodes: str
    value: VectorValue

    def __post_init__(self) -> None:
        """Reject a value that is not a vector."""
        _refuse_ufl("PointForce.value", self.value)
        object.__setattr__(self, "value", checked_vector("PointForce.value", self.value))

    def nodes_in(self, mesh: BodyMesh) -> np.ndarray:
        """Return its nodes in the mesh of its body, ascending."""
        return mesh.nodes_of(self.nodes)

    def _total(self, body: Body, value: np.ndarray) -> np.ndarray:
        """Return the resultant of a value."""
        return value * len(self.nodes_in(body.mesh))

    @property
    def at_points(self) -> tuple[PointForce, ...]:
        """Itself."""
        return (self,)

    def check(self, scene: Around) -> None:
        """Reject nodes that are not there, and a vector of another space."""
        require_nodes(scene, self.body, self.nodes, "PointForce")
        of = scene.bodies[self.body].kinematics
        require_vector(self.value, of.components, of.vector_in_words, "PointForce", self.body)

    def at(self, points: np.ndarray, components: int) -> np.ndarray:
        """Return the forces on nodes at points, (n, dim) to (n, components).

        Raises:
            InvalidInputError: If a function does not return one finite vector per point.
        """
        if callable(self.value):
            name = f"PointForce on nodes {self.nodes!r} of body {self.body!r}"
            return evaluate(name, self.value, points, (components,))
        return np.tile(np.asarray(self.value, dtype=np.float64), (len(points), 1))


#: Any load of a scene.
Load = Traction | TotalForce | Pressure | BodyForce | ThermalStrain | InitialStress | PointForce


def _refuse_ufl(name: str, value: object) -> None:
    """Reject what only forms can integrate."""
    if isinstance(value, Ufl):
        raise InvalidInputError(
            f"{name} must be numbers or a function of points, got {value!r}: leave UFL out"
        )


def require_region(load: BodyForce | InitialStress, mesh: BodyMesh) -> None:
    """Reject a region that a mesh does not have."""
    if load.region is not None:
        words = f"{type(load).__name__} names region {load.region!r} of body {load.body!r}, whose mesh has"
        check_known(load.region, mesh.regions, words, "use one of them, or none for the whole body")


def initial_stress(loads: Iterable[InitialStress], body: Body) -> np.ndarray:
    """Return the sum of initial stresses on the cells of a body, (n_cells, 6), xx, yy, zz, yz, xz, xy."""
    total = np.zeros((body.mesh.n_cells, 6))
    for load in loads:
        found = load.on_cells(body.mesh)
        load.require_components(found, body)
        total += found
    return total


def gravity(body: str, density: float, acceleration: Sequence[float], region: str | None = None) -> BodyForce:
    """Return the weight of a body, or of a region of it.

    Args:
        body: Name of the body.
        density: Mass per volume, in the scene's units, for steel in N, mm, s: 7.85e-9.
        acceleration: Acceleration of gravity, [length / time²], for instance (0, 0, -9810).
        region: Name of the region of its mesh that has this density; all of the body by default.

    Example:
        >>> weights = [gravity("beam", rho, (0, 0, -9810), part) for part, rho in
        ...            {"steel": 7.85e-9, "concrete": 2.4e-9}.items()]
    """
    mass, along = checked_scalar("density", density), checked_vector("acceleration", acceleration)
    if callable(mass) or callable(along):
        raise InvalidInputError(
            f"gravity needs numbers, got {density!r} and {acceleration!r}: give a BodyForce that varies"
        )
    return BodyForce(body, tuple(mass * component for component in along), region)


@dataclass(frozen=True)
class Spinning:
    """Force per volume ρ ω² r on what turns about an axis, r being the way from the axis to the point.

    Attributes:
        point: A point of the axis, [length].
        axis: Unit vector along it; None in the plane, where it is normal to the plane.
        components: Number of components of the force; by default as many as points have coordinates.
    """

    density: float
    speed: float
    point: GivenVector
    axis: GivenVector | None
    components: int = 0

    def require_axis(self, kinematics: Kinematics) -> None:
        """Reject an axis that a body does not have."""
        if not kinematics.has_axis(self.point, self.axis):
            needed = kinematics.axis_in_words
            raise InvalidInputError(
                f"a centrifugal force needs the axis of the body, with {needed}, got point {self.point!r} "
                f"and axis {self.axis!r}: give these"
            )

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the force per volume at points, (n, dim) to (n, components)."""
        arms = points - np.array(self.point)
        if self.axis is not None:
            along = np.array(self.axis)
            arms = arms - (arms @ along)[:, None] * along
        more = max(self.components - points.shape[1], 0)
        return np.pad(self.density * self.speed**2 * arms, ((0, 0), (0, more)))


@naming_arguments
def centrifugal(
    body: str,
    density: float,
    speed: float,
    point: GivenVector = (0.0, 0.0, 0.0),
    axis: GivenVector | None = None,
    region: str | None = None,
) -> BodyForce:
    """Return the centrifugal force ρ ω² r on a body that turns about an axis; its supports turn with it.

    It acts as on the undeformed body, and is exact for its cells, as it is linear in the coordinates.

    Args:
        body: Name of the body.
        density: Mass per volume, in the scene's units, for steel in N, mm, s: 7.85e-9.
        speed: Angular velocity ω, in radians per time; 2π n for n turns per unit of time.
        point: A point of the axis, three coordinates, two in the plane, [length].
        axis: Direction of the axis, of any length, by default that of z. A body of revolution turns about its
            own axis, (0, 1); another plane body about an axis normal to the plane, which has none here.
        region: Name of the region of its mesh that has this density; all of the body by default.

    Raises:
        InvalidInputError: If numbers are not finite, or point and axis are not in one space.

    Example:
        >>> disc = centrifugal("disc", 7.85e-9, 2 * np.pi * 50.0)  # 3000 turns per minute
        >>> rotor = centrifugal("rotor", 7.85e-9, 314.0, (0.0, 0.0), (0.0, 1.0))  # of revolution
    """
    numbers = np.asarray([density, speed], dtype=np.float64)
    if not np.isfinite(numbers).all() or len(point) not in (2, 3) or not np.isfinite(point).all():
        raise InvalidInputError(
            "a centrifugal force needs finite numbers and the coordinates of a point, got density "
            f"{density!r}, speed {speed!r} and point {point!r}: give them"
        )
    if axis is None:
        along: GivenVector | None = (0.0, 0.0, 1.0) if len(point) == 3 else None
    else:
        along = unit_vector("the axis of a centrifugal force", axis, len(point))
    return BodyForce(body, Spinning(float(density), float(speed), floats(np.asarray(point)), along), region)


def point_mass(
    body: str, surface: str, mass: float, acceleration: Sequence[float], at: GivenVector | None = None
) -> TotalForce:
    """Return the weight of a mass that is fastened to a surface, which stays as flexible as the body.

    Args:
        body: Name of the body.
        surface: Name of the surface that carries it.
        mass: The mass, in the scene's units, for steel in N, mm, s: in tonnes.
        acceleration: Acceleration of gravity, or minus that of the body, [length / time²].
        at: Centre of the mass, which need not lie in the body, [length]; by default the surface's centroid.

    Example:
        >>> motor = point_mass("frame", "seat", 0.025, (0, 0, -9810), at=(0, 0, 180))  # 25 kg, N and mm
    """
    remedy = "give that of the point mass along each axis, in the scene's units"
    pulled = numbers_of_vector("acceleration", acceleration, remedy)
    if not np.isfinite(mass):
        raise InvalidInputError(f"a point mass must be finite, got {mass!r}: give it in the scene's units")
    return TotalForce(body, surface, tuple(float(mass) * component for component in pulled), at=at)
