"""What a scene does not call for is not built, not compiled, not called and not imported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    Scene,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact._equilibrium import static_admissibility
from fenics_contact._pairing import masters
from fenics_contact._pairing.mortar import points as mortar
from fenics_contact.feti import TornSystem, dual
from fenics_contact.feti import torn as initial_gap
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import cones as slip_law
from fenics_contact.qp import face_newton, face_system
from fenics_contact.results.deformed_state import AnyState
from tests.conftest import launch

#: Parts of the package that only some effects need: where they are looked up, and under which name.
PARTS: dict[str, tuple[Any, str]] = {
    "multipliers": (dual.DualSystem, "__init__"),
    "coarse problem": (dual, "CoarseSpace"),
    "preconditioner": (dual, "DirichletPreconditioner"),
    "faces": (face_newton.FaceNewton, "run"),
    "search for contact": (initial_gap, "find_contact_points"),
    "check of overlap": (initial_gap, "check_no_penetration"),
    "search for ties": (initial_gap, "find_tied_points"),
    "projection on facets": (masters, "_by_projection"),
    "mortar": (mortar, "mortar_coupling"),
    "balance of floating bodies": (static_admissibility, "_check_balance"),
    "slip bounds that follow": (slip_law.CoulombLaw, "bound"),
    "friction that grows in a step": (face_system.CoupledSystem, "__init__"),
    "slip of earlier steps": (TornSystem, "with_slip_from"),
}
LINEAR = {"multipliers", "coarse problem", "preconditioner", "faces"}
CONTACT = LINEAR | {"search for contact", "check of overlap"}
FACES = Surface("upper", "z0"), Surface("lower", "z1")
STEEL = IsotropicElasticity(1000.0, 0.3, thermal_expansion=1e-3)
DOWN, WEIGHT, HOT = (
    Traction("upper", "z1", (0.1, 0.0, -5.0)),
    BodyForce("upper", (0.0, 0.0, -1.0)),
    ThermalStrain("upper", 1.0),
)


def tower(*, held: bool, **parts: Any) -> Scene:
    """Two blocks; the lower one is clamped, the upper one held aside or in all directions."""
    bodies = {
        "lower": Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), STEEL),
        "upper": Body(block((0.1, 0.1, 1), (1.9, 0.9, 2), (4, 2, 2)), STEEL),
    }
    sides = [Support("upper", "x0")] if held else []
    return Scene(bodies, [Support("lower", "z0"), *sides], **parts)


def alone(**parts: Any) -> Scene:
    """One block that supports hold."""
    return Scene(
        {"upper": Body(block((0, 0, 1), (2, 1, 2), (4, 2, 2)), STEEL)}, [Support("upper", "z0")], **parts
    )


@dataclass(frozen=True)
class Case:
    """A scene with what it must use.

    Attributes:
        scene: The scene.
        parts: Names of the `PARTS` that it must call; it may call no others.
        forms: Kinds of forms that it must compile beside the stiffness, and no others.
        boxes: Subdomains of each body.
    """

    scene: Scene
    parts: set[str] = field(default_factory=set)
    forms: set[str] = field(default_factory=set)
    boxes: tuple[int, int, int] = (2, 1, 1)


WHOLE = (1, 1, 1)
CASES = {
    "supports alone": Case(alone(), boxes=WHOLE),
    "body force": Case(alone(loads=[WEIGHT]), forms={"body force"}, boxes=WHOLE),
    "surface load": Case(alone(loads=[DOWN]), forms={"surface load"}, boxes=WHOLE),
    "thermal strain": Case(alone(loads=[HOT]), forms={"thermal strain"}, boxes=WHOLE),
    "several subdomains": Case(alone(loads=[DOWN]), LINEAR, {"surface load"}),
    "a tie": Case(
        tower(held=True, loads=[DOWN], ties=[Tie(*FACES)]),
        LINEAR | {"search for ties", "mortar"}, {"surface load"},
    ),
    "a tie node by node": Case(
        tower(held=True, loads=[DOWN], ties=[Tie(*FACES, discretisation="node")]),
        LINEAR | {"search for ties", "projection on facets"}, {"surface load"},
    ),
    "contact": Case(
        tower(held=True, loads=[DOWN], contacts=[ContactPair(*FACES, discretisation="node")]),
        CONTACT | {"projection on facets"}, {"surface load"},
    ),
    "mortar contact": Case(
        tower(held=True, loads=[DOWN], contacts=[ContactPair(*FACES, discretisation="mortar")]),
        CONTACT | {"mortar"}, {"surface load"},
    ),
    "friction of zero": Case(
        tower(held=True, loads=[DOWN], contacts=[ContactPair(*FACES, Coulomb(0.0), discretisation="node")]),
        CONTACT | {"projection on facets"}, {"surface load"},
    ),
    "Tresca": Case(
        tower(held=True, loads=[DOWN], contacts=[ContactPair(*FACES, Tresca(0.1), discretisation="node")]),
        CONTACT | {"projection on facets"}, {"surface load"},
    ),
    "Coulomb": Case(
        tower(held=True, loads=[DOWN], contacts=[ContactPair(*FACES, Coulomb(0.05), discretisation="node")]),
        CONTACT | {"projection on facets", "slip bounds that follow", "friction that grows in a step"},
        {"surface load"},
    ),
    "a floating body": Case(
        tower(held=False, loads=[DOWN], contacts=[ContactPair(*FACES, Tresca(10.0), discretisation="node")]),
        CONTACT | {"projection on facets", "balance of floating bodies"}, {"surface load"},
    ),
    "everything": Case(
        tower(held=True, loads=[DOWN, WEIGHT, HOT], contacts=[ContactPair(*FACES, Coulomb(0.05), "mortar")]),
        CONTACT | {"mortar", "slip bounds that follow", "friction that grows in a step"},
        {"surface load", "body force", "thermal strain"},
    ),
}  # fmt: skip


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count how often each of the `PARTS` is called."""
    counted: Counter[str] = Counter()

    def watched(part: str, whole: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **more: Any) -> Any:
            counted[part] += 1
            return whole(*arguments, **more)

        return call

    for part, (owner, name) in PARTS.items():
        monkeypatch.setattr(owner, name, watched(part, getattr(owner, name)))
    return counted


