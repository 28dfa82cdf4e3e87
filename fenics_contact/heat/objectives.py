"""Quantities of temperatures and heat with their derivatives by temperatures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._adaptive.contact_residuals import Places
from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_known
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import surface_of
from fenics_contact.design.adjoint import WeakChoice, WeakPoints
from fenics_contact.design.objective import Objective
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.averages import nodal_sum
from fenics_contact.feti.decomposition import Decomposition, prescribed_along
from fenics_contact.heat.assembly import Assembly, Heated, Rate
from fenics_contact.heat.conductance import Touch
from fenics_contact.heat.forms import HeatForms, Part
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.points_of_cells import PointsOfCells
from fenics_contact.heat.problem import GivenContact, as_given
from fenics_contact.heat.properties import slope_of
from fenics_contact.heat.scene import HeatScene
from fenics_contact.mesh.cell_types import quadrature

if TYPE_CHECKING:
    from fenics_contact.heat.state import HeatState


class NoMechanics:
    """Nothing moves the bodies: pressures and gaps of contacts are those of the scene."""

    #: Whether temperatures change nothing in it, how J − wᵀ R depends on them through it, what J misses.
    is_fixed, by_temperature, missing = True, 0.0, 0.0
    #: Contact points that only just touch, or are about to slip.
    weak = WeakPoints(0, 0, 0, WeakChoice.RELEASED)

    def of_scenes(self, scenes: Any) -> tuple[HeatScene, Any]:
        """Return the heat of what a user makes of variables, and the mechanics of it."""
        return scenes, self

    def at(self, values: np.ndarray, joints: Joints) -> Any:
        """Return mechanics at temperatures of all nodes, (n_nodes,). Collective."""
        return self

    def given(self, joints: Joints) -> GivenContact:
        """Return pressures, gaps and work at the points where heat passes. Collective."""
        return as_given(joints)

    def check(self, at: AtTemperatures, state: HeatState, quantity: HeatObjective) -> None:
        """Reject contacts that are not those at temperatures, and what depends on more. Collective."""
        h = np.zeros(at.joints.points.count)
        for number, each in enumerate(state.contacts):
            h[at.joints.points.pair == number] = each.conductance
        if not np.allclose(h, at.conductance / at.joints.area, rtol=1e-6, atol=0.0):
            raise InvalidInputError(
                "an adjoint of heat alone needs the pressures and gaps of its scene, mechanics closed the "
                "contacts of this state: give the HeatedState, or solve the scene by solve_heat"
            )

    def value(self, objective: Objective) -> float:
        """Return a quantity of mechanics. Collective."""
        raise InvalidInputError(
            f"{type(objective).__name__} is a quantity of mechanics, and this state has none: take the "
            "result of solve_heated, or a quantity of heat such as TemperatureMean"
        )

    def following(self, at: AtTemperatures, quantity: HeatObjective, w: np.ndarray) -> Any:
        """Return it with its adjoint of J − wᵀ R. Collective."""
        return self


@dataclass(frozen=True, eq=False)
class AtTemperatures:
    """A scene at given temperatures, which need not be in balance; held ones are at what the scene says."""

    scene: HeatScene
    decomposition: Decomposition
    joints: Joints
    parts: tuple[Part, ...]
    heated: tuple[Heated, ...]
    values: np.ndarray
    mechanics: NoMechanics
    given: GivenContact

    @classmethod
    def of(
        cls,
        scene: HeatScene,
        decomposition: Decomposition,
        values: np.ndarray,
        mechanics: NoMechanics = NoMechanics(),
    ) -> AtTemperatures:
        """Assemble a scene whose bodies have the cells of the decomposition. Collective."""
        tearing, forms = decomposition.tearing, HeatForms(decomposition.forms.templates)
        forms.prepare(scene)
        held = prescribed_along(scene.field, tearing)[0][:, 0]
        values = followed(scene, decomposition, np.where(np.isnan(held), values, held))
        parts, joints, heated = forms.parts(scene, decomposition.meshes), Joints.of(scene, decomposition), []
        mechanics = mechanics.at(values, joints)
        given = mechanics.given(joints)
        with together(decomposition.comm):
            touch = joints.touch(values, given.pressure, given.gap)
            rubbed = joints.at_nodes(joints.friction(touch, given.work))
            for part in parts:
                nodes = tearing.global_nodes(part.mesh.body, np.arange(part.body.mesh.n_nodes))
                own, rate = values[nodes], Rate(0.0, values[nodes], ())
                heated.append(Assembly(part).heated(scene, own, rate, 0, rubbed[nodes]))
        return cls(scene, decomposition, joints, parts, tuple(heated), values, mechanics, given)

    @cached_property
    def touch(self) -> Touch:
        """What conductances depend on at the points."""
        return self.joints.touch(self.values, self.given.pressure, self.given.gap)

    @cached_property
    def conductance(self) -> np.ndarray:
        """The product h A of the points, (n_points,)."""
        return self.joints.area * self.joints.conductance(self.touch)

    @cached_property
    def passing(self) -> np.ndarray:
        """Heat that passes from slave to master at the points, (n_points,)."""
        slave, master = self.joints.sides(self.values)
        return self.conductance * (slave - master)

    @cached_property
    def residual(self) -> np.ndarray:
        """R at the nodes, without the heat of ties, (n_nodes,). Collective on first use."""
        load = self._summed(lambda number, _: -self.heated[number].subdomain.load)
        return self._flow(self.values) + load + self.joints.points.jump.T @ self.passing

    def nodes(self, body: str, surface: str) -> np.ndarray:
        """Return the numbers of the nodes of a surface or a set among all."""
        own = self.scene.bodies[body].mesh.nodes_of(surface)
        return self.decomposition.tearing.global_nodes(body, own)

    def weights(self, body: str, surface: str) -> np.ndarray:
        """Return ∫ φ and ∫ φ² of each node over a surface, or a body, (2, n_nodes). Collective."""
        if (body, surface) not in self._weights:
            self._weights[body, surface] = self._weighed(body, surface)
        return self._weights[body, surface]

    @cached_property
    def _weights(self) -> dict[tuple[str, str], np.ndarray]:
        """Those that were asked for."""
        return {}

    def _weighed(self, body: str, surface: str) -> np.ndarray:
        def mass(part: Part, power: int) -> np.ndarray:
            part.place()
            ones = np.full(part.mesh.size, float(part.mesh.body == body))
            over = part.surface(ones, surface) if ones.any() and surface else part.volume(ones, "")
            return np.asarray(over.diagonal() if power == 2 else over @ np.ones(part.mesh.size))

        return np.stack([self._summed(lambda _, part: mass(part, power)) for power in (1, 2)])

    def by_passing(self, weight: np.ndarray) -> np.ndarray:
        """Return the derivative by temperatures of heat that passes, with weights of points, (n_nodes,)."""
        return np.asarray(self.joints.points.jump.T @ (self.conductance * weight)) + self._by_law(weight)

    def transposed(self, weight: np.ndarray) -> np.ndarray:
        """Return R_Tᵀ w, (n_nodes,). Collective."""
        jump = self.joints.points.jump
        return self._flow(weight) + jump.T @ (self.conductance * (jump @ weight)) + self.beyond(weight)

    def beyond(self, weight: np.ndarray) -> np.ndarray:
        """Return Nᵀ w: what laws add that depend on temperatures, (n_nodes,). Collective."""
        forms = HeatForms(self.decomposition.forms.templates)
        for name, field in self.scene.field.bodies.items():  # all ranks together
            for material in self.scene.bodies[name].materials:
                forms.conduction_by_temperature(material, field.element)

        def of_part(_: int, part: Part) -> np.ndarray:
            temperature, along = self._on(part, self.values), self._on(part, weight)
            part.place()
            total = part.conduction_by_temperature(temperature, along)
            for load in self.scene.loads:
                if load.body == part.mesh.body and not load.is_linear:
                    total = total + load.beyond(part, temperature, along)  # type: ignore[union-attr]
            return part.mesh.following.force(total)

        through = self._by_law(self.joints.points.jump @ weight) - self._by_friction(weight)
        return self._summed(of_part) + through

    def by_given(self, passing: np.ndarray | float, residual: np.ndarray) -> GivenContact:
        """Return the derivatives by pressures, gaps and work, one-sided where they are zero.

        Of heat that passes at the points times weights, (n_points,), and R times those of nodes, (n_nodes,).
        """
        points, across = self.joints.points, self.joints.area * (self.touch.slave - self.touch.master)
        weights = (
            across * (passing + points.jump @ residual),
            -(points.own @ residual),
            -(points.master @ residual),
        )
        return GivenContact(**{name: np.sum(weights * by, axis=0) for name, by in self._slopes.items()})

    @cached_property
    def _slopes(self) -> dict[str, np.ndarray]:
        """Slopes of h and of the heat of friction on both sides, (3, n_points), by pressure, gap and work."""
        known, found = replace(self.given, gap=self.touch.gap), {}

        def laws(given: GivenContact) -> np.ndarray:
            touch = replace(self.touch, pressure=given.pressure, gap=given.gap)
            return np.vstack([self.joints.conductance(touch), self.joints.friction(touch, given.work)])

        sizes = {"pressure": known.pressure, "gap": np.ptp(self.scene.geometry.points), "work": known.work}
        for name, size in sizes.items():
            at = getattr(known, name)
            step = np.maximum(1e-5 * at, 1e-9 * (np.max(size, initial=0.0) or 1.0))
            ends = at + step, np.maximum(at - step, 0.0)
            ahead, behind = (laws(replace(known, **{name: end})) for end in ends)
            found[name] = (ahead - behind) / (ends[0] - ends[1])
        found["gap"] *= self.given.gap > -1e-9 * sizes["gap"]  # deeper ones are none for the laws
        return found

    def _by_friction(self, weight: np.ndarray) -> np.ndarray:
        """Return the derivative by temperatures of friction heat, with weights of nodes, (n_nodes,)."""
        joints, points, touch = self.joints, self.joints.points, self.touch
        none, along = np.zeros(points.count), np.stack([points.own @ weight, points.master @ weight])

        def of_mean(change: np.ndarray) -> np.ndarray:
            warmer = replace(touch, slave=touch.slave + change, master=touch.master + change)
            return np.asarray((joints.friction(warmer, none) * along).sum(axis=0))

        slopes = 0.5 * slope_of(of_mean, none)
        of_master = np.where(joints.on_obstacle, 0.0, slopes)
        return np.asarray(points.own.T @ slopes + points.master.T @ of_master)

    def _flow(self, values: np.ndarray) -> np.ndarray:
        """Return A T without contacts."""
        return self._summed(
            lambda number, part: self.heated[number].subdomain.stiffness @ self._on(part, values)
        )

    def _on(self, part: Part, values: np.ndarray) -> np.ndarray:
        return values[self.decomposition.tearing.global_nodes(part.mesh.body, part.mesh.nodes)]

    def _summed(self, of_part: Callable[[int, Part], np.ndarray]) -> np.ndarray:
        torn = [of_part(number, part) for number, part in enumerate(self.parts)]
        return nodal_sum(self.decomposition, np.concatenate([np.zeros(0), *torn]))[:, 0]

    def _law(self, slave: np.ndarray, master: np.ndarray) -> np.ndarray:
        return self.joints.conductance(replace(self.touch, slave=slave, master=master))

    def _by_law(self, weight: np.ndarray) -> np.ndarray:
        """Return what conductances that depend on temperatures add to `by_passing`."""
        points, (slave, master) = self.joints.points, self.joints.sides(self.values)
        weight = self.joints.area * (slave - master) * weight
        by_slave = slope_of(lambda T: self._law(T, master), slave)
        by_master = np.where(self.joints.on_obstacle, 0.0, slope_of(lambda T: self._law(slave, T), master))
        return np.asarray(points.own.T @ (by_slave * weight) + points.master.T @ (by_master * weight))


def followed(scene: HeatScene, decomposition: Decomposition, values: np.ndarray) -> np.ndarray:
    """Return values with those of hanging nodes and centres as they follow from others."""
    result = values.copy()
    for name, body in scene.bodies.items():
        own = decomposition.tearing.global_nodes(name, np.arange(body.mesh.n_nodes))
        result[own] = body.mesh.followers.followed(body.mesh.n_nodes) @ values[own]
    return result


#: ∂J/∂T at the nodes of all bodies at fixed pressures and gaps, replicated, (n_nodes,); at fixed T ∂J by heat
#: that passes at the points, (n_points,), and by R at the nodes, (n_nodes,), which may be zero.
HeatPartials = tuple[np.ndarray, "np.ndarray | float", "np.ndarray | float"]


class HeatObjective(ABC):
    """A quantity J(T) of a scene `AtTemperatures`."""

    #: Quantities of mechanics that it consists of.
    of_mechanics: tuple[Objective, ...] = ()

    @abstractmethod
    def value(self, at: AtTemperatures) -> float:
        """Return J. Collective."""

    @abstractmethod
    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return the derivatives of J. Collective."""

    def check(self, scene: HeatScene) -> None:
        """Reject a scene without what it is a quantity of; nothing by default."""

    def missing(self, at: AtTemperatures) -> float:
        """Return what J misses of its integral with the temperatures of the mesh. Collective."""
        return 0.0

    def size(self, value: float, temperatures: np.ndarray) -> float:
        """Return what errors of J are relative to, by default its size; `temperatures`: of all nodes."""
        return abs(value)


