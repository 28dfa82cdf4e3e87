"""Results in files: their record, provenance and what is written as JSON."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache, partial
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    DistanceObstacle,
    Pressure,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    Tie,
    Tresca,
    Ufl,
    _dolfinx,
    minimize,
    solve_scene,
    write_result,
)
from fenics_contact._optimize.result import StepKind
from fenics_contact.design import BundleTrust, Result
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.output import read_result, versions, write_json, write_optimisation_result
from fenics_contact.output import result as provenance
from fenics_contact.output.files import plain
from fenics_contact.output.result import described_scene, readable
from fenics_contact.results import BalancedTolerance
from tests.design.load_cases_on_ranks import cases_of
from tests.design.resumed_cases import minimised, posed
from tests.feti.rigid_cases import POINT, SCENES, solved
from tests.output.states import touching_blocks


def test_a_state_is_told_with_its_scene_and_its_numbers(tmp_path: Path) -> None:
    state = touching_blocks()
    path = write_result(state, tmp_path / "new", more={"drop": np.float64(3.5)})
    assert path == tmp_path / "new" / "result.json"
    found = read_result(path)
    assert (found["format"], found["format_version"], found["kind"]) == ("fenics_contact result", 1, "state")
    assert found["ranks"] == 1
    assert found["written"].endswith("+00:00")
    assert found["versions"]["numpy"] == np.__version__
    assert "N/mm²" in found["units"]
    upper = found["scene"]["bodies"]["upper block"]
    mesh = state.scene.bodies["upper block"].mesh
    assert (upper["cells"], upper["nodes"], upper["subdomains"]) == (mesh.n_cells, mesh.n_nodes, 2)
    assert upper["material"]["type"] == "IsotropicElasticity"
    assert upper["material"]["young_modulus"] == 100.0
    (pair,) = found["scene"]["contacts"]
    assert pair["slave"] == {"body": "upper block", "surface": "z0"}
    assert pair["friction"] == {
        "type": "Coulomb", "friction_coefficient": 0.4, "shear_limit": None, "stick_stiffness": None,
    }  # fmt: skip
    assert [load["type"] for load in found["scene"]["loads"]] == ["Traction", "BodyForce"]
    assert found["plan"]["effects"]["Coulomb friction"].startswith("1 pair")
    assert found["counts"] == state.counts
    assert found["more"] == {"drop": 3.5}


def test_energies_residuals_and_contact_are_the_states(tmp_path: Path) -> None:
    state = touching_blocks()
    found = read_result(write_result(state, tmp_path))
    assert found["energies"]["total_potential"] == state.energies.total_potential != 0.0
    assert found["residuals"]["gluing"] == state.solution.gluing_residual > 0.0
    assert found["residuals"]["equilibrium"] == state.solution.coarse_residual
    history = found["residual_history"]
    assert history["natural"] == [step.residuals.natural for step in state.solution.history]
    assert history["products"][-1] == state.solution.history[-1].products > 0
    assert {len(column) for column in history.values()} == {len(state.solution.history)}
    assert found["solver"]["tolerance"] == 1e-6
    assert found["solver"]["methods"] == ["face Newton"]
    assert sum(found["seconds"].values()) > 0.0
    assert found["costs"]["solve"]["flops"] == state.costs.solve.flops > 0
    (pair,) = found["contact"]
    assert [pair[status.name.lower()] for status in Status] == [state.contact.count(s) for s in Status]
    assert pair["peak_pressure"] == state.contact.pressure.max() > 0.0
    np.testing.assert_allclose(pair["force"], state.contact.force.sum(axis=0))
    assert pair["force"][2] == pytest.approx(pair["normal_force"])
    assert pair["normal_resultant"] == pytest.approx(pair["normal_force"])
    assert pair["largest_slip"] > 0.0


def test_motions_of_rigid_surfaces_are_the_states(tmp_path: Path) -> None:
    state = solved(SCENES["loaded"](), MPI.COMM_SELF)
    ((motion,), (found,)) = read_result(write_result(state, tmp_path))["rigid_motions"], state.rigid_motions()
    assert (motion["body"], motion["surface"], motion["about"]) == ("bar", "x1", list(POINT))
    np.testing.assert_array_equal(motion["displacement"], found.displacement)
    np.testing.assert_array_equal(motion["rotation"], found.rotation)
    assert np.abs(motion["rotation"]).max() > 0.01


def test_forces_and_moments_are_the_states_and_in_balance(tmp_path: Path) -> None:
    state = touching_blocks()
    forces = read_result(write_result(state, tmp_path))["forces"]
    assert len(forces["reactions"]) == len(state.scene.supports) > 0
    for told, support, reaction in zip(
        forces["reactions"], state.scene.supports, state.reactions(), strict=True
    ):
        assert (told["body"], told["surface"]) == (support.body, support.surface)
        for name in ("force", "moment", "about"):
            np.testing.assert_array_equal(told[name], getattr(reaction, name))
    (pair,) = forces["contacts"]
    np.testing.assert_allclose(pair["force"], state.contact.force.sum(axis=0))
    assert forces["ties"] == []
    assert forces["balance"]["imbalance"] == state.balance().imbalance <= 1e-9
    np.testing.assert_array_equal(forces["balance"]["loads"]["force"], state.balance().loads.force)


def test_errors_are_told_where_they_are_known_or_asked_for(tmp_path: Path) -> None:
    scene = Scene({"block": Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), IsotropicElasticity(1e3, 0.3))},
                  [Support("block", "x0")], [Pressure("block", "z1", 1.0)])  # fmt: skip
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    assert read_result(write_result(state, tmp_path))["errors"] is None
    asked = read_result(write_result(state, tmp_path, errors=True))["errors"]
    assert asked["discretisation"] == state.estimate_errors().discretisation > 0.0
    assert read_result(write_result(state, tmp_path))["errors"] == asked, "now they are known"
    direct = read_result(tmp_path)
    assert direct["solver"]["kind"] == "sparse factorisation of one body"
    assert direct["contact"] == []
    parts = {"block": np.arange(16) // 8}
    balanced = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=BalancedTolerance(share=0.05))
    found = read_result(write_result(balanced, tmp_path))
    assert found["errors"]["by_body"]["block"] > 0.0
    assert found["solver"]["tolerance"]["share"] == 0.05


@dataclass(frozen=True)
class Wall:
    """A distance with a number in it."""

    place: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return points[:, 2] - self.place


def deeper(x: np.ndarray) -> np.ndarray:
    return 1.0 - x[:, 2]


def test_functions_are_told_by_their_names_and_regions_by_theirs() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    mesh = replace(mesh, regions={"left": np.array([0]), "right": np.array([1])})
    soft, stiff = IsotropicElasticity(1.0, 0.3), IsotropicElasticity(2.0, 0.3)
    bodies = {"a": Body(mesh, {"left": soft, "right": stiff}), "b": Body(mesh, soft)}
    scene = Scene(
        bodies,
        [Support("a", "x0", (None, deeper, 0.0))],
        [Pressure("a", "z1", deeper), Pressure("b", "z1", Ufl(deeper))],
        [ContactPair(Surface("a", "z0"), DistanceObstacle(Wall(-0.5)), Tresca(2.0))],
        [Tie(Surface("a", "x1"), Surface("b", "x1"), sliding=True)],
    )
    found = described_scene(scene, {"a": 1, "b": 3})
    json.dumps(found, allow_nan=False)
    assert found["bodies"]["a"]["material"]["regions"]["right"]["young_modulus"] == 2.0
    assert found["bodies"]["b"]["subdomains"] == 3
    assert found["supports"][0]["value"] == [None, {"function": "deeper"}, 0.0]
    assert found["loads"][0]["value"] == {"function": "deeper"}
    assert found["loads"][1]["value"] == {"type": "Ufl", "function": {"function": "deeper"}}
    assert found["contacts"][0]["master"]["function"] == {"type": "Wall", "place": -0.5}
    assert found["contacts"][0]["friction"] == {"type": "Tresca", "traction": 2.0, "stick_stiffness": None}
    assert found["ties"][0]["sliding"] is True


def test_anything_is_readable() -> None:
    assert readable(np.float64("nan")) is None
    assert readable({1: (np.int64(2), StepKind.NULL)}) == {"1": [2, "null"]}
    assert readable(partial(deeper)) == {"function": "deeper"}
    assert readable(object()) == {"type": "object"}


@lru_cache(maxsize=1)
def a_minimisation() -> tuple[Result, ShapeProblem]:
    problem = posed("block", MPI.COMM_SELF, 1e-6)
    result = minimised("block", problem, None, max_evaluations=5, raise_on_failure=False)
    assert result.value < result.history[0].value, "the objective falls"
    return result, problem


def test_an_optimisation_is_told_with_its_history_and_design(tmp_path: Path) -> None:
    result, problem = a_minimisation()
    found = read_result(write_optimisation_result(result, problem, tmp_path, name="run", more={"a": [1]}))
    assert (tmp_path / "run.json").exists()
    assert found["kind"] == "optimisation"
    told = found["optimisation"]
    assert told["objective"]["type"] == "ContactForces"
    assert told["objective"]["definition"] == "ContactForces(function=<function normal_forces>)"
    assert told["objective"]["final"] == result.value
    assert told["objective"]["drop_percent"] > 0.0
    assert told["design"]["values"] == result.x.tolist()
    assert told["design"]["variables"] == problem.size
    assert told["stop"]["converged"] is False
    assert told["stop"]["reason"].startswith("max_evaluations evaluations were spent")
    assert told["stop"]["evaluations"] == len(told["history"]["value"]) == 5
    assert told["history"]["kind"] == [record.kind.value for record in result.history]
    assert found["counts"]["f_products"] == problem.products > 0
    assert found["seconds"]["adjoint"] > 0.0
    assert found["more"] == {"a": [1]}


def test_an_optimisation_of_load_cases_has_the_objective_of_each(tmp_path: Path) -> None:
    both = cases_of(MPI.COMM_SELF, None)
    short = BundleTrust(max_evaluations=4, raise_on_failure=False)
    result = minimize(both, np.zeros(both.size), short, bounds=(-0.004, 0.004))
    found = read_result(write_optimisation_result(result, both, tmp_path))
    told = found["optimisation"]
    assert told["objective"]["type"] == "LoadCases"
    assert all(name in told["objective"]["definition"] for name in both.problems)
    assert told["objective"]["final"] == result.value < told["objective"]["initial"]
    assert found["counts"]["f_products"] == both.products > 0


def test_an_optimisation_that_did_not_happen_is_refused(tmp_path: Path) -> None:
    result, _ = a_minimisation()
    with pytest.raises(InvalidInputError, match="needs designs that were evaluated, the problem has none"):
        write_optimisation_result(result, posed("block", MPI.COMM_SELF, 1e-6), tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, r"cannot be read: No such file or directory"),
        ("{\"format\": \"fenics", r"must be a whole JSON file, .* is not one .*it was cut or edited"),
        ("", r"must be a whole JSON file"),
        ("[1, 2]", r"must have \"format\": 'fenics_contact result', .* has None: give one of write_result"),
        ("{\"format\": \"other\"}", r"has 'other'"),
        ("{\"format\": \"fenics_contact result\"}", r"format_version of 1 or more, .* has None"),
        (
            "{\"format\": \"fenics_contact result\", \"format_version\": 2}",
            r"reads results up to format_version 1, .* has 2: read it with a newer version",
        ),
    ],
)  # fmt: skip
def test_what_is_no_result_is_refused(content: str | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InvalidInputError, match=message):
        read_result(path)
    with pytest.raises(InvalidInputError, match=message):
        read_result(tmp_path)


def test_a_result_cut_anywhere_is_refused(tmp_path: Path) -> None:
    path = write_result(touching_blocks(), tmp_path)
    content = path.read_bytes()
    for length in np.linspace(1, len(content) - 3, 40).astype(int):
        path.write_bytes(content[:length])
        with pytest.raises(InvalidInputError, match="whole JSON file"):
            read_result(path)


@pytest.mark.parametrize("more", [{"a": float("nan")}, {"a": object()}])
def test_what_json_does_not_know_is_refused_and_the_old_file_stays(
    more: dict[str, Any], tmp_path: Path
) -> None:
    path = write_result(touching_blocks(), tmp_path)
    before = path.read_bytes()
    with pytest.raises(InvalidInputError, match=r"data\['more'\]\['a'\] must be"):
        write_result(touching_blocks(), tmp_path, more=more)
    assert path.read_bytes() == before


def test_a_name_with_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="name must be the beginning of a file's name, got 'a/b'"):
        write_result(touching_blocks(), tmp_path, name="a/b")


RANKS = """
    import sys
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact.errors import InvalidInputError
    from fenics_contact import write_result
    from fenics_contact.output import read_result
    from tests.scenes import partitions
    from tests.output.states import blocks

    comm, scene = MPI.COMM_WORLD, blocks()
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    write_result(state, sys.argv[1], errors=True)
    try:
        write_result(state, sys.argv[1], name="nan", more={"a": float("nan")})
    except InvalidInputError:
        caught = comm.allreduce(1)
        if comm.rank == 0:
            print(caught)