def cuts(case: Case) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, case.boxes) for name, body in case.scene.bodies.items()}


def solved(case: Case) -> AnyState:
    """Solve to a fixed tolerance: by default a state also estimates the error of its mesh."""
    return solve_scene(case.scene, MPI.COMM_SELF, partitions=cuts(case), tolerance=tolerance_of(case.scene))


@cache
def state_of(name: str) -> AnyState:
    return solved(CASES[name])


def tolerance_of(scene: Scene) -> float:
    return 1e-6 if scene.contacts else 1e-10


@pytest.mark.parametrize("name", CASES)
def test_only_what_a_scene_calls_for_is_called(name: str, calls: Counter[str]) -> None:
    solved(CASES[name])
    assert set(calls) == CASES[name].parts


def test_every_part_that_is_watched_is_called_by_some_scene() -> None:
    used = set.union(*(case.parts for case in CASES.values()))
    assert used == set(PARTS) - {"slip of earlier steps"}


@pytest.mark.parametrize("name", CASES)
def test_only_forms_that_a_scene_calls_for_are_compiled(name: str) -> None:
    state = state_of(name)
    compiled = [kind for kind, *_ in state.torn.decomposition.forms.compiled]
    assert sorted(compiled) == sorted({"stiffness"} | CASES[name].forms), "each of them once"


@pytest.mark.parametrize("name", CASES)
def test_only_multipliers_that_a_scene_calls_for_exist(name: str) -> None:
    scene, state = CASES[name].scene, state_of(name)
    counts, rubs = state.counts, [pair for pair in scene.contacts if pair.has_friction]
    assert (counts["normal_multipliers"] > 0) == bool(scene.contacts)
    assert (counts["tangential_multipliers"] > 0) == bool(rubs)
    assert state.torn.tangential_rows.shape == (len(state.torn.frictional), 2)
    assert (state.torn.ties.count > 0) == bool(scene.ties)
    assert (state.torn.n_equality > state.torn.n_gluing) == bool(scene.ties)
    assert state.torn.numbering.total == sum(
        counts[f"{kind}_multipliers"] for kind in ("equality", "normal", "tangential")
    )
    assert (state.energies.friction > 0) <= bool(rubs)


def test_the_direct_solve_has_no_coarse_problem_and_no_products() -> None:
    state = state_of("surface load")
    assert state.counts["f_products"] == 0
    assert not hasattr(state.system, "problem")
    assert not hasattr(state.system, "kernel")
    assert np.abs(state.gather_displacement("upper")).max() > 1e-3


@pytest.mark.parametrize("sensitivity", [False, True])
def test_only_sensitivities_put_one_held_body_on_multipliers(sensitivity: bool, calls: Counter[str]) -> None:
    case = CASES["surface load"]
    problem = ContactProblem(case.scene, MPI.COMM_SELF, partitions=cuts(case), tolerance=1e-10)
    state = problem.solve(design=sensitivity)
    assert set(calls) == (LINEAR if sensitivity else set())
    compiled = {kind for kind, *_ in state.torn.decomposition.forms.compiled}
    assert compiled == {"stiffness", "surface load"}, "derivatives by the shape are not compiled for a state"


