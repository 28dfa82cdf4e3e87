"""A scene: bodies, supports, loads and contact pairs, and steps of its loads. Nothing is solved yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact._scene.automatic import AutomaticContact
from fenics_contact._scene.constraints import with_values
from fenics_contact._scene.contact_facets import with_free_centres
from fenics_contact._scene.discretisation import with_discretisation
from fenics_contact._scene.fluids_of_pairs import pressures_of, with_pressures
from fenics_contact._scene.loads import Load
from fenics_contact._scene.pairs import ContactPair, Pairs
from fenics_contact._scene.parts import SceneParts
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.sections import changed_by, require_preloads, with_cuts
from fenics_contact._scene.supports import AnySupport
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.mesh.bisection import default_partition

if TYPE_CHECKING:
    from fenics_contact._scene.effects import Effect
    from fenics_contact._scene.plan import Plan


@displayed
@dataclass(frozen=True)
class Scene(SceneParts):
    """Elastic bodies that may touch.

    Attributes:
        bodies: Bodies by name.
        supports: Prescribed displacements.
        loads: Forces.
        contacts: Pairs of surfaces that may touch; `AutomaticContact` finds them, and names the surfaces.
            Each has the discretisation that it was given or that the scene chose for it, see `plan`.
        ties: Pairs of surfaces that stay together, likewise.
        preloads: Sections through bodies that are drawn together. The scene cuts the meshes of these bodies,
            whose nodes are there twice; cells and surfaces keep numbers and names.
        foundations: Surfaces that rest on springs to the ground, the same in all load steps.
        springs: Springs between surfaces, the same in all load steps.
        constraints: Linear equations between displacements of nodes; load steps may change their values.

    Raises:
        InvalidInputError: If a part names a body or a surface that is not there, does not suit the body's
            dimension or material, or a load is not one of the package's.

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact import Coulomb, RigidPlane, Traction
        >>> from fenics_contact.materials import IsotropicElasticity
        >>> steel = IsotropicElasticity(2.1e5, 0.3)  # N/mm²
        >>> floor = RigidPlane((0, 0, 0), (0, 0, 1))
        >>> scene = Scene(
        ...     bodies={"block": Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), steel)},  # mm
        ...     supports=[Support("block", "x0")],
        ...     loads=[Traction("block", "z1", (0.0, 0.0, -500.0))],  # N/mm²
        ...     contacts=[ContactPair(Surface("block", "z0"), floor, Coulomb(0.3))],
        ... )
        >>> [effect.name.value for effect in scene.effects()]
        ['elasticity', 'prescribed displacement', 'surface load', 'contact', 'Coulomb friction']
    """

    def __post_init__(self) -> None:
        """Check the parts, and find the contact pairs if that is wanted."""
        super().__post_init__()
        if isinstance(self.contacts, AutomaticContact):
            bodies, pairs = self.contacts.found(self)
            object.__setattr__(self, "bodies", bodies)
            object.__setattr__(self, "contacts", pairs)
            super().__post_init__()
        pressures_of(self.contacts)
        if self.preloads:
            object.__setattr__(self, "bodies", with_cuts(self))
        require_preloads(self)
        for constraint in self.constraints:
            constraint.check(self)
        if any(body.mesh.centres for body in self.bodies.values()):
            object.__setattr__(self, "bodies", with_free_centres(self))
        object.__setattr__(self, "contacts", Pairs(with_discretisation(self, self.contacts)))
        object.__setattr__(self, "ties", with_discretisation(self, self.ties))

    def partition(self, ranks: int = 1, *, lean: bool = False) -> dict[str, np.ndarray]:
        """Cut every body into subdomains of a suitable size.

        Args:
            ranks: Number of ranks that need a subdomain each.
            lean: Whether memory matters more than products, as where a state hardly fits: subdomains are
                smaller, and have fewer unknowns on their interfaces.

        Returns:
            Body name -> subdomain of every cell, numbered from 0 within the body.
        """
        bodies = self.deforming
        each = -(-ranks // len(bodies))
        found = {n: default_partition(body.mesh, each, body=n, lean=lean) for n, body in bodies.items()}
        return {n: bodies[n].without_single_rows(partition) for n, partition in found.items()}

    def _facts(self) -> dict[str, Any]:
        return {
            "bodies": {name: body.in_words for name, body in self.bodies.items()},
            "nodes": f"{sum(body.mesh.n_nodes for body in self.bodies.values())} in {self.dim} dimensions",
            "supports": [support.in_words for support in self.supports],
            "loads": [load.in_words for load in self.loads],
            "contacts": [
                f"{pair.place}, {pair.friction or 'without friction'}, {pair.given_gap}".removesuffix(", ")
                for pair in self.contacts
            ],
            "ties": [tie.place for tie in self.ties],
            **({"foundations": [each.place for each in self.foundations]} if self.foundations else {}),
            **({"springs": [spring.place for spring in self.springs]} if self.springs else {}),
            **({"constraints": [each.place for each in self.constraints]} if self.constraints else {}),
            **({"preloads": [preload.place for preload in self.preloads]} if self.preloads else {}),
        }

    def effects(self) -> tuple[Effect, ...]:
        """List the effects in the scene; only what these need is built."""
        from fenics_contact._scene.plan import effects_of

        return effects_of(self)

    def plan(
        self,
        partitions: Mapping[str, np.ndarray] | None = None,
        *,
        ranks: int = 1,
        sensitivity: bool = False,
    ) -> Plan:
        """Return what will be built: unknowns, multipliers, solver, memory.

        Gaps between surfaces, overlaps and approaches are computed here, not when the scene is made.

        Args:
            partitions: Body name -> subdomain of every cell; by default what `partition` returns.
            ranks: Number of ranks, each of which holds numbering and meshes, and factors of its own.
            sensitivity: Whether derivatives by the shape are wanted.

        Example:
            >>> print(scene.plan())  # doctest: +SKIP
        """
        from fenics_contact._scene.plan import make_plan

        cut = self.partition(ranks) if partitions is None else partitions
        return make_plan(self, cut, ranks=ranks, sensitivity=sensitivity)


#: Loads or supports as functions of time.
LoadsInTime: TypeAlias = Callable[[float], Sequence[Load]]
SupportsInTime: TypeAlias = Callable[[float], Sequence[AnySupport]]


@displayed
@dataclass(frozen=True)
@checked()
class LoadStep:
    """Loads and supports at the end of a step; what is not given stays as it was.

    Friction and histories of materials are those of one step, by backward Euler: slip counts from the start
    of the step to its end, also the way of points before they touch, so that a step ends best where bodies
    touch, turn back or change their direction.

    Where a step is followed in parts, as large deformations are, values change in proportion to the time,
    rotations of rigid surfaces by their angles. Functions of time have their values at every part: ramps and
    cycles are steps with the same function. Parts are no finer history, unless
    `AutomaticSteps.finer_history` says so.

    Attributes:
        name: What the step does, for records.
        loads: All loads that act at the end of the step, a function that returns them at a time, or None.
        supports: All supports with their values at the end of the step, a function that returns them at a
            time, or None. They may hold other components than before: what is released carries nothing at the
            end of the step, what is held newly has its value there, measured from the undeformed body, or
            keeps what it has, see `HoldCurrent`.
        time: Time at the end of the step in any unit, for records, functions of time, obstacles that move
            and materials that creep; None: the number of the step, from 1.
        preloads: The bolts that are drawn together in the step, by a force or a length; all others of the
            scene are held at the length that they have at its start. An empty list holds all.
        fluids: Pressures of fluids at the end of the step by their names, see `FluidPressure`, [force /
            length²]; others keep theirs. None: all do.
        contacts: The contact pairs of the step, such as those of the scene with other laws of friction or
            closure, by ``replace(pair, friction=Coulomb(0.1))``; pairs that are left out do not act. None: as
            they were.
        constraints: Values of linear constraints at the end of the step by their names; others keep theirs.
            None: all do.
        cycles: How often the step is repeated, > 0, where pairs wear: what it loses counts so many times, see
            `Wear`. None: pairs keep their number.

    Raises:
        InvalidInputError: If there are functions of time, and no time, or it is not finite.

    Example:
        >>> def turned(t):
        ...     return [RigidSurface("rod", "top", (0, 0, 9), (0, 0, 0), (0, 0, np.sin(t)))]
        >>> twist = [LoadStep(f"twist {t:.1f}", supports=turned, time=t) for t in np.linspace(0.1, 6.3, 63)]
    """

    name: str
    loads: Sequence[Load] | LoadsInTime | None = None
    supports: Sequence[AnySupport] | SupportsInTime | None = None
    time: float | None = None
    preloads: Sequence[Preload] | None = None
    fluids: Mapping[str, float] | None = None
    contacts: Sequence[ContactPair] | None = None
    constraints: Mapping[str, float | Sequence[float]] | None = None
    cycles: float | None = None

    def __post_init__(self) -> None:
        """Raise if loads are functions of time and no finite time is given."""
        if not np.isfinite(self._given.get("time", 0.0)):
            raise InvalidInputError(
                f"time of LoadStep {self.name!r} must be a finite number or None, got {self.time!r}: omit it"
            )
        if "time" not in self._given and (callable(self.loads) or callable(self.supports)):
            raise InvalidInputError(
                f"LoadStep {self.name!r} must have the time at its end for functions of it: give time=..."
            )

    def applied_to(self, scene: Scene) -> Scene:
        """Return the scene at the end of the step.

        Raises:
            InvalidInputError: If a function of time returns no loads or supports, or the scene has no such
                preload, fluid or constraint.
            UserCodeError: If it raises.
        """
        given = {"loads": scene.loads, "supports": scene.supports, "time": 0.0, **self._given}
        if "contacts" in given:
            scene = replace(scene, contacts=tuple(given["contacts"]))
        if "preloads" in given:
            scene = replace(scene, preloads=changed_by(scene, given["preloads"]))
        if "fluids" in given:
            scene = replace(scene, contacts=with_pressures(scene.contacts, given["fluids"]))
        if "constraints" in given:
            scene = replace(scene, constraints=with_values(scene.constraints, given["constraints"]))
        if "cycles" in given:
            repeated = tuple(pair.repeated(given["cycles"]) for pair in scene.contacts)
            scene = replace(scene, contacts=repeated)
        return self._with(scene, given["loads"], given["supports"], given["time"])

    @property
    def _given(self) -> dict[str, Any]:
        """What is given of it, by the names of the fields."""
        return {name: value for name, value in vars(self).items() if value is not None}

    def at(self, scene: Scene, time: float) -> Scene:
        """Return a scene with the functions of time at another time; the rest stays as it is."""
        loads = self.loads if callable(self.loads) else scene.loads
        supports = self.supports if callable(self.supports) else scene.supports
        return self._with(scene, loads, supports, time)

    def _with(
        self,
        scene: Scene,
        loads: Sequence[Load] | LoadsInTime,
        supports: Sequence[AnySupport] | SupportsInTime,
        time: float,
    ) -> Scene:
        if callable(loads):
            with user_code(f"the loads of LoadStep {self.name!r} at time {time:g}"):
                loads = tuple(loads(time))
        if callable(supports):
            with user_code(f"the supports of LoadStep {self.name!r} at time {time:g}"):
                supports = tuple(supports(time))
        return replace(scene, loads=loads, supports=supports)
