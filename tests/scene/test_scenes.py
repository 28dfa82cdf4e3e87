"""Scenes and their parts: what is checked when they are made."""

from __future__ import annotations

import math
from collections.abc import Callable
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
    BodyMesh,
    ClosureTable,
    ConstraintTerm,
    ContactPair,
    Coulomb,
    CyclicSymmetry,
    DistanceObstacle,
    ElasticFoundation,
    ExponentialClosure,
    FluidPressure,
    FrictionTable,
    HoldCurrent,
    InitialStress,
    LinearClosure,
    LinearConstraint,
    LoadStep,
    MovingObstacle,
    PointForce,
    Preload,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    RigidTool,
    Roller,
    SampledField,
    Scene,
    Section,
    SlipTable,
    Spring,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    ToolMotion,
    TotalForce,
    Traction,
    Tresca,
    Ufl,
    Wear,
    WearTable,
    gravity,
)
from fenics_contact._base.checks import checked
from fenics_contact._scene.parts import surface_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    AnisotropicElasticity,
    FinitePlasticity,
    HistoryPlaneStress,
    HyperelasticPlaneStress,
    Hyperfoam,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHooke,
    NeoHookeanPlasticity,
    Ogden,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    PlaneStrain,
    PlaneStress,
    RambergOsgood,
    StVenantKirchhoff,
    TemperatureDependentElasticity,
    rigid_body_modes,
)

STEEL = IsotropicElasticity(2.1e5, 0.3)
FLOOR = RigidPlane((0, 0, 0), (0, 0, 1))
BASE = Surface("upper", "z0")
TOP = Surface("lower", "z1")


def stack(**parts: Any) -> Scene:
    """One block on another."""
    lower = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL)
    upper = Body(block((0, 0, 1), (1, 1, 2), (1, 1, 1), "tetrahedron"), STEEL)
    return Scene({"lower": lower, "upper": upper}, **parts)


def test_a_scene_without_bodies_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"at least one body, got none: pass bodies=\{'name': Body"):
        Scene({})


@pytest.mark.parametrize(
    ("user", "parts"),
    [
        ("Support", {"supports": [Support("bottom", "z0")]}),
        ("Traction", {"loads": [Traction("bottom", "z0", (0, 0, 1))]}),
        ("TotalForce", {"loads": [TotalForce("bottom", "z0", (0, 0, 1))]}),
        ("BodyForce", {"loads": [BodyForce("bottom", (0, 0, 1))]}),
        ("ContactPair.slave", {"contacts": [ContactPair(Surface("bottom", "z0"), TOP)]}),
        ("ContactPair.master", {"contacts": [ContactPair(BASE, Surface("bottom", "z0"))]}),
    ],
)
def test_an_unknown_body_is_refused_by_whoever_names_it(user: str, parts: dict[str, Any]) -> None:
    message = rf"^{user} names body 'bottom', the scene has \['lower', 'upper'\]: use one of them$"
    with pytest.raises(InvalidInputError, match=message):
        stack(**parts)


@pytest.mark.parametrize(
    ("user", "parts"),
    [
        ("Support", {"supports": [Support("lower", "top")]}),
        ("Traction", {"loads": [Traction("lower", "top", (0, 0, 1))]}),
        ("TotalForce", {"loads": [TotalForce("lower", "top", (0, 0, 1))]}),
        ("PointForce", {"loads": [PointForce("lower", "top", (0, 0, 1))]}),
        ("ContactPair.slave", {"contacts": [ContactPair(Surface("lower", "top"), BASE)]}),
        ("ContactPair.master", {"contacts": [ContactPair(BASE, Surface("lower", "top"))]}),
    ],
)
def test_an_unknown_surface_is_refused_by_whoever_names_it(user: str, parts: dict[str, Any]) -> None:
    message = rf"^{user} names surface 'top' of body 'lower', which has \['x0', .*'z1'\]: use one of them$"
    with pytest.raises(InvalidInputError, match=message):
        stack(**parts)


def test_an_empty_contact_surface_cannot_be_made() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(InvalidInputError, match=r"'contact' must have .*, a row per facet, got \(0, 4\)"):
        BodyMesh(mesh.points, mesh.cells, {"contact": mesh.surfaces["z0"][:0]})


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_coordinates_that_are_no_numbers_are_refused(bad: float) -> None:
    scene = stack()
    points = scene.bodies["lower"].mesh.points.copy()
    points[3, 1] = bad
    with pytest.raises(InvalidInputError, match=r"finite coordinates below .*, 1 of 8 do not, first node 3"):
        scene.moved({"lower": points})