"""


def test_two_ranks_write_one_file_with_the_same_answer(mpirun: Callable[..., str], tmp_path: Path) -> None:
    assert mpirun(RANKS, 2, tmp_path).strip() == "2"
    found = read_result(tmp_path / "result.json")
    alone = read_result(write_result(touching_blocks(), tmp_path, name="alone", errors=True))
    assert found["ranks"] == 2
    for key in ("scene", "plan"):
        assert found[key] == alone[key]
    assert found["energies"]["strain"] == pytest.approx(alone["energies"]["strain"], rel=1e-5)
    assert found["errors"]["discretisation"] == pytest.approx(alone["errors"]["discretisation"], rel=1e-3)
    assert [found["contact"][0][key] for key in ("open", "stick", "slip")] == [
        alone["contact"][0][key] for key in ("open", "stick", "slip")
    ]
    assert sorted(path.name for path in tmp_path.glob("*.json")) == ["alone.json", "result.json"]


# A result can say what it was computed with.
def test_versions_name_everything_that_computed(tmp_path: object) -> None:
    found = versions()
    assert set(found) >= {
        "python", "numpy", "scipy", "dolfinx", "petsc", "mpi", "gmsh", "pyvista", "fenics_contact"
    }  # fmt: skip
    assert found["numpy"] == np.__version__
    assert found["dolfinx"] == _dolfinx.release()
    assert found["petsc"].startswith("3.")
    assert "MPI" in found["mpi"]
    write_json(f"{tmp_path}/versions.json", found)


def test_the_version_of_mpi_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "MPICH Version:      5.0.2\nMPICH Release date: Fri Sep 25 20:45:26 UTC 2026\n\x00"
    monkeypatch.setattr(provenance, "MPI", SimpleNamespace(Get_library_version=lambda: text))
    assert versions()["mpi"] == "MPICH Version: 5.0.2"


def test_a_library_that_is_not_there_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", nothing)
    found = versions()
    assert found["numpy"] == np.__version__, "where there are no metadata the library itself is asked"
    monkeypatch.setattr(provenance, "_MODULES", ("no_such_library",))
    assert versions()["no_such_library"] == "not installed"


def test_a_library_that_takes_ctrl_c_at_its_import_gives_it_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As gmsh does, which Debian installs without metadata."""
    (tmp_path / "takes_it.py").write_text(
        "import signal\n__version__ = '4.8'\nsignal.signal(signal.SIGINT, signal.SIG_DFL)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(provenance, "_MODULES", ("takes_it",))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert versions()["takes_it"] == "4.8"
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


# JSON files hold what they were given, or there is an error that says where it could not be held.
class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Energies:
    strain: float
    parts: np.ndarray


def test_types_of_numpy_and_python_are_converted(tmp_path: Path) -> None:
    data = {
        "float": np.float64(1.5),
        "int": np.int32(3),
        "truth": np.bool_(True),
        "array": np.arange(4).reshape(2, 2),
        "tuple": (1, None, "ä"),
        "path": Path("a/b"),
        "enumeration": Colour.RED,
        "dataclass": Energies(2.0, np.zeros(1)),
    }
    path = write_json(tmp_path / "new" / "result.json", data)
    assert json.loads(path.read_text()) == {
        "float": 1.5,
        "int": 3,
        "truth": True,
        "array": [[0, 1], [2, 3]],
        "tuple": [1, None, "ä"],
        "path": "a/b",
        "enumeration": "red",
        "dataclass": {"strain": 2.0, "parts": [0.0]},
    }
    assert list(json.loads(path.read_text())) == list(data), "the order of the keys is kept"


json_data = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=20,
)


@given(json_data)
def test_what_json_knows_stays_as_it_is(data: Any) -> None:
    assert json.loads(json.dumps(plain(data), allow_nan=False)) == data


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"a": [1.0, float("nan")]}, "data['a'][1] must be finite, got nan"),
        ({"a": np.array([np.inf])}, "data['a'][0] must be finite, got inf"),
        (Energies(-np.inf, np.zeros(0)), "data.strain must be finite, got -inf"),
        ({"a": {1: 2}}, "keys of data['a'] must be strings, got 1"),
        ({"a": object()}, "data['a'] must be a mapping, sequence"),
        ({"a": b"bytes"}, "got bytes"),
        ({"a": 1j}, "got complex"),
    ],
)
def test_what_json_does_not_know_is_refused_by_its_place(data: Any, message: str, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        write_json(path, data)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
