"""The example scene files have the states that the same scenes have in Python, on one rank and on two."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.design import LinearConstraints, NonlinearConstraint
from tests.conftest import ROOT
from tests.scene_file.compared import compare_states, two_blocks

SCRIPT = Path(__file__).with_name("compared.py")
SCENES = ROOT / "demos" / "scenes"


def test_two_blocks_are_those_of_python() -> None:
    assert compare_states("two_blocks", two_blocks, MPI.COMM_SELF) == 1


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("name", "count"), [("two_blocks", 1), ("sheared_block", 10), ("hertz", 1), ("chain_links", 3)]
)
def test_an_example_is_that_of_python(name: str, count: int, ranks: int, mpirun: Callable[..., str]) -> None:
    assert mpirun(SCRIPT, ranks, name, timeout=300.0) == f"same {count}\n"


def test_a_side_of_a_block_can_be_designed() -> None:
    design = {
        "surfaces": [{"body": "upper", "surface": "z0", "net": [2, 2], "lower": -0.01, "upper": 0.01}],
        "constraints": [
            {"kind": "volume", "at_least": 0.99, "at_most": 1.5},
            {"kind": "linear", "coefficients": [1, 1, 1, 1], "at_most": 0.01},
        ],
    }
    data = read_scene_file(SCENES / "two_blocks.toml", MPI.COMM_SELF).source.data
    task = read_scene_file({**data, "design": design}, MPI.COMM_SELF).shape_task()
    assert task.problem.size == 4
    moved = task.problem.points_of(np.full(4, 0.01))["upper"]
    bottom = task.problem.designs[0].surface.nodes
    np.testing.assert_allclose(moved[bottom, 2], 1.0 - 0.01, atol=1e-12)  # added material: downwards
    linear, volume = task.constraints
    assert isinstance(linear, LinearConstraints)
    np.testing.assert_allclose(linear.matrix, np.ones((1, 4)))
    np.testing.assert_allclose(linear.limit, [0.01])
    assert isinstance(volume, NonlinearConstraint)
    assert (volume.lower, volume.upper) == pytest.approx((0.99 * 4.0, 1.5 * 4.0))
    found, gradient = volume.fun(np.full(4, 0.01))
    assert found == pytest.approx(4.0 + 0.01 * gradient.sum())
    assert gradient.sum() == pytest.approx(4.0)  # the area of the side


def plane_scene(**change: object) -> dict[str, object]:
    """Two rectangles of which the lower edge of the upper one is a design."""
    surface = {"body": "upper", "surface": "y0", "net": 5, "lower": -0.05, "upper": 0.05, **change}
    return {
        "meshes": {
            "upper": {"shape": "rectangle", "lower": [0.5, 0.0], "upper": [2.5, 1.0], "counts": [8, 4]},
            "lower": {"shape": "rectangle", "lower": [0.0, -1.0], "upper": [3.0, 0.0], "counts": [9, 3]},
        },
        "materials": {"rubber": {"model": "plane_strain", "young_modulus": 100.0, "poisson_ratio": 0.3}},
        "bodies": {name: {"mesh": name, "material": "rubber"} for name in ("upper", "lower")},
        "supports": [{"body": "lower", "surface": "y0"}],
        "loads": [{"kind": "traction", "body": "upper", "surface": "y1", "value": [0.0, -1.0]}],
        "contacts": [
            {
                "slave": {"body": "upper", "surface": "y0"},
                "master": {"body": "lower", "surface": "y1"},
                "friction": {"law": "coulomb", "coefficient": 0.3},
            }
        ],
        "design": {"surfaces": [surface], "max_iterations": 2},
    }


def test_a_curve_of_a_plane_body_can_be_designed() -> None:
    task = read_scene_file(plane_scene(), MPI.COMM_SELF).shape_task()
    assert task.problem.size == 5
    moved = task.problem.points_of(np.full(5, 0.02))["upper"]
    bottom = task.problem.designs[0].lattice.nodes
    np.testing.assert_allclose(moved[bottom, 1], -0.02, atol=1e-12)
    start, gradient = task.problem(task.start)
    assert np.abs(gradient).max() > 0.0
    assert task.minimize().value < start


@pytest.mark.parametrize("net", [0.5, "five", [2, 2, 2]])
def test_a_net_is_a_number_or_a_pair(net: object) -> None:
    with pytest.raises(
        SceneFileError, match=r"net must be an integer from 1 to .* for a curve, or two in bra"
    ):
        read_scene_file(plane_scene(net=net), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"surface": "z7"}, "body 'upper': a design needs a surface whose .* grid"),
        ({"net": [9, 9]}, "a net \\(9, 9\\) needs as many nodes each way"),
        ({"body": "uper"}, 'design.surfaces.0.body must be a body, one of .*, got "uper"'),
    ],
)
def test_a_design_that_cannot_be_is_named(change: dict[str, object], message: str) -> None:
    surface = {"body": "upper", "surface": "z0", "net": [2, 2], "lower": -0.01, "upper": 0.01, **change}
    data = read_scene_file(SCENES / "two_blocks.toml", MPI.COMM_SELF).source.data
    with pytest.raises(SceneFileError, match=message):
        read_scene_file({**data, "design": {"surfaces": [surface]}}, MPI.COMM_SELF).shape_task()


def test_a_file_without_a_design_cannot_be_optimised() -> None:
    with pytest.raises(SceneFileError, match=r"two_blocks.toml: an optimisation needs \[design\] with"):
        read_scene_file(SCENES / "two_blocks.toml", MPI.COMM_SELF).shape_task()