def test_a_moved_scene_is_a_new_one_with_the_same_parts() -> None:
    scene = stack(supports=[Support("lower", "z0")], contacts=[ContactPair(BASE, TOP)])
    before = scene.bodies["upper"].mesh.points.copy()
    lifted = before + np.array([0.0, 0.0, 0.5])
    moved = scene.moved({"upper": lifted})
    np.testing.assert_array_equal(scene.bodies["upper"].mesh.points, before)
    np.testing.assert_array_equal(moved.bodies["upper"].mesh.points, lifted)
    assert moved.bodies["lower"] is scene.bodies["lower"]
    assert (moved.supports, moved.contacts) == (scene.supports, scene.contacts)
    assert moved.body_names == ("lower", "upper")


def test_moving_an_unknown_body_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"moved names body 'bottom', the scene has \['lower', 'up"):
        stack().moved({"bottom": np.zeros((8, 3))})


def test_effects_name_everything_a_scene_calls_for() -> None:
    scene = stack(
        supports=[Support("lower", "z0")],
        loads=[BodyForce("upper", (0, 0, -1)), TotalForce("upper", "z1", (0, 0, -1))],
        contacts=[
            ContactPair(BASE, TOP, Coulomb(0.3)),
            ContactPair(Surface("lower", "x0"), FLOOR, Tresca(2.0)),
        ],
    )
    assert {effect.name for effect in scene.effects()} == {
        "elasticity",
        "prescribed displacement",
        "body force",
        "surface load",
        "contact",
        "Tresca friction",
        "Coulomb friction",
    }
    assert all(effect.reason for effect in scene.effects())


@pytest.mark.parametrize("friction", [None, Coulomb(0.0), Tresca(0.0)])
def test_friction_that_can_carry_nothing_is_not_an_effect(friction: Coulomb | Tresca | None) -> None:
    pair = ContactPair(BASE, TOP, friction)
    assert not pair.has_friction
    assert [effect.name for effect in stack(contacts=[pair]).effects()] == ["elasticity", "contact"]


def test_a_stress_at_the_start_is_an_effect_and_no_load_on_a_surface() -> None:
    stressed = stack(loads=[InitialStress("upper", (1.0, 0, 0, 0, 0, 0))])
    assert [effect.name for effect in stressed.effects()] == ["elasticity", "initial stress"]


def test_a_scene_without_contact_calls_for_none() -> None:
    assert [effect.name for effect in stack().effects()] == ["elasticity"]


@pytest.mark.parametrize("kind", [ContactPair, Tie])
def test_the_same_surfaces_twice_are_refused(kind: type[ContactPair] | type[Tie]) -> None:
    pairs = [kind(BASE, TOP), kind(TOP, BASE)]
    name = "contacts" if kind is ContactPair else "ties"
    assert len(getattr(stack(**{name: pairs}), name)) == 2
    words = f"the surfaces of {kind.__name__} 2, upper z0 on lower z1, are those of {kind.__name__} 0: how"
    with pytest.raises(InvalidInputError, match=words):
        stack(**{name: [*pairs, pairs[0]]})


def test_plane_and_solid_bodies_in_one_scene_are_refused() -> None:
    solid, plane = stack().bodies["lower"], Body(rectangle((0, 0), (1, 1), (1, 1)), PlaneStrain(1.0, 0.3))
    with pytest.raises(InvalidInputError, match=r"must be plane or none, got \['b'\] but not \['a'\]: give"):
        Scene({"a": solid, "b": plane})


# Materials, supports, loads and contact pairs refuse what makes no sense, and say what would.
@pytest.mark.parametrize("modulus", [-2.1e5, 0.0, math.nan, math.inf])
def test_a_young_modulus_must_be_positive(modulus: float) -> None:
    message = r"young_modulus must be a positive number, got .*: give E in force per area"
    with pytest.raises(InvalidInputError, match=message):
        IsotropicElasticity(modulus, 0.3)


@pytest.mark.parametrize("ratio", [0.5, 0.7, -1.0, math.nan, math.inf])
def test_a_poisson_ratio_must_leave_the_energy_positive(ratio: float) -> None:
    message = r"poisson_ratio must lie between -1 and 0.5 \(excluded\), got .*: use 0.3 for steel"
    with pytest.raises(InvalidInputError, match=message):
        IsotropicElasticity(2.1e5, ratio)


def test_a_friction_coefficient_must_not_be_negative() -> None:
    for value in (-0.3, math.nan, math.inf):
        with pytest.raises(
            InvalidInputError, match=r"friction_coefficient must be zero or positive and finite, got"
        ):
            Coulomb(value)
    assert Coulomb(0.0).friction_coefficient == 0.0


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_slip_bound_must_not_be_negative(value: float) -> None:
    with pytest.raises(
        InvalidInputError, match=r"Tresca.traction must be zero or positive and finite, got .*: give"
    ):
        Tresca(value)


