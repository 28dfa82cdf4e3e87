"""What every public object says of itself on a screen: a few lines, and no arrays."""

from __future__ import annotations

import importlib
import inspect
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import Enum
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fenics_contact
from fenics_contact import (
    AccurateDesign,
    AccurateResult,
    AutomaticContact,
    AutomaticSteps,
    BodyForce,
    BodyMesh,
    Checkpoint,
    ClosureTable,
    ConstraintTerm,
    ContactProblem,
    Coulomb,
    CyclicSymmetry,
    DesignResponse,
    DistanceObstacle,
    ElasticFoundation,
    ExponentialClosure,
    FixedPoint,
    FluidPressure,
    FrictionTable,
    HoldCurrent,
    InitialStress,
    Level,
    Limits,
    LinearClosure,
    LinearConstraint,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    NewtonSteps,
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
    SceneResponse,
    Section,
    ShapeProblem,
    SlipTable,
    Spring,
    Status,
    Support,
    Surface,
    TangentNewton,
    ThermalStrain,
    Tie,
    ToolMotion,
    TotalForce,
    TransferredState,
    Tresca,
    Ufl,
    Wear,
    WearLimits,
    WearTable,
    goal_error,
    minimize,
    solve_scene,
)
from fenics_contact._accuracy.certificate import certify
from fenics_contact._accuracy.recovery import find_sites
from fenics_contact._accuracy.state_errors import solver_errors
from fenics_contact._base.display import COLUMNS, LINES, Table, displayed, in_lines, tabled
from fenics_contact._optimize.problem import pose
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    ContactArea,
    ContactForces,
    ForScipy,
    FrictionWork,
    LargestPressure,
    LargestStress,
    LargestWornDepth,
    LinearConstraints,
    LoadCases,
    LoadPath,
    Maximum,
    MovedSurface,
    Movement,
    MovementNear,
    NonlinearConstraint,
    PeakPressure,
    PressureNonuniformity,
    PressureNorm,
    Remeshed,
    StrainEnergy,
    StressNear,
    TotalPotential,
    VolumeIntegral,
    WeakChoice,
    WearNonuniformity,
    WornDepthNorm,
    WornVolume,
)
from fenics_contact.design.adjoint import linearise_face, solve_adjoint
from fenics_contact.design.remeshed import Remeshing
from fenics_contact.fatigue import (
    FatemiSocie,
    FatigueNorm,
    Findley,
    LifeCurve,
    SmithWatsonTopper,
    assess_cycle,
    ruiz_parameters,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductanceTable,
    ConductingBody,
    Conductor,
    Convection,
    EvenConductance,
    FrictionHeat,
    GapConductance,
    GapRadiation,
    HeatAtNodes,
    HeatedState,
    HeatFlux,
    HeatOfContact,
    HeatOfHeld,
    HeatProblem,
    HeatScene,
    HeatSource,
    HeldTemperature,
    JointResistance,
    PlasticHeat,
    PressureConductance,
    Radiation,
    TemperatureMean,
    TemperatureTable,
    ThermalContact,
    heat_adjoint,
    heat_goal_error,
    heat_in_time,
)
from fenics_contact.heat.interaction import Interaction
from fenics_contact.materials import (
    AnisotropicElasticity,
    FinitePlasticity,
    HistoryPlaneStress,
    HyperelasticPlaneStress,
    Hyperfoam,
    J2Plasticity,
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
)
from fenics_contact.mesh import Chart, MeshTransfer, refined, thickened
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.qp import FaceNewton
from fenics_contact.results import (
    BalancedTolerance,
    ConstraintForce,
    ConstraintForces,
    Preloads,
    RigidMotion,
    SectionForces,
    SpringForce,
    SpringForces,
    UnheldMotion,
)
from fenics_contact.results.deformed_state import AnyState
from tests.design.blocks import block_on_floor, designs_of
from tests.large_deformations.scenes import pressed, rounded
from tests.scenes import partitions

