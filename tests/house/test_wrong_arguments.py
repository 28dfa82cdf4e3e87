"""Arguments of another kind than a function takes are named, with what they are and what is needed."""

from __future__ import annotations

import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fenics_contact
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    gallery,
    materials,
    pictures,
    solve_scene,
    solve_steps,
)
from fenics_contact._base.checks import naming_arguments
from fenics_contact.errors import InvalidInputError
from tests.house.public import public

STEEL = materials.IsotropicElasticity(2.1e5, 0.3)
BLOCK = gallery.block((0, 0, 0), (1, 1, 1), (1, 1, 1))
FLOOR = RigidPlane((0, 0, 0), (0, 0, 1))
SCENE = Scene(
    bodies={"block": Body(BLOCK, STEEL)},
    supports=[Support("block", "z1")],
    contacts=[ContactPair(Surface("block", "z0"), FLOOR)],
)
STEP = LoadStep("press", loads=[Traction("block", "x1", (1.0, 0.0, 0.0))])
#: numpy and the libraries of meshes name what they need themselves.
OF_OTHERS = {"minimize", "design.nearest_feasible", "readers.from_dolfinx", "readers.from_meshio"}
#: Rooms whose functions take scenes, states, designs and files; those of others take arrays.
ROOMS = {"decks", "design", "output", "pictures", "readers", "results", "study"}


def functions() -> list[Any]:
    """Return the public functions that need arguments without keywords."""
    found = []
    for name, each in public().items():
        room = name.rpartition(".")[0]
        if inspect.isfunction(each) and room in {"", *ROOMS} and name not in OF_OTHERS:
            needed = [it for it in inspect.signature(each).parameters.values() if it.default is it.empty]
            if needed and all(it.kind is it.POSITIONAL_OR_KEYWORD for it in needed):
                found.append(pytest.param(each, [it.name for it in needed], id=name))
    return found


@pytest.mark.parametrize(("function", "names"), functions())
@pytest.mark.parametrize("given", [SCENE, STEP, None], ids=["scene", "step", "none"])
def test_no_public_function_lets_an_attribute_fail(function: Any, names: list[str], given: object) -> None:
    arguments = [MPI.COMM_SELF if name == "comm" else given for name in names]
    raised: Exception | None = None
    try:
        function(*arguments)
    except Exception as error:
        raised = error
    assert not isinstance(raised, AttributeError | TypeError)


def test_most_public_functions_are_tried() -> None:
    assert len(functions()) > 40
    assert {name for name in public() if name in OF_OTHERS} == OF_OTHERS


@pytest.mark.parametrize("given", [STEP, ContactProblem(SCENE, MPI.COMM_SELF), None, "scene.toml"])
def test_what_is_solved_must_be_a_scene(given: object) -> None:
    words = rf"must be a Scene, got (a {type(given).__name__}|None): load steps are solved by solve_steps\("
    with pytest.raises(InvalidInputError, match=words):
        solve_scene(given, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=words):
        ContactProblem(given, MPI.COMM_SELF)


def test_load_steps_of_a_scene_are_those_of_its_problem() -> None:
    (state,) = solve_steps(SCENE, [STEP], MPI.COMM_SELF)
    (other,) = solve_steps(ContactProblem(SCENE, MPI.COMM_SELF), [STEP])
    assert state.energies.strain == other.energies.strain > 0.0


@pytest.mark.parametrize(
    ("problem", "comm", "words"),
    [
        (SCENE, None, r"of a scene needs a communicator, got None"),
        (
            ContactProblem(SCENE, MPI.COMM_SELF),
            MPI.COMM_WORLD.Dup(),
            "its own communicator, got another",
        ),
        (STEP, None, "problem must be a ContactProblem or a Scene, got a LoadStep: bodies, contact pairs"),
    ],
)
def test_load_steps_need_a_scene_and_a_communicator_or_a_problem(
    problem: object, comm: MPI.Comm | None, words: str
) -> None:
    with pytest.raises(InvalidInputError, match=words):
        solve_steps(problem, [STEP], comm)


def test_pictures_of_designs_name_what_they_take() -> None:
    problem = ContactProblem(SCENE, MPI.COMM_SELF)
    words = "first must be a State or a DesignPoint, got a ContactProblem: state before, or the design"
    with pytest.raises(InvalidInputError, match=words):
        pictures.plot_before_after(problem, problem)
    words = "problem must be a ShapeProblem or a JointProblem, got a ContactProblem: the problem with"
    with pytest.raises(InvalidInputError, match=words):
        pictures.plot_control_net(problem, np.zeros(3))


@pytest.mark.parametrize("kind", [materials.IsotropicElasticity, {"all": materials.J2Plasticity}])
def test_the_class_of_a_material_is_no_material(kind: Any) -> None:
    mesh = replace(BLOCK, regions={"all": np.arange(1)})
    words = r"got the class (\w+): write \1\(young_modulus, poisson_ratio(, yield_stress)?\)"
    with pytest.raises(InvalidInputError, match=words):
        Body(mesh, kind)


def test_the_class_of_an_obstacle_is_no_obstacle() -> None:
    with pytest.raises(InvalidInputError, match=r"got the class RigidPlane: write it with where it lies"):
        ContactPair(Surface("block", "z0"), RigidPlane)


def test_errors_of_calls_with_fitting_arguments_stay_as_they_are() -> None:
    @naming_arguments
    def fails(number: float, *, name: str = "") -> float:
        raise AttributeError("own")

    with pytest.raises(AttributeError, match="own"):
        fails(1.0, name="x")
    with pytest.raises(InvalidInputError, match=r"fails: name must be a string, got an int$"):
        fails(1.0, name=3)
    with pytest.raises(TypeError, match="missing 1 required"):
        fails()  # type: ignore[call-arg]
    assert fenics_contact.solve_steps.__name__ == "solve_steps"