@pytest.mark.parametrize(
    "value", [(), (0.0,), (None, None, None), (0.0, 0.0, math.nan), (math.inf, None, None), (0, 0, 0, 0)]
)
def test_a_support_must_prescribe_something(value: Any) -> None:
    message = r"Support.value must hold three entries \(two for a plane body\), .* got .*: \(0.0"
    with pytest.raises(InvalidInputError, match=message):
        Support("body", "side", value)


@pytest.mark.parametrize("value", [1.0, (0.0, math.nan, 0.0), (0.0, 0.0, -math.inf), (1, 2, 3, 4), "xyz"])
@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("Traction", lambda value: Traction("body", "side", value)),
        ("TotalForce", lambda value: TotalForce("body", "side", value)),
        ("BodyForce", lambda value: BodyForce("body", value)),
        ("PointForce", lambda value: PointForce("body", "tip", value)),
    ],
)
def test_a_load_must_be_a_vector(name: str, make: Callable[[Any], Any], value: Any) -> None:
    message = rf"{name}.value must be three finite numbers \(two for a plane body\), got .*: give one for x"
    with pytest.raises(InvalidInputError, match=message):
        make(value)


@pytest.mark.parametrize(
    ("point", "normal"),
    [
        ((0, 0, 0), (0, 0, 0)),
        ((0, 0, 0), (0, math.nan, 1)),
        ((math.inf, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 1)),
        ((0, 0), (0, 0, 1)),
    ],
)
def test_a_plane_needs_a_direction(point: Any, normal: Any) -> None:
    message = r"RigidPlane(\.normal| must be placed by 2 or 3 finite numbers).* got "
    with pytest.raises(InvalidInputError, match=message):
        RigidPlane(point, normal)


def test_the_normal_of_a_plane_gets_unit_length() -> None:
    assert RigidPlane((1, 2, 3), (0, 3, 4)).normal == pytest.approx((0, 0.6, 0.8))


def test_only_a_body_that_may_deform_much_can_touch_itself() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    pair = ContactPair(Surface("seal", "z0"), Surface("seal", "z1"))
    assert pair.is_self_contact
    own = replace(pair, master=pair.slave)
    Scene({"seal": Body(mesh, NeoHooke(1.0, 0.3))}, contacts=[pair, own])
    message = "contact of body 'seal' with itself needs a material for large deformations"
    for material, wrong in (
        (IsotropicElasticity(1.0, 0.3), pair),
        (IsotropicElasticity(1.0, 0.3), own),
        (NeoHooke(1.0, 0.3), replace(pair, discretisation="mortar")),
        (NeoHooke(1.0, 0.3), replace(pair, gap=0.1)),
    ):
        with pytest.raises(InvalidInputError, match=message):
            Scene({"seal": Body(mesh, material)}, contacts=[wrong])


def test_elasticity_hands_out_the_parameters_of_lame() -> None:
    lame, shear = IsotropicElasticity(210.0, 0.25).parameters
    assert lame == pytest.approx(84.0)
    assert shear == pytest.approx(84.0)
    assert isinstance(IsotropicElasticity(210.0, 0.25), Material)


def test_rigid_body_modes_are_six_and_move_no_point_nearer_to_another() -> None:
    points = np.random.default_rng(1).uniform(-1e3, 1e3, (9, 3)) + 1e5
    modes = rigid_body_modes(points)
    assert modes.shape == (9, 3, 6)
    size = np.linalg.svd(modes.reshape(27, 6), compute_uv=False)
    assert size.min() > 0.1 * size.max(), "translations and rotations should be of one size"
    apart = points[:, None] - points[None]
    stretch = np.einsum("ijd,ijdm->ijm", apart, modes[:, None] - modes[None])
    assert np.abs(stretch).max() < 1e-9 * np.abs(apart).max()