FACES = ("materials", "mesh", "results", "design", "heat", "fatigue")
MOST_PRINTED = 25
#: Protocols, and classes to derive from.
NO_OBJECTS = {
    "ClosureLaw", "Conductance", "Elasticity", "EnergyModel", "FrictionCurve", "WearCurve",
    "HeatObjective", "HistoryMaterial", "Hyperelasticity", "Inexact", "Kinked", "Material",
    "NearlyIncompressible", "Objective", "MaxFunction", "Resumable", "RigidObstacle", "State", "SurfaceShape",
    "Thermoelastic", "Transverse", "Weighable",
}  # fmt: skip


def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
    return float(x @ x), 2.0 * x


@cache
def objects() -> dict[str, Any]:
    """Return an object of every public class by the name of the class, and what they hold."""
    scene = block_on_floor(Coulomb(0.4), load=(0.4, 0.1, -2.0))
    contact = ContactProblem(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-8)
    shape = ShapeProblem(contact, designs_of(scene), TotalPotential())
    path = LoadPath(shape, [LoadStep("push")])
    followed, point = path.evaluate(np.zeros(path.size)), shape.evaluate(np.zeros(shape.size))
    state = point.state
    partials = shape.objective.partials(state, shape.geometry.forms)
    limits = LinearConstraints(np.ones((40, 60)), np.ones(40))
    search = ForScipy(bowl, np.zeros(60), constraints=limits)
    level = Level(8, 81, 1.0, 0.1, 9, 0.1, np.nan, 1.1, 1.0)
    search.arguments("SLSQP")["fun"](np.zeros(60))
    weights = [BodyForce("block", (0, 0, float(k))) for k in range(50)]
    sprung = SpringForce(np.eye(3)[2], np.array([0.1]), np.eye(3)[2:])
    held = ConstraintForce(np.zeros(60), {"block": np.zeros(3)})
    drawn = SectionForces(0.1, np.eye(3)[2], state.balance().loads)
    roots = [
        shape.function(TotalPotential()),
        shape, point, state, scene, scene.plan(), state.estimate_errors(), partials,
        state.costs, state.costs.total,
        state.gather_fields("block"), state.balance(), state.resultants(), find_sites(state.torn),
        solve_adjoint(state, partials, linearise_face(state, WeakChoice.RELEASED)),
        certify(state.dual, state.dual_solution), solver_errors(state.system, state.solution),
        SceneResponse(lambda load: scene, {"load": 1.0}, {"all": lambda state: 1.0}, MPI.COMM_SELF),
        DesignResponse(shape), AutomaticSteps(TangentNewton()),
        BalancedTolerance(), FixedPoint(FaceNewton()), LoadSequence(shape.contact), AdaptiveTolerance(),
        UnheldMotion({"block": np.eye(6)[0]}), RigidSurface("block", "z1", (0.5, 0.5, 1.0)),
        Roller("block", "x0"), CyclicSymmetry(Surface("block", "x0"), Surface("block", "y0"), (0.0, 0.0)),
        HoldCurrent(), *shape.geometry.motions, LoadCases({"one": shape}), path, followed,
        Remeshed(shape), Remeshing(np.zeros(60), 1.0, 1.1),
        ElasticFoundation("block", "z0", 1.0), Spring(Surface("block", "z1"), (0, 0, 9), 1.0),
        Preload("block", Section((0, 0, 0.5), (0, 0, 1))), PointForce("block", "tip", (0.0, 0.0, 1.0)),
        ConstraintTerm("block", [0, 1], "x"), LinearConstraint([ConstraintTerm("block", [0, 1], "x")]),
        ConstraintForces({"one": held}), held,
        Preloads({"block": drawn}), drawn, SpringForces({"rod": sprung}), sprung,
        RigidMotion(Surface("block", "z1"), np.zeros(3), np.ones(3), np.arange(3.0)),
        Chart(lambda x: x, np.zeros((60, 3))),
        limits, BundleTrust(), refined(rectangle((0, 0), (1, 1), (2, 2), "triangle"), [0]),
        minimize(bowl, np.ones(60), constraints=NonlinearConstraint(bowl, 90.0, name="size")),
        NonlinearConstraint(bowl, 90.0), Checkpoint("run.npz"), search,
        pose(bowl, np.zeros(60), constraints=limits),
        SampledField(np.eye(3), np.ones(3)),
        Support("block", "z1", (None, lambda x: x[:, 0], 0.0)), LoadStep("push", loads=weights),
        *CELL_TYPES.values(), ThermalStrain("block", 20.0), TotalForce("block", "z1", (0, 0, -1)),
        LinearClosure(1.0), ExponentialClosure(1.0, 0.1), ClosureTable((0.0, 0.1), (0.0, 1.0)),
        FrictionTable((0.0, 1.0), (0.3, 0.2)), FluidPressure(1.0, "x0"),
        SlipTable((0.0, 1.0), (0.3, 0.2)), Wear(1e-8), WearTable((0.0, 1.0), (1e-8, 2e-8)), WearLimits(0.1),
        Pressure("block", "z1", 1.0), Tresca(1.0), Tie(Surface("a", "z0"), Surface("b", "z1")),
        MooneyRivlin(1.0, 0.0, 9.0), Ogden((1.0,), (2.0,), 9.0), StVenantKirchhoff(1.0, 0.3),
        PlaneStrain(1.0, 0.3), PlaneStress(1.0, 0.3), NeoHooke(1.0, 0.3), J2Plasticity(1.0, 0.3, 1.0),
        HyperelasticPlaneStress(NeoHooke(1.0, 0.3)), HistoryPlaneStress(J2Plasticity(1.0, 0.3, 1.0)),
        FinitePlasticity(1.0, 0.3, 1.0), NeoHookeanPlasticity(1.0, 0.3, 1.0),
        Hyperfoam((1.0,), (2.0,), (0.1,)), RambergOsgood(1.0, 0.3, 1.0, 5.0, 0.4),
        J2Plasticity(1.0, 0.3, 1.0).answer(np.zeros((9, 3, 3)), np.zeros((9, 7)), 0.0), Ufl(lambda x: x[0]),
        DistanceObstacle(lambda x: x[:, 2]), RigidSphere((0, 0, 0), 1.0),
        AutomaticContact(), MovingObstacle(RigidSphere((0, 0, 0), 1.0), lambda time: (None, (time, 0, 0))),
        RigidTool("ball", RigidSphere((0, 0, 0), 1.0), (0, 0, 0)), ToolMotion("ball", (0, 0, None)),
        RigidCylinder((0, 0, 0), (0, 0, 1), 1.0), OrthotropicPlaneStress((2.0, 1.0), 0.1, 1.0),
        OrthotropicElasticity((3.0, 2.0, 1.0), (0.1, 0.1, 0.1), (1.0, 1.0, 1.0)),
        InitialStress("block", (1.0,) * 6),
        TemperatureDependentElasticity(1.0, 0.3),
        AnisotropicElasticity(np.eye(6)),  # type: ignore[arg-type]
        ContactForces(lambda contact: (0.0, np.zeros(1), np.zeros((1, 2)))),
        TotalPotential() + 2.0 * VolumeIntegral("motion", lambda u, x, stress: u[0], "block"),
        StrainEnergy(), PressureNorm(), PressureNonuniformity(), ContactArea(), FrictionWork(),
        WornVolume(), LargestWornDepth(), WornDepthNorm(), WearNonuniformity(),
        LargestStress("block"), Movement("block", "z1", (1, 0, 0)),
        StressNear("block", (0, 0, 0), 1.0), MovementNear("block", (0, 0, 0), 1.0, direction=(1, 0, 0)),
        Maximum((LargestPressure(),)), PeakPressure(), goal_error(state, StrainEnergy()),
        AccurateResult(state, 1.0, 0.1, 0.01, False, "why", (level,)),
        AccurateDesign(
            state, 1.0, 0.1, 0.01, False, "why", (level,), (shape,),
            (minimize(bowl, np.ones(60)),),
        ),
        TransferredState(state, {"block": MeshTransfer()}),
        MeshTransfer(),
        thickened(np.eye(3), [[0, 1, 2]], 0.1),
        Limits(levels=2),
        NewtonSteps(((0.1, 1e-3, 1e-7),)), TangentNewton(), AutomaticSteps(), DesignResponse(shape),
        SceneResponse(lambda load: scene, {"load": 1.0}, {"energy": lambda state: 0.0}, MPI.COMM_SELF),
        MovedSurface(shape.designs[0], scene.bodies["block"].mesh, np.zeros(shape.size)),
    ]  # fmt: skip
    roots.append(solve_scene(pressed(rounded(2), 0.1), MPI.COMM_SELF))
    roots += heated(contact, state)
    roots += [
        FatigueNorm("block", "z0", Findley(0.3), ("push", "pull", "push")), LifeCurve([(1.0, -0.1)]),
        assess_cycle([state] * 3, Findley(0.3)), ruiz_parameters([state] * 3), FatemiSocie(0.3, 1.0),
        SmithWatsonTopper(),
    ]  # fmt: skip
    found: dict[str, Any] = {}
    for root in roots:
        _collect(root, found)
    return found


