"""A deck written as a scene file with its mesh, and fields by nodes beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from fenics_contact._base.checks import naming_arguments
from fenics_contact._scene.constraints import LinearConstraint
from fenics_contact._scene.fields import NodeValues
from fenics_contact._scene.loads import (
    BodyForce,
    InitialStress,
    Load,
    PointForce,
    Pressure,
    Spinning,
    ThermalStrain,
    TotalForce,
)
from fenics_contact._scene.pairs import ContactPair, Coulomb, Surface
from fenics_contact._scene.preloads import Preload
from fenics_contact._scene.preloads import Section as CutAt
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._scene.supports import AnySupport, Kept, RigidSurface, Roller, Support
from fenics_contact._scene.surface_laws import ClosureTable, ExponentialClosure, LinearClosure
from fenics_contact.decks.deck import Deck
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.anisotropic import AnisotropicElasticity
from fenics_contact.materials.elastic import IsotropicElasticity, PlaneStrain, PlaneStress
from fenics_contact.materials.foam import Hyperfoam
from fenics_contact.materials.hyperelastic import MooneyRivlin, Ogden, StVenantKirchhoff
from fenics_contact.materials.neo_hookean_metal import NeoHookeanPlasticity
from fenics_contact.materials.orthotropic import OrthotropicElasticity, OrthotropicPlaneStress
from fenics_contact.materials.plastic import FinitePlasticity, J2Plasticity
from fenics_contact.materials.ramberg_osgood import RambergOsgood
from fenics_contact.materials.temperature_dependent import TemperatureDependentElasticity

_MODELS: dict[type, str] = {
    IsotropicElasticity: "isotropic",
    PlaneStrain: "plane_strain",
    PlaneStress: "plane_stress",
    OrthotropicElasticity: "orthotropic",
    AnisotropicElasticity: "anisotropic",
    OrthotropicPlaneStress: "orthotropic_plane_stress",
    J2Plasticity: "j2_plasticity",
    TemperatureDependentElasticity: "temperature_dependent",
    FinitePlasticity: "finite_plasticity",
    NeoHookeanPlasticity: "neo_hookean_plasticity",
    Hyperfoam: "hyperfoam",
    RambergOsgood: "ramberg_osgood",
    StVenantKirchhoff: "st_venant_kirchhoff",
    MooneyRivlin: "mooney_rivlin",
    Ogden: "ogden",
}
_LAWS: dict[type, str] = {LinearClosure: "linear", ExponentialClosure: "exponential", ClosureTable: "table"}
FREE = "free"


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
        deck, steps = self.deck, self.deck.steps
        alone = len(steps) == 1
        scene: Scene = steps[0].applied_to(deck.scene) if alone else deck.scene
        materials: dict[str, Any] = {}
        bodies = {}
        for name, body in scene.bodies.items():
            given = body.material if isinstance(body.material, Mapping) else {"": body.material}
            made = {region: self._material(material, materials) for region, material in given.items()}
            table: dict[str, Any] = {
                "mesh": "mesh",
                "material": made if len(made) > 1 else next(iter(made.values())),
            }
            if len(scene.bodies) > 1:
                table["part"] = name
            if body.axisymmetric:
                table["axisymmetric"] = True
            if body.integration != "full":
                table["integration"] = body.integration
            bodies[name] = table
        document: dict[str, Any] = {
            "title": Path(deck.name).stem,
            "meshes": {"mesh": {"file": mesh, "deck": True}},
            "materials": materials,
            "bodies": bodies,
            "supports": [
                self._support(each, k, "" if alone else f"support {k}")
                for k, each in enumerate(scene.supports)
            ],
        }
        if alone:
            document["loads"] = [self._load(each, f"load {k}") for k, each in enumerate(scene.loads)]
        document["contacts"] = [_pair(pair) for pair in scene.contacts]
        document["ties"] = [_tie(tie) for tie in scene.ties]
        document["preloads"] = [_preload(each) for each in scene.preloads]
        document["constraints"] = [_constraint(each) for each in scene.constraints]
        if not alone:
            document["loads"], document["steps"] = self._history(steps)
        return {key: value for key, value in document.items() if value not in ([], {})}

    def _material(self, material: Any, known: dict[str, Any]) -> str:
        """Return the name of a material's table, which is added."""
        table: dict[str, Any] = {"model": _MODELS[type(material)]}
        for field in fields(material):
            value = getattr(material, field.name)
            if field.name == "orientation":
                table["axis_1"], table["axis_2"] = list(value[0]), list(value[1])
            elif value is not None and value is not False and value != ():
                table[field.name] = _listed(value)
        for name, other in known.items():
            if other == table:
                return name
        name = f"material {len(known) + 1}"
        known[name] = table
        return name

    def _field(self, values: NodeValues, name: str) -> dict[str, Any]:
        """Return the table of values by nodes, which are written into a file of their own."""
        file = self.path.with_name(f"{self.path.stem}_{name.replace(' ', '_')}.csv")
        columns = values.values.reshape(len(values.points), -1)
        axes = ["x", "y", "z"][: values.points.shape[1]]
        names = [f"value_{k}" for k in range(columns.shape[1])]
        rows = [
            "".join(f"{number!r}," for number in row)[:-1]
            for row in np.hstack([values.points, columns]).tolist()
        ]
        self.files[file] = "\n".join([",".join([*axes, *names]), *rows, ""])
        return {"file": file.name, "field": names[0] if len(names) == 1 else names}

    def _value(self, value: Any, name: str) -> Any:
        if isinstance(value, NodeValues):
            return self._field(value, name)
        if value is None:
            return FREE
        return list(value) if isinstance(value, tuple) else value

    def _support(self, support: AnySupport, number: int, name: str = "") -> dict[str, Any]:
        where: dict[str, Any] = {"body": support.body, "surface": support.surface}
        table = {**({"name": name} if name else {}), **where}
        if isinstance(support, Support):
            return {**table, "value": self._held(support, f"support {number}")}
        if isinstance(support, Roller):
            if callable(support.direction):
                raise InvalidInputError(
                    f"a scene file has no directions that differ from node to node, as {support.in_words} "
                    "has: run the deck, or read it in Python"
                )
            table |= {"kind": "roller", "value": self._value(support.displacement, f"support {number}")}
            return {**table, "direction": list(support.direction or ())}
        assert isinstance(support, RigidSurface)
        table |= {
            "kind": "rigid",
            "at": list(support.at),
            "value": [self._value(v, "") for v in support.motion],
        }
        given = _given(support, "force", "moment")
        return table | {key: self._value(value, "") for key, value in given.items()}

    def _held(self, support: Support, name: str) -> list[Any]:
        return [self._value(each, f"{name} {axis}") for each, axis in zip(support.value, "xyz", strict=False)]

    def _load(self, load: Load, name: str) -> dict[str, Any]:
        """Return the table of a load with its value."""
        if isinstance(load, BodyForce) and isinstance(load.value, Spinning):
            spin = load.value
            axis = {} if spin.axis is None else {"axis": list(spin.axis)}
            return {
                "kind": "centrifugal", "body": load.body, "density": spin.density, "speed": spin.speed,
                "point": list(spin.point), **axis, **_given(load, "region"),
            }  # fmt: skip
        value = self._value(load.value, name)
        table: dict[str, Any] = {"body": load.body}
        if isinstance(load, PointForce):
            return {"kind": "point_force", **table, "nodes": load.nodes, "value": value}
        if isinstance(load, Pressure):
            return {"kind": "pressure", **table, "surface": load.surface, "value": value}
        if isinstance(load, InitialStress):
            return {"kind": "initial_stress", **table, "value": value}
        if isinstance(load, ThermalStrain):
            return {"kind": "thermal", **table, "value": value}
        if isinstance(load, BodyForce):
            return {"kind": "body_force", **table, "value": value, **_given(load, "region")}
        assert isinstance(load, TotalForce)
        table |= {"kind": "total_force", "surface": load.surface, "value": value}
        given = _given(load, "moment", "at")
        return table | {key: self._value(value, "") for key, value in given.items()}

    def _history(self, steps: Sequence[LoadStep]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Return the loads before the first step, zero, and the steps."""
        named: dict[tuple[Any, ...], tuple[str, dict[str, Any]]] = {}
        tables, begin = [], 0.0
        first = [_holds(each) for each in steps[0].supports or ()]  # type: ignore[union-attr]
        for number, step in enumerate(steps):
            assert not callable(step.loads)
            assert not callable(step.supports)
            values: dict[str, Any] = {}
            for load in step.loads or ():
                key = _key(load)
                if key not in named:
                    named[key] = f"load {len(named)}", self._load(load, f"load {len(named)}")
                name = named[key][0]
                values[name] = self._at_end(load, named[key][1], f"{name} step {number}")
            for key, (name, table) in named.items():
                if name not in values:
                    values[name] = _nothing(table)
            if [_holds(each) for each in step.supports or ()] != first:
                raise InvalidInputError(
                    f"a scene file has the same components held in all steps, {step.name} holds others than "
                    "the first: run the deck, or read it in Python"
                )
            if step.contacts is not None:
                raise InvalidInputError(
                    f"a scene file has the same contact pairs in all steps, {step.name} changes them: run "
                    "the deck, or read it in Python"
                )
            end = float(number + 1) if step.time is None else step.time
            held = {
                f"support {k}": self._moved(each, k, number) for k, each in enumerate(step.supports or ())
            }
            table = {"name": step.name, "duration": end - begin, "supports": held, "loads": values}
            if step.preloads is not None:
                table["preloads"] = {
                    each.label: _given(each, "force", "shortening") for each in step.preloads
                }
            if step.constraints is not None:
                table["constraints"] = {name: _plain(value) for name, value in step.constraints.items()}
            tables.append(table)
            begin = end
        loads = [{"name": name, **table, _changed(table): _nothing(table)} for name, table in named.values()]
        return loads, tables

    def _at_end(self, load: Load, first: Mapping[str, Any], name: str) -> Any:
        table = self._load(load, name)
        same = {k: v for k, v in table.items() if k != _changed(table)}
        if same != {k: v for k, v in first.items() if k != _changed(first)}:
            raise InvalidInputError(
                f"a scene file changes the value of a load from step to step alone, {name} of body "
                f"{load.body!r} changes more: run the deck, or read it in Python"
            )
        return table[_changed(table)]

    def _moved(self, support: AnySupport, number: int, step: int) -> Any:
        if isinstance(support, Support):
            return self._held(support, f"support {number} step {step}")
        if isinstance(support, Roller):
            return self._value(support.displacement, f"support {number} step {step}")
        assert isinstance(support, RigidSurface)
        if support.load.any():
            raise InvalidInputError(
                f"a scene file has one force on a rigid surface for all steps, {support.in_words} changes "
                "it: run the deck, or read it in Python"
            )
        return [self._value(v, "") for v in support.motion]


def _key(load: Load) -> tuple[Any, ...]:
    """Return what tells a load from others through the steps."""
    spins = isinstance(load, BodyForce) and isinstance(load.value, Spinning)
    where = getattr(load, "surface", getattr(load, "nodes", getattr(load, "region", "")))
    return type(load), spins, load.body, where


def _holds(support: AnySupport) -> tuple[Any, ...]:
    """Return where a support is, and of each component whether it is free or kept."""
    if isinstance(support, Support):
        values: tuple[Any, ...] = support.value
    elif isinstance(support, Roller):
        values = (support.displacement,)
    else:
        values = support.motion if isinstance(support, RigidSurface) else ()
    how = tuple((each is None, isinstance(each, Kept)) for each in values)
    return type(support), support.body, support.surface, how


def _changed(table: Mapping[str, Any]) -> str:
    return "speed" if table["kind"] == "centrifugal" else "value"


def _nothing(table: Mapping[str, Any]) -> Any:
    value = table[_changed(table)]
    if isinstance(value, Mapping):
        several = isinstance(value["field"], list)
        return [0.0] * len(value["field"]) if several else 0.0
    return [0.0] * len(value) if isinstance(value, list) else 0.0


def _given(part: object, *names: str) -> dict[str, Any]:
    """Return those of some attributes that are not None."""
    values = {name: getattr(part, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def _side(surface: Surface) -> dict[str, str]:
    return {"body": surface.body, "surface": surface.name}


def _tie(tie: AnyTie) -> dict[str, Any]:
    table: dict[str, Any] = {"slave": _side(tie.slave), "master": _side(tie.master)}
    if isinstance(tie, CyclicSymmetry):
        table |= {"kind": "cyclic", "at": list(tie.at), "axis": list(tie.axis or ()), "angle": tie.angle}
    return table


def _pair(pair: ContactPair) -> dict[str, Any]:
    assert isinstance(pair.master, Surface)
    table: dict[str, Any] = {"slave": _side(pair.slave), "master": _side(pair.master)}
    if isinstance(pair.friction, Coulomb):
        table["friction"] = {"law": "coulomb", "coefficient": pair.friction.friction_coefficient}
        if pair.friction.stick_stiffness is not None:
            table["friction"]["stick_stiffness"] = pair.friction.stick_stiffness
    if pair.closure is not None:
        law: dict[str, Any] = {"law": _LAWS[type(pair.closure)]}
        for field in fields(pair.closure):  # type: ignore[arg-type]
            value = getattr(pair.closure, field.name)
            law[field.name] = list(value) if isinstance(value, tuple) else value
        table["closure"] = law
    if not pair.reason:
        table["discretisation"] = pair.discretisation
    table |= _given(pair, "gap", "interference", "adjust", "nodes")
    return table


def _preload(preload: Preload) -> dict[str, Any]:
    section = preload.section
    assert isinstance(section, CutAt)
    table: dict[str, Any] = {"name": preload.label, "body": preload.body}
    table |= {"point": list(section.point), "normal": list(section.normal)}
    table |= _given(section, "radius")
    table |= _given(preload, "force", "shortening")
    return table


def _constraint(constraint: LinearConstraint) -> dict[str, Any]:
    terms = [
        {
            "body": term.body,
            **{name: _plain(value) for name in ("nodes", "direction", "factor", "equation")
               if (value := getattr(term, name)) is not None},
        }
        for term in constraint.terms
    ]  # fmt: skip
    return {"name": constraint.label, "terms": terms, "value": _plain(constraint.value)}


def _plain(value: Any) -> Any:
    """Return arrays and tuples as lists."""
    return value.tolist() if isinstance(value, np.ndarray) else _listed(value)


def _listed(value: Any) -> Any:
    """Return tuples, and those in them, as lists."""
    return [_listed(each) for each in value] if isinstance(value, tuple) else value