# What scenes are made of refuses arguments of other types, whichever class and argument it is.
PLANE, IRON = RigidPlane((0, 0, 0), (0, 0, 1)), IsotropicElasticity(2.1e5, 0.3)
FACE, OTHER = Surface("upper", "z0"), Surface("lower", "z1")
BODY = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), IRON)
DOWN = (0, 0, -1)
SAMPLES: dict[type, Any] = {
    type(sample): sample
    for sample in (
        PLANE, IRON, FACE, BODY, Coulomb(0.3), Tresca(1.0), SampledField(np.eye(3), np.ones(3)),
        ContactPair(FACE, PLANE), Tie(FACE, OTHER), RigidSurface("a", "b", (0, 0, 0)), Roller("a", "b"),
        CyclicSymmetry(FACE, OTHER, (0, 0, 0), (0, 0, 1)),
        RigidTool("t", PLANE, (0, 0, 0)), ToolMotion("t"), HoldCurrent(),
        LinearClosure(1.0), ExponentialClosure(1.0, 1.0), ClosureTable((0.0, 1.0), (0.0, 1.0)),
        FrictionTable((0.0, 1.0), (0.3, 0.2)), SlipTable((0.0, 1.0), (0.3, 0.2)),
        FluidPressure(1.0, "x0"), Wear(1e-8), WearTable((0.0, 1.0), (1e-8, 2e-8)),
        Support("a", "b"), Traction("a", "b", DOWN), TotalForce("a", "b", DOWN), Pressure("a", "b", 1),
        BodyForce("a", DOWN), ThermalStrain("a", 1.0), InitialStress("a", (1.0,) * 6),
        Ufl(lambda x: x), LoadStep("a"), Scene({"a": BODY}),
        RigidSphere((0, 0, 0), 1.0), RigidCylinder((0, 0, 0), (0, 0, 1), 1.0),
        ElasticFoundation("a", "b", 1.0), Spring(Surface("a", "b"), DOWN, 1.0), Section((0, 0, 0), DOWN),
        ConstraintTerm("a", "b", "x"), LinearConstraint([ConstraintTerm("a", "b", "x")]),
        Preload("a", Section((0, 0, 0), DOWN)), PointForce("a", "b", DOWN),
        AutomaticContact(Coulomb(0.3)), MovingObstacle(PLANE, lambda time: (None, DOWN)),
        DistanceObstacle(lambda x: x[:, 0]), PlaneStrain(1.0, 0.3), PlaneStress(1.0, 0.3),
        OrthotropicPlaneStress((1.0, 1.0), 0.3, 1.0),
        OrthotropicElasticity((1.0,) * 3, (0.1,) * 3, (1.0,) * 3),  # type: ignore[arg-type]
        TemperatureDependentElasticity(1.0, 0.3),
        AnisotropicElasticity(np.eye(6)),  # type: ignore[arg-type]
        NeoHooke(1.0, 0.3), MooneyRivlin(1.0, 0.5, 10.0), StVenantKirchhoff(1.0, 0.3),
        Ogden((1.0,), (2.0,), 10.0), J2Plasticity(1.0, 0.3, 0.1), FinitePlasticity(1.0, 0.3, 0.1),
        NeoHookeanPlasticity(1.0, 0.3, 0.1), Hyperfoam((1.0,), (2.0,), (0.1,)),
        RambergOsgood(1.0, 0.3, 1.0, 5.0, 0.4),
        HyperelasticPlaneStress(NeoHooke(1.0, 0.3)), HistoryPlaneStress(J2Plasticity(1.0, 0.3, 0.1)),
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


@pytest.mark.parametrize("kind", [kind for kind in SAMPLES if kind is not HoldCurrent])
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
        ContactPair(FACE, PLANE, friction)


#: What is wrong, and what the message says of it.
WRONG: list[tuple[Any, str]] = [
    (lambda: ContactPair("upper", PLANE), r"slave must be Surface\(body, name\), got 'upper': surface whose"),
    (lambda: ContactPair(FACE, "floor"), "master must be Surface.* or a RigidObstacle with distance"),
    (lambda: Tie(FACE, PLANE), r"Tie.master must be Surface\(body, name\), got RigidPlane.*: surface of"),
    (lambda: Tie(FACE, OTHER, 1), "Tie.sliding must be True or False, got 1: whether the surfaces"),
    (lambda: ContactPair(FACE, PLANE, None, "Mortar"), "must be 'best' or 'node' or 'mortar', got 'Mortar"),
    (lambda: Coulomb(True), "a FrictionCurve or SlipTable.*, got True: friction coefficient μ ≥ 0"),
    (lambda: Coulomb("0.3"), "a FrictionCurve or SlipTable.*, got '0.3': friction coefficient μ ≥ 0"),
    (lambda: IsotropicElasticity("steel", 0.3), "IsotropicElasticity.young_modulus must be a number, got 's"),
    (lambda: PlaneStrain(1.0, 0.3, "hot"), "PlaneStrain.thermal_expansion must be a number or None"),
    (lambda: Body("cube.msh", IRON), "Body.mesh must be BodyMesh.*, got 'cube.msh': the mesh"),
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


def test_a_surface_is_made_once_for_a_mesh_and_its_planes_of_symmetry() -> None:
    mesh, side = block((0, 0, 0), (1, 1, 1), (2, 2, 1)), Surface("one", "z1")
    free = Scene({"one": Body(mesh, STEEL)})
    cut = replace(free, supports=[Roller("one", "x0")])
    moved = replace(free, bodies={"one": replace(free.bodies["one"], mesh=mesh.moved(mesh.points + 1.0))})
    first, other, away = (surface_of(scene, side, "best") for scene in (free, cut, moved))
    assert surface_of(replace(free), side, "best") is first
    assert other.mirrored.any() > first.mirrored.any()
    np.testing.assert_allclose(away.points, first.points + 1.0)