def heated(contact: ContactProblem, state: AnyState) -> list[Any]:
    """Return objects of heat: states, a plan, and laws and loads that its scene has not."""
    names = [f"plate {k}" for k in range(3)]
    bodies = {
        name: ConductingBody(block((0, 0, k), (1, 1, k + 1), (2, 2, 2)), Conductor(0.05, 3.7e-3))
        for k, name in enumerate(names)
    }
    joints = [ThermalContact(Surface(b, "z0"), Surface(a, "z1"), 1.0) for a, b in pairwise(names)]
    held = [HeldTemperature("plate 0", "z0", lambda x: x[:, 0])]
    problem = HeatProblem(HeatScene(bodies, held, [HeatFlux("plate 2", "z1", 1.0)], joints), MPI.COMM_SELF)
    warm = problem.solve()
    joined = Interaction(
        contact.scene,
        problem.scene,
        warm.joints,
        problem.decomposition.tearing,
        dict.fromkeys(names, 0.0),
        1.0,
    )
    return [
        heat_in_time(problem.scene, MPI.COMM_SELF, 1.0, 20.0, step=1.0),
        warm, problem, HeatedState(state, warm, 1, "20 degrees", 0.0, (contact, problem), joined),
        problem.scene.plan(), Conductor(np.eye(3)),
        ConductanceTable((0.0, 1.0), (0.1, 0.2)), EvenConductance(1.0), PressureConductance(1.0, 1.0),
        GapConductance(1.0, 0.1), GapRadiation(0.5, 0.5), TemperatureTable((0.0, 1.0), (1.0, 2.0)),
        FrictionHeat(0.3, lambda x: x[:, 0]), Radiation("a", "z0", 0.9, 300.0),
        Convection("a", "z0", TemperatureTable((0.0, 1.0), (1.0, 2.0)), 20.0), HeatSource("a", 1.0),
        HeatAtNodes("a", "z0", 1.0), heat_adjoint(warm, TemperatureMean("plate 0")),
        heat_goal_error(warm, TemperatureMean("plate 0")), PlasticHeat("a", 0.9, np.ones(99)),
        HeatOfContact(0), HeatOfHeld("plate 0", "z0"), JointResistance(0),
    ]  # fmt: skip