def test_without_a_load_nothing_moves_and_nothing_is_iterated() -> None:
    for scene in (alone(), tower(held=True, ties=[Tie(*FACES)])):
        state = solved(Case(scene))
        assert np.abs(state.torn_displacement).max() == 0.0
        assert state.counts["f_products"] <= 1, "that of the check of the answer"


def test_fields_on_meshes_are_built_when_they_are_asked_for() -> None:
    state = solved(CASES["surface load"])
    assert not {"displacement", "von_mises"} & set(vars(state))
    assert state.displacement["upper"] is not None
    assert "displacement" in vars(state)
    assert "von_mises" not in vars(state)


def test_a_frictionless_state_has_no_slip_bounds() -> None:
    state = state_of("contact")
    layout = state.dual.problem.layout
    assert layout.tangential.size == 0
    assert layout.normal.size == state.contact.points.count > 0
    assert not state.contact.slip_bound.any()
    assert not state.contact.friction_force.any()


def test_tresca_bounds_stay_what_they_were() -> None:
    contact = state_of("Tresca").contact
    np.testing.assert_allclose(contact.slip_bound, 0.1 * contact.points.area, rtol=1e-14)
    assert contact.normal_force.max() > 0


def test_slip_is_carried_from_the_second_load_step_on_only(calls: Counter[str]) -> None:
    case = CASES["Coulomb"]
    sequence = LoadSequence(ContactProblem(case.scene, MPI.COMM_SELF, partitions=cuts(case), tolerance=1e-6))
    sequence.advance(LoadStep("first"))
    assert "slip of earlier steps" not in calls
    sequence.advance(LoadStep("second"))
    assert calls["slip of earlier steps"] == 1
    assert calls["search for contact"] == 1
    assert calls["preconditioner"] == 1


SCRIPT = """
import sys
from mpi4py import MPI
from fenics_contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact import box_partition
from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, Traction
from fenics_contact.materials import IsotropicElasticity
mesh, steel = block((0, 0, 0), (1, 1, 1), (2, 2, 2)), IsotropicElasticity(1.0, 0.3)
other = block((0, 0, 1), (1, 1, 2), (2, 2, 2))
pair = ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), {law}, "{discretisation}")
scene = Scene(
    {{"lower": Body(mesh, steel), "upper": Body(other, steel)}},
    [Support("lower", "z0"), {support}],
    [Traction("upper", "z1", (0.0, 0.0, -0.1))],
    [pair],
)
cuts = {{name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}}
state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance={tolerance})
assert state.contact.normal_force.sum() > 0.01
print(*sys.modules)
"""
HELD, FLOATING = 'Support("upper", "x0")', 'Support("upper", "x0", (0.0, None, None))'
NEVER = {
    *(f"fenics_contact.{room}" for room in ("design", "_optimize", "pictures", "output", "study")),
    "fenics_contact._large_deformations", "fenics_contact.results.deformed_state",
    "fenics_contact._fem.mechanics", "fenics_contact._fem.kinematics",
    "fenics_contact._pairing.sliding", "pyvista", "matplotlib", "vtk", "vtkmodules", "gmsh",
    "meshio",
}  # fmt: skip
COMPLIANCE, PENETRATION = "fenics_contact.qp.compliance", "fenics_contact._equilibrium.penetration"
AT_NEED = {
    "fenics_contact._pairing.mortar", "fenics_contact._accuracy", "clarabel", COMPLIANCE, PENETRATION,
    "fenics_contact._pairing.sectors", "fenics_contact._surfaces.continued",
}  # fmt: skip


@pytest.mark.parametrize(
    ("law", "discretisation", "support", "tolerance", "needed"),
    [
        ("None", "node", HELD, 1e-6, set()),
        ("None", "node", HELD, None, {"fenics_contact._accuracy"}),
        ("Coulomb(0.3)", "mortar", HELD, 1e-6, {"fenics_contact._pairing.mortar"}),
        ("Coulomb(0.3)", "node", FLOATING, 1e-6, {"clarabel"}),
        ("Coulomb(0.3, stick_stiffness=9.0)", "node", HELD, 1e-6, {COMPLIANCE}),
    ],
)
def test_only_modules_that_a_scene_calls_for_are_imported(
    law: str, discretisation: str, support: str, tolerance: float | None, needed: set[str]
) -> None:
    code = SCRIPT.format(law=law, discretisation=discretisation, support=support, tolerance=tolerance)
    answer = launch(1, "-c", code)
    assert answer.returncode == 0, answer.stderr
    loaded = set(answer.stdout.split())
    assert "fenics_contact._equilibrium.problem" in loaded
    assert loaded & NEVER == set()
    assert loaded & AT_NEED == needed