class OfMechanics(HeatObjective):
    """A quantity of the mechanics of a `HeatedState`, which temperatures change through the state alone."""

    def __init__(self, objective: Objective) -> None:
        """Take a quantity as `ShapeProblem` does."""
        self.of_mechanics = (objective,)

    def value(self, at: AtTemperatures) -> float:
        """Return its value."""
        return at.mechanics.value(*self.of_mechanics)

    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return zeros."""
        return np.zeros(len(at.values)), 0.0, 0.0


@dataclass(frozen=True)
@checked()
class TemperatureMean(HeatObjective):
    """A mean of temperatures, (∫ (T − T₀)ᵖ / ∫ 1)^(1/p): the larger p, the closer to the highest.

    Attributes:
        body: Name of the body.
        surface: Name of its surface; the whole body by default.
        exponent: p ≥ 1; 1 is the mean, other powers are summed over nodes with ∫ φ² of each as its weight.
        level: T₀, below all temperatures unless p = 1.
    """

    body: str
    surface: str = ""
    exponent: float = 1.0
    level: float = 0.0

    def __post_init__(self) -> None:
        """Reject powers of which there is no mean."""
        if not 1.0 <= self.exponent < np.inf:
            raise InvalidInputError(
                f"TemperatureMean.exponent must be at least 1 and finite, got {self.exponent:g}: 1 is the "
                "mean, 20 is close to the highest temperature"
            )

    def check(self, scene: HeatScene) -> None:
        """Reject a body or surface that is not there."""
        check_known(self.body, scene.bodies, f"TemperatureMean names body {self.body!r}, the scene has")
        if self.surface:
            known = scene.bodies[self.body].mesh.surfaces
            check_known(self.surface, known, f"TemperatureMean names surface {self.surface!r}, the body has")

    def value(self, at: AtTemperatures) -> float:
        """Return the mean."""
        weight, over = self._over(at)
        top = float(np.abs(over).max()) or 1.0
        return top * float((weight @ (over / top) ** self.exponent) ** (1.0 / self.exponent))

    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return the weights, at larger powers mostly those of the hottest nodes."""
        weight, over = self._over(at)
        return weight * (over / (self.value(at) or 1.0)) ** (self.exponent - 1.0), 0.0, 0.0

    def size(self, value: float, temperatures: np.ndarray) -> float:
        """Return the range of temperatures, whose zero may lie anywhere."""
        return float(np.ptp(temperatures))

    def missing(self, at: AtTemperatures) -> float:
        """Return what a sum over nodes misses of powers between them. Collective."""
        if self.exponent == 1.0:
            return 0.0
        comm, value = at.decomposition.comm, self.value(at)
        sizes, values = map(np.concatenate, zip(*self._between(at), strict=True))
        powers = sizes @ (np.maximum(values - self.level, 0.0) / (value or 1.0)) ** self.exponent
        whole, area = comm.allreduce(np.array([powers, sizes.sum()]))
        return value * float((whole / area) ** (1.0 / self.exponent) - 1.0)

    def _between(self, at: AtTemperatures, degree: int = 12) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield sizes and temperatures of points on this rank."""
        yield np.zeros(0), np.zeros(0)
        comm, tearing = at.decomposition.comm, at.decomposition.tearing
        if self.surface:
            side = Surface(self.body, self.surface)
            surface = surface_of(at.scene.geometry, side, "faceted")
            places = Places.of(surface, np.arange(len(surface.facets))[comm.rank :: comm.size], degree)
            yield places.weight, places.values @ at.values[tearing.global_nodes(self.body, surface.nodes)]
            return
        for part in at.parts:
            if part.mesh.body == self.body:
                mesh, element = part.body.mesh, part.element
                positions, weights = quadrature(element.cell, degree)
                points = PointsOfCells.of(mesh, part.mesh.cells, element.cell, positions)
                nodal = at.values[tearing.global_nodes(self.body, points.nodes)]
                sizes = points.sizes(weights, element.kinematics.measure)
                yield sizes.ravel(), (points.of_nodes(nodal) @ points.shape.T).ravel()

    def _over(self, at: AtTemperatures) -> tuple[np.ndarray, np.ndarray]:
        """Return weights whose sum is one, and T − T₀, one where they are zero."""
        weight = at.weights(self.body, self.surface)[int(self.exponent != 1.0)]
        return weight / weight.sum(), np.where(weight != 0.0, at.values - self.level, 1.0)


@dataclass(frozen=True)
@checked()
class HeatOfHeld(HeatObjective):
    """The heat that enters through a held surface, at all its nodes, [power].

    Attributes:
        body: Name of the body.
        surface: Name of its surface, or set of nodes, that a `HeldTemperature` holds.
    """

    body: str
    surface: str

    def check(self, scene: HeatScene) -> None:
        """Reject what nothing holds."""
        known = [f"{each.body} {each.surface}" for each in scene.held]
        words = f"HeatOfHeld needs a HeldTemperature of {self.body} {self.surface}, the scene holds"
        check_known(f"{self.body} {self.surface}", known, words)

    def value(self, at: AtTemperatures) -> float:
        """Return the sum of the residuals."""
        return float(at.residual[at.nodes(self.body, self.surface)].sum())

    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return the rows of these nodes, summed."""
        weight = np.zeros(len(at.values))
        weight[at.nodes(self.body, self.surface)] = 1.0
        return at.transposed(weight), 0.0, weight