def _collect(value: Any, found: dict[str, Any]) -> None:
    """Add an object and the objects that it holds, one of each class."""
    if isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            _collect(part, found)
    name = type(value).__name__
    if type(value).__module__.startswith("fenics_contact") and name not in found:
        found[name] = value
        held = [field.name for field in fields(value)] if is_dataclass(value) else list(vars(value))
        for part in held:
            _collect(getattr(value, part), found)


def public_classes() -> list[str]:
    """Return the names of the classes that the faces offer and of which there are objects."""
    rooms = (importlib.import_module(f"fenics_contact.{face}") for face in FACES)
    offered = [getattr(room, name) for room in rooms for name in room.__all__]
    offered += [getattr(fenics_contact, name) for name in fenics_contact.__all__]
    classes = [one for one in offered if inspect.isclass(one) and not issubclass(one, Enum | BaseException)]
    return sorted({one.__name__ for one in classes} - NO_OBJECTS)


#: What NumPy writes where it shows an array.
DUMPED = re.compile(r"array\(|\[ *-?\d[\d.e+-]*[ ,]+-?\d")


@pytest.mark.parametrize("name", public_classes())
def test_a_public_object_shows_a_few_lines_and_no_array(name: str) -> None:
    shown = repr(objects()[name])
    assert len(shown.splitlines()) <= LINES, shown
    assert not DUMPED.search(shown), shown
    assert len(shown) > len(name), "it says nothing of itself"
    assert max(map(len, shown.splitlines())) <= COLUMNS or "\n" not in shown, shown
    assert len(str(objects()[name]).splitlines()) <= MOST_PRINTED


