"""A deck written as a scene file with its mesh, and fields by nodes beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from fenics_contact._base.checks import naming_arguments
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import Load
from fenics_contact._scene.scene import LoadStep
from fenics_contact._scene.supports import AnySupport
from fenics_contact._scene_file.document import Document, StepPart
from fenics_contact._scene_file.model import PreloadAim
from fenics_contact._scene_file.part import not_in_files
from fenics_contact._scene_file.values import FREE
from fenics_contact._scene_file.writing import as_table, as_toml_value, body_table, lists_of, table_for
from fenics_contact.decks.deck import Deck
from fenics_contact.errors import InvalidInputError

#: Keys that say where a load or a support acts.
_WHERE = ("kind", "body", "surface", "nodes", "region")


@naming_arguments
def write_scene_file(deck: Deck, path: str | Path) -> list[Path]:
    """Write a deck as a scene file, its mesh as a deck of nodes, elements, sets and surfaces alone.

    The scene file has the same answer as the deck to the tolerance of the solver.

    Args:
        deck: The deck.
        path: The scene file, ``.toml``; the mesh and tables of values by nodes get names that begin alike.

    Returns:
        The files that were written, the scene file first.

    Raises:
        InvalidInputError: If a scene file cannot say what the deck has: directions that differ from node to
            node, or forces on rigid surfaces that change from step to step.
    """
    return _Writer(deck, Path(path)).write()


class _Writer:
    """Collects the tables of a scene file and the files beside it."""

    def __init__(self, deck: Deck, path: Path) -> None:
        if path.suffix != ".toml":
            raise InvalidInputError(f"a scene file must end in .toml, got '{path}': give such a name")
        self.deck, self.path = deck, path
        self.files: dict[Path, str] = {}

    def write(self) -> list[Path]:
        """Write all files."""
        mesh = self.path.with_name(f"{self.path.stem}_mesh.inp")
        document = self._document(mesh.name)
        self.files[mesh] = self.deck.mesh.text()
        text = f"# Written from {self.deck.name}\n" + tomlkit.dumps(document)
        for file, content in {self.path: text, **self.files}.items():
            file.write_text(content, encoding="utf-8")
        return [self.path, *self.files]

    def _document(self, mesh: str) -> dict[str, Any]:
        scene, steps = self.deck.scene, self.deck.steps
        if len(steps) == 1:
            scene, steps = steps[0].applied_to(scene), ()
        materials: dict[str, Any] = {}
        bodies = {}
        for name, body in scene.bodies.items():
            given = body.material if isinstance(body.material, Mapping) else {"": body.material}
            made: Any = {region: self._material(each, materials) for region, each in given.items()}
            made = made if len(made) > 1 else next(iter(made.values()))
            part = name if len(scene.bodies) > 1 else None
            bodies[name] = body_table(body, mesh="mesh", part=part, material=made)
        lists = {
            key: [self._table(each, f"{key[:-1]} {k}") for k, each in enumerate(parts)]
            for key, parts in lists_of(scene).items()
        }
        if steps:
            for k, table in enumerate(lists.get("supports", ())):
                table["name"] = f"support {k}"
            lists["loads"], lists["steps"] = self._history(steps)
        title, meshes = Path(self.deck.name).stem, {"mesh": {"file": mesh, "deck": True}}
        return Document.keys(
            {"title": title, "meshes": meshes, "materials": materials, "bodies": bodies, **lists}
        )

    def _material(self, material: Any, known: dict[str, Any]) -> str:
        """Return the name of a material's table, which is added."""
        table = self._table(material, "")
        name = next((name for name, other in known.items() if other == table), f"material {len(known) + 1}")
        known[name] = table
        return name

    def _field(self, values: NodeValues, name: str) -> dict[str, Any]:
        """Return the table of values by nodes, which are written into a file of their own."""
        file = self.path.with_name(f"{self.path.stem}_{name.replace(' ', '_')}.csv")
        columns = values.values.reshape(len(values.points), -1)
        axes = ["x", "y", "z"][: values.points.shape[1]]
        names = [f"value_{k}" for k in range(columns.shape[1])]
        rows = [",".join(map(repr, row)) for row in np.hstack([values.points, columns]).tolist()]
        self.files[file] = "\n".join([",".join([*axes, *names]), *rows, ""])
        return {"file": file.name, "field": names[0] if len(names) == 1 else names}

    def _table(self, made: object, name: str) -> dict[str, Any]:
        return as_table(made, name, self._field)

    def _history(self, steps: Sequence[LoadStep]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Return the loads before the first step, zero, and the steps."""
        names: dict[tuple[Any, ...], str] = {}
        loads: dict[str, tuple[dict[str, Any], Any]] = {}
        held, tables, begin = list[Any](), [], 0.0
        for number, step in enumerate(steps):
            if step.contacts is not None:
                raise not_in_files(f"the same contact pairs in all steps, {step.name} changes them")
            values = dict(self._load(each, number, names, loads) for each in step.loads or ())  # type: ignore[union-attr]
            supports = [self._held(each, k, number) for k, each in enumerate(step.supports or ())]  # type: ignore[arg-type]
            how = [_holds(table) for table in supports]
            held = held or how
            if how != held:
                raise not_in_files(f"the same components held in all steps, {step.name} changes them")
            end = float(number + 1) if step.time is None else step.time
            aims = {each.label: PreloadAim.keys(vars(each)) for each in step.preloads or ()}
            tables.append(StepPart.keys({
                "name": step.name,
                "duration": end - begin,
                "supports": {f"support {k}": table["value"] for k, table in enumerate(supports)},
                "loads": {name: zero for name, (_, zero) in loads.items()} | values,
                "preloads": None if step.preloads is None else aims,
                "constraints": as_toml_value(step.constraints or {}, "", self._field),
            }))  # fmt: skip
            begin = end
        return [table for table, _ in loads.values()], tables

    def _load(
        self,
        load: Load,
        step: int,
        names: dict[tuple[Any, ...], str],
        loads: dict[str, tuple[dict[str, Any], Any]],
    ) -> tuple[str, Any]:
        """Return name and value of a load in a step; its table, of zeros, and these are added."""
        of: Any = table_for(load)
        name = names.setdefault(tuple(map(of.written(load).get, _WHERE)), f"load {len(names)}")
        table, key = {"name": name, **self._table(load, f"{name} step {step}")}, of.changed_key()
        value, zero = table[key], _nothing(table[key])
        table[key] = zero
        if loads.setdefault(name, (table, zero)) != (table, zero):
            raise not_in_files(
                f"loads that change by their values alone, not so {name} of body {load.body!r}"
            )
        return name, value

    def _held(self, support: AnySupport, number: int, step: int) -> dict[str, Any]:
        """Return the table of a support in a step."""
        table = self._table(support, f"support {number} step {step}")
        if table.keys() & {"force", "moment"}:
            raise not_in_files(f"one force on a rigid surface for all steps, {support.in_words} changes it")
        return table


def _holds(table: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return where a support is, and which of its components are free."""
    value = table["value"]
    return *map(table.get, _WHERE), [each == FREE for each in value] if isinstance(value, list) else []


def _nothing(value: Any) -> Any:
    """Return zeros in place of numbers, or of a field."""
    several = value["field"] if isinstance(value, Mapping) else value
    return [0.0] * len(several) if isinstance(several, list) else 0.0
