"""What scenes are made of refuses arguments of other types, whichever class and argument it is."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import fenics_contact
from fenics_contact import (
    AutomaticContact,
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    DistanceObstacle,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    SampledField,
    Scene,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    TotalForce,
    Traction,
    Tresca,
    Ufl,
    gravity,
)
from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import (
    FinitePlasticity,
    IsotropicElasticity,
    J2Plasticity,
    MooneyRivlin,
    NeoHooke,
    Ogden,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    StVenantKirchhoff,
)

FLOOR, STEEL = RigidPlane((0, 0, 0), (0, 0, 1)), IsotropicElasticity(2.1e5, 0.3)
FACE, OTHER = Surface("upper", "z0"), Surface("lower", "z1")
BODY = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL)
DOWN = (0, 0, -1)
SAMPLES: dict[type, Any] = {
    type(sample): sample
    for sample in (
        FLOOR, STEEL, FACE, BODY, Coulomb(0.3), Tresca(1.0), SampledField(np.eye(3), np.ones(3)),
        ContactPair(FACE, FLOOR), Tie(FACE, OTHER), RigidSurface("a", "b", (0, 0, 0)),
        Support("a", "b"), Traction("a", "b", DOWN), TotalForce("a", "b", DOWN), Pressure("a", "b", 1),
        BodyForce("a", DOWN), ThermalStrain("a", 1.0), Ufl(lambda x: x), LoadStep("a"), Scene({"a": BODY}),
        RigidSphere((0, 0, 0), 1.0), RigidCylinder((0, 0, 0), (0, 0, 1), 1.0),
        AutomaticContact(Coulomb(0.3)), MovingObstacle(FLOOR, lambda time: (None, DOWN)),
        DistanceObstacle(lambda x: x[:, 0]), PlaneStrain(1.0, 0.3), PlaneStress(1.0, 0.3),
        OrthotropicPlaneStress((1.0, 1.0), 0.3, 1.0),
        OrthotropicElasticity((1.0,) * 3, (0.1,) * 3, (1.0,) * 3),  # type: ignore[arg-type]
        NeoHooke(1.0, 0.3), MooneyRivlin(1.0, 0.5, 10.0), StVenantKirchhoff(1.0, 0.3),
        Ogden((1.0,), (2.0,), 10.0), J2Plasticity(1.0, 0.3, 0.1), FinitePlasticity(1.0, 0.3, 0.1),
    )
}  # fmt: skip


def offered(room: ModuleType) -> list[type]:
    """Return the dataclasses that a public module offers."""
    values = [getattr(room, name) for name in room.__all__]
    return [value for value in values if isinstance(value, type) and is_dataclass(value)]


def test_every_part_of_a_scene_has_a_sample_here() -> None:
    scene = [
        value for value in offered(fenics_contact) if value.__module__.startswith("fenics_contact._scene.")
    ]
    materials = set(offered(fenics_contact.materials)) - {fenics_contact.materials.MaterialResponse}
    assert {*scene, *materials} == set(SAMPLES)


class Odd:
    """No argument of anything."""


@pytest.mark.parametrize("kind", SAMPLES)
def test_no_argument_may_be_of_another_type(kind: type) -> None:
    sample = SAMPLES[kind]
    assert fields(sample)
    for field in fields(sample):
        for wrong in (Odd(), b"bytes", 1j, {1, 2}):
            with pytest.raises(InvalidInputError, match=rf"{field.name}|material must have dims") as caught:
                replace(sample, **{field.name: wrong})
            assert ": " in str(caught.value), "what to do is missing"
        if field.default is not None and field.default is not MISSING:
            replace(sample, **{field.name: field.default})


@pytest.mark.parametrize("friction", [0.3, "coulomb", Coulomb, (0.3,), True])
def test_what_is_no_law_of_friction_is_not_taken_for_none(friction: Any) -> None:
    message = (
        r"^ContactPair.friction must be Coulomb\(friction_coefficient\), Tresca\(traction\) or None, got .*: "
        "law of friction; without one \\(None\\) contact is frictionless$"
    )
    with pytest.raises(InvalidInputError, match=message):
        ContactPair(FACE, FLOOR, friction)


#: What is wrong, and what the message says of it.
WRONG: list[tuple[Any, str]] = [
    (lambda: ContactPair("upper", FLOOR), r"slave must be Surface\(body, name\), got 'upper': surface whose"),
    (lambda: ContactPair(FACE, "floor"), "master must be Surface.* or a RigidObstacle with distance"),
    (lambda: Tie(FACE, FLOOR), r"Tie.master must be Surface\(body, name\), got RigidPlane.*: surface of"),
    (lambda: Tie(FACE, OTHER, 1), "Tie.sliding must be True or False, got 1: whether the surfaces"),
    (lambda: ContactPair(FACE, FLOOR, None, "Mortar"), "must be 'best' or 'node' or 'mortar', got 'Mortar"),
    (lambda: Coulomb(True), "must be a number or a function, got True: friction coefficient μ ≥ 0"),
    (lambda: Coulomb("0.3"), "must be a number or a function, got '0.3': friction coefficient μ ≥ 0"),
    (lambda: IsotropicElasticity("steel", 0.3), "IsotropicElasticity.young_modulus must be a number, got 's"),
    (lambda: PlaneStrain(1.0, 0.3, "hot"), "PlaneStrain.thermal_expansion must be a number or None"),
    (lambda: Body("cube.msh", STEEL), "Body.mesh must be BodyMesh.*, got 'cube.msh': the mesh"),
    (lambda: Body(BODY.mesh, "steel"), "a material must have dims.* str lacks .*: derive it from"),
    (lambda: Support("a", "z0", 0.0), r"Support.value must be a sequence \(each a number, a function or"),
    (lambda: Support("a", "z0", (0, "x", 0)), r"value\[1\] must be a number, a function or None, got 'x'"),
    (lambda: Traction("a", 3, DOWN), "Traction.surface must be a string, got 3: name of its surface"),
    (lambda: Scene([BODY]), r"Scene.bodies must be a mapping \(each value Body\(mesh, material\)\), got \["),
    (lambda: Scene({"a": BODY.mesh}), r"Scene.bodies\['a'\] must be Body\(mesh, material\), got BodyMesh"),
    (lambda: Scene({"a": BODY}, Support("a", "z0")), r"Scene.supports must be a sequence \(each Support\("),
    (lambda: Scene({"a": BODY}, [], [FACE]), r"Scene.loads\[0\] must be Traction\(.*, got Surface"),
    (lambda: LoadStep("push", loads=[FACE]), r"LoadStep.loads\[0\] must be Traction\(.*, got Surface"),
    (lambda: LoadStep("push", supports=3), "LoadStep.supports must be a sequence .* or None, got 3: all"),
    (lambda: RigidPlane(0.0, (0, 0, 1)), r"RigidPlane.point must be a sequence \(each a number\), got 0.0"),
    (lambda: gravity("a", "heavy", DOWN), "density must be a finite number, got 'heavy'"),
    (lambda: gravity("a", 1.0, 9.81), "acceleration must be three finite numbers"),
    (lambda: gravity("a", lambda x: x, DOWN), "gravity needs numbers, got .*: give a BodyForce"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "message"), WRONG)
def test_an_error_names_the_argument_what_it_must_be_and_what_it_means(make: Any, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_numbers_and_sequences_of_all_kinds_are_taken() -> None:
    numbers: list[Any] = [1, np.float32(1.0), np.int64(1), np.float64(1.0)]
    for number in numbers:
        assert Coulomb(number).friction_coefficient == 1.0
    origin, up, axes = np.zeros(3), [0, 0, 2], np.eye(3)
    given: Any = (origin, up)
    assert RigidPlane(*given).normal == (0.0, 0.0, 1.0)
    given = ([1, 1, 1], (0.1, 0.1, 0.1), np.ones(3), axes)
    assert OrthotropicElasticity(*given).dims == (3,)
    assert len(Scene({"a": BODY}, (Support("a", "z0"),), contacts=()).supports) == 1


def test_a_material_of_ones_own_is_left_to_its_author() -> None:
    @dataclass(frozen=True)
    class Named(IsotropicElasticity):
        names: NotThere | None = None  # type: ignore[name-defined]  # noqa: F821

    known: Any = Named
    assert known(1.0, 0.3, names="x").names == "x"
    with pytest.raises(InvalidInputError, match=r"number, got 'x': Young's modulus E > 0"):
        known("x", 0.3)


def test_checks_of_a_base_are_not_lost() -> None:
    @dataclass
    class Wire:
        radius: float

        def __post_init__(self) -> None:
            if self.radius <= 0:
                raise InvalidInputError("radius above zero")

    @dataclass
    @checked()
    class Rope(Wire):
        strands: int

    with pytest.raises(InvalidInputError, match="above zero"):
        Rope(-1.0, 3)
    with pytest.raises(InvalidInputError, match=r"Rope\.strands must be"):
        Rope(1.0, "three")  # type: ignore[arg-type]
