"""Scene files with the section [heat]: bodies that conduct."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from fenics_contact._scene_file.reading import Builder, SceneFile, made_of
from fenics_contact._scene_file.values import at_time, changes

if TYPE_CHECKING:
    from fenics_contact._scene.scene import Scene
    from fenics_contact._scene_file.bodies import Shaped
    from fenics_contact._scene_file.heat_tables import HeatDocument, HeatedDocument
    from fenics_contact.heat.coupled import HeatedState
    from fenics_contact.heat.scene import ConductingBody, HeatScene
    from fenics_contact.heat.state import HeatState
    from fenics_contact.heat.time import HeatHistory


class _HeatBuilder(Builder):
    """Builds what conducts, part by part."""

    _document: HeatDocument

    def conductors(self) -> dict[str, Any]:
        """Return what bodies conduct with, by name."""
        materials = dict[str, Any]()
        for name, each in self._document.heat.materials.items():
            with self._at("heat", "materials", name):
                materials[name] = each.made()
        self._check()
        bodies = self._document.bodies.items()
        return {name: made_of(body.heat.material, materials) for name, body in bodies if body.heat}

    def bodies_alone(self) -> dict[str, ConductingBody]:
        """Return the bodies without mechanics. Collective."""
        from fenics_contact.heat.scene import ConductingBody

        shapes, made, found = self.shapes(), self.conductors(), dict[str, ConductingBody]()
        parts: Mapping[str, Any] = self._document.bodies
        for name, part in parts.items():
            with self._at("bodies", name):
                mesh, own = self._part_of(name, part, shapes[part.mesh]).mesh, part.heat
                found[name] = ConductingBody(mesh, made[name], part.axisymmetric, own.thickness)
        self._check()
        return found

    def parts(self, bodies: Mapping[str, Any]) -> dict[str, list[Any]]:
        """Return what acts on bodies and joins them."""
        from fenics_contact.heat.scene import HeatScene

        self._check_surfaces(bodies)
        found: dict[str, list[Any]] = {"held": [], "loads": [], "contacts": [], "ties": []}
        for key, made in found.items():
            for number, each in enumerate(getattr(self._document.heat, key)):
                with self._at("heat", key, number):
                    one: Any = {key: [each.made()]}
                    HeatScene(bodies, **one)  # rejects what does not suit the bodies
                    made += one[key]
        self._check()
        return {key: made for key, made in found.items() if made}


@dataclass(frozen=True, eq=False)
class HeatFile(SceneFile):
    """A scene file of heat alone; its scene is a `HeatScene`, its states are those of heat."""

    document: HeatDocument
    steps_in_words = "times"

    @classmethod
    def documents(cls) -> type[HeatDocument]:
        """Return the form of its data."""
        from fenics_contact._scene_file.heat_tables import HeatDocument

        return HeatDocument

    @cached_property
    def scene(self) -> HeatScene:  # type: ignore[override]
        """The scene. Collective on first use."""
        from fenics_contact.heat.scene import HeatScene

        builder = _HeatBuilder(self.source, self._complete, self.comm)
        bodies = builder.bodies_alone()
        return HeatScene(bodies, **builder.parts(bodies))

    @property
    def steps(self) -> tuple[float, ...]:  # type: ignore[override]
        """Times of its states, none if it is steady."""
        time: Any = self.document.heat.time
        return () if time is None else tuple(sorted({*time.outputs, time.duration}))

    def solve(self) -> HeatState | HeatHistory:  # type: ignore[override]
        """Compute the temperatures, see `solve_heat` and `heat_in_time`. Collective."""
        from fenics_contact.heat.problem import solve_heat
        from fenics_contact.heat.time import heat_in_time

        document: Any = self._complete
        time, fixed = document.heat.time, dict[str, Any](self.document.solver.fixed)
        with self._at("heat"):
            if time is None:
                return solve_heat(self.scene, self.comm, partitions=self.partitions, **fixed)
            return heat_in_time(self._at_time, self.comm, partitions=self.partitions, **time.options)

    def followed(self, show: Callable[[str], None]) -> Iterator[tuple[float, Any, list[HeatState]]]:
        """Yield times with their states, and what these have of heat. Collective."""
        history: Any = self.solve()
        show(str(history))
        for time, state in zip(self.steps, history.states, strict=True):
            yield time, state, [state]

    def _at_time(self, time: float) -> HeatScene:
        """Return the scene with its formulas in t at a time."""
        scene = self.scene
        parts = {key: getattr(scene, key) for key in ("held", "loads", "contacts")}
        if not changes(tuple(vars(each) for own in parts.values() for each in own)):
            return scene
        now: dict[str, Any] = {key: [_now(each, time) for each in own] for key, own in parts.items()}
        return replace(scene, **now)


def _now(part: Any, time: float) -> Any:
    """Return a part with the formulas in t of it at a time."""
    return replace(
        part, **{name: at_time(value, time) for name, value in vars(part).items() if changes(value)}
    )


@dataclass(frozen=True, eq=False)
class HeatedFile(SceneFile):
    """A scene file of mechanics and heat; its scene is that of mechanics."""

    document: HeatedDocument

    @classmethod
    def documents(cls) -> type[HeatedDocument]:
        """Return the form of its data."""
        from fenics_contact._scene_file.heat_tables import HeatedDocument

        return HeatedDocument

    @cached_property
    def _built(self) -> tuple[Scene, dict[str, Shaped]]:
        builder = Builder(self.source, self._complete.model_copy(update={"heat": None}), self.comm)
        bodies, shapes = builder.bodies()
        return builder.scene(bodies), shapes

    @cached_property
    def heat(self) -> HeatScene:
        """The heat of its bodies. Collective on first use."""
        from fenics_contact.heat.scene import HeatScene

        alone = type(self._complete).model_construct(heat=self._complete.heat, bodies=self._complete.bodies)
        builder = _HeatBuilder(self.source, alone, self.comm)
        made = builder.conductors()
        with self._at("heat"):
            bodies = HeatScene.on(self.scene, made).bodies
        return HeatScene.on(self.scene, made, **builder.parts(bodies))

    @property
    def plans(self) -> tuple[object, ...]:
        """What will be built, as text. Collective on first use."""
        return *super().plans, self.heat.plan(self.partitions)

    def solve(self) -> HeatedState:  # type: ignore[override]
        """Compute temperatures and deformation that depend on each other, see `solve_heated`. Collective."""
        from fenics_contact.heat.coupled import solve_heated

        options = {**self.document.solver.fixed, **self.document.heat.coupling}
        with self._at("heat"):
            return solve_heated(self.scene, self.heat, self.comm, partitions=self.partitions, **options)