def test_a_dumped_array_would_be_found() -> None:
    assert DUMPED.search(repr(np.arange(3)))
    assert DUMPED.search(str(np.linspace(0.0, 1.0, 3)))
    assert DUMPED.search(repr(np.zeros((2, 2))))
    assert not DUMPED.search("float64 (2, 2), 0 to 1")


def test_everything_inside_a_state_shows_a_few_lines() -> None:
    inside = {name: repr(part) for name, part in objects().items() if type(part).__repr__ is in_lines}
    assert {"DualSolution", "TornSystem", "Decomposition", "ContactPoints", "DesignSurface"} <= set(inside)
    assert [name for name, shown in inside.items() if len(shown.splitlines()) > LINES] == []
    assert [name for name, shown in inside.items() if DUMPED.search(shown)] == []


def test_a_printed_state_says_what_was_found_and_what_it_cost() -> None:
    state: AnyState = objects()["LinearState"]
    lines = {line[2:].split("  ")[0].strip(): line for line in str(state).splitlines()}
    counts = [state.contact.count(status) for status in Status]
    assert "{} open, {} stick, {} slip".format(*counts) in lines["contact"]
    assert f"{state.counts['torn_unknowns']} in {state.counts['subdomains']} subdomains" in lines["unknowns"]
    largest = np.linalg.norm(state.contact.force, axis=1).max()
    assert float(lines["largest force"].split()[-1]) == pytest.approx(largest, rel=1e-5)
    assert f"{state.solution.products} products" in lines["work"]
    assert float(lines["strain energy"].split()[-1]) == pytest.approx(state.energies.strain, rel=1e-5)
    assert {"error, algebraic", "error, discretisation", "seconds", "total potential", "residuals"} <= set(
        lines
    )


def test_printing_a_state_estimates_no_errors() -> None:
    state = solve_scene(objects()["Scene"], MPI.COMM_SELF, tolerance=1e-4)
    assert "errors" in str(state)
    assert "call state.estimate_errors()" in str(state)
    assert "errors" not in state.__dict__


def test_many_contact_pairs_are_cut_short() -> None:
    scene = objects()["Scene"]
    pair = scene.contacts[0]
    walls = [replace(pair, master=RigidPlane((0.0, 0.0, -1.0 - k), (0.0, 0.0, 1.0))) for k in range(20)]
    state = solve_scene(replace(scene, contacts=[pair, *walls]), MPI.COMM_SELF, tolerance=1e-4)
    assert len(str(state).splitlines()) <= MOST_PRINTED
    assert "13 further contact pairs" in str(state)