@dataclass(frozen=True)
@checked()
class HeatOfContact(HeatObjective):
    """The heat that passes through a contact from slave to master, [power].

    Attributes:
        contact: Its number among those of the scene.
    """

    contact: int

    def check(self, scene: HeatScene) -> None:
        """Reject a contact that is not there."""
        if not 0 <= self.contact < len(scene.contacts):
            raise InvalidInputError(
                f"{type(self).__name__}.contact must be the number of a contact of the scene, which has "
                f"{len(scene.contacts)}, from 0, got {self.contact}"
            )

    def value(self, at: AtTemperatures) -> float:
        """Return the sum over its points."""
        return float(at.passing[at.joints.points.pair == self.contact].sum())

    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return the derivatives of the sum."""
        mine = (at.joints.points.pair == self.contact).astype(float)
        return at.by_passing(mine), mine, 0.0


@dataclass(frozen=True)
@checked()
class JointResistance(HeatOfContact):
    """The mean jump of the temperature at a contact over the heat that passes, [degree / power]."""

    def value(self, at: AtTemperatures) -> float:
        """Return the resistance."""
        slave, master = at.joints.sides(at.values)
        return float(self._share(at) @ (slave - master)) / super().value(at)

    def partials(self, at: AtTemperatures) -> HeatPartials:
        """Return the derivatives of the quotient."""
        jump, value, heat = at.joints.points.jump.T @ self._share(at), self.value(at), super().value(at)
        by_temperature, mine, _ = super().partials(at)
        return np.asarray(jump - value * by_temperature) / heat, -value / heat * mine, 0.0

    def _share(self, at: AtTemperatures) -> np.ndarray:
        area = np.where(at.joints.points.pair == self.contact, at.joints.area, 0.0)
        return area / area.sum()