@pytest.mark.parametrize("name", ["Scene", "BodyMesh", "LinearState", "Result"])
def test_notebooks_show_a_small_table(name: str) -> None:
    table = ET.fromstring(objects()[name]._repr_html_())
    rows = {row[0].text: row[1].text for row in table.iter("tr")}
    assert table[0].text == name
    assert 5 <= len(rows) <= MOST_PRINTED
    assert all(not DUMPED.search(text or "") for text in rows.values())


TABLES = (
    "AccurateResult",
    "Balance",
    "ConstraintForces",
    "PairResultants",
    "Preloads",
    "Resultants",
    "StateErrors",
)


@pytest.mark.parametrize("name", TABLES)
def test_tables_are_the_same_printed_at_a_prompt_and_in_notebooks(name: str) -> None:
    shown = objects()[name]
    page = ET.fromstring(f"<div>{shown._repr_html_()}</div>")
    printed = str(shown).splitlines()
    cells = [" ".join(cell.text or "" for cell in row).split() for row in page.iter("tr")]
    assert len(cells) > 1
    assert all(words in [line.split() for line in printed] for words in cells)
    captions = [caption.text or "" for caption in page.iter("caption")]
    notes = [note for caption in captions for note in caption.split("; ")[1:]]
    assert len(cells) + len(notes) == len(printed)
    assert repr(shown).splitlines()[:5] == printed[:5]


def test_a_long_table_is_cut_at_a_prompt() -> None:
    @tabled
    @dataclass(frozen=True)
    class Long:
        rows: int

        def _tables(self) -> list[Table]:
            return [Table([("", "number"), *((f"<{k}>", str(k)) for k in range(self.rows))], 1)]

    assert len(str(Long(40)).splitlines()) == 41
    assert len(repr(Long(40)).splitlines()) == LINES
    assert repr(Long(40)).endswith("… 32 more lines: print it")
    assert repr(Long(3)) == "     number\n<0>       0\n<1>       1\n<2>       2"
    assert "&lt;0&gt;" in Long(3)._repr_html_()  # type: ignore[attr-defined]


def test_a_pair_is_a_table_of_what_is_given_with_the_reason_of_its_discretisation() -> None:
    pair = objects()["Scene"].contacts[0]
    page = ET.fromstring(pair._repr_html_())
    rows = {row[0].text: row[1].text for row in page.iter("tr")}
    assert {"slave", "master", "discretisation", "geometry"} <= rows.keys()
    assert "adjust" not in rows
    assert rows["discretisation"] == (pair.reason or pair.discretisation)


def test_the_pairs_of_a_scene_are_a_table() -> None:
    pairs = objects()["Scene"].contacts
    head, first, *_ = str(pairs).splitlines()
    assert head.split() == ["surfaces", "friction", "discretisation"]
    assert first.startswith(f"contact 0  {pairs[0].place}")
    assert pairs[0].reason in first
    assert len(ET.fromstring(pairs._repr_html_()).findall("tr")) == 1 + len(pairs)
    assert pairs == tuple(pairs)


def test_a_table_escapes_the_names_that_users_choose() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    named: Any = BodyMesh(mesh.points, mesh.cells, {"<b>&": mesh.surfaces["z0"]})
    assert "&lt;b&gt;&amp; (1)" in named._repr_html_()


def test_unusual_values_are_shown() -> None:
    @displayed
    @dataclass(frozen=True)
    class Odd:
        empty: np.ndarray
        unknown: np.ndarray
        marks: np.ndarray
        some: np.ndarray
        many: tuple[float, ...]
        hidden: int = field(default=0, repr=False)

    odd = Odd(np.zeros((0, 3)), np.full(2, np.nan), np.eye(2) > 0, np.array([1.0, np.nan]), (1.0,) * 9)
    assert [line.split("  ", 2)[2].strip() for line in repr(odd).splitlines()[1:]] == [
        "float64 (0, 3)", "float64 (2,), nan to nan, 2 nan", "bool (2, 2), 2 true",
        "float64 (2,), 1 to 1, 1 nan", "9 × float",
    ]  # fmt: skip
