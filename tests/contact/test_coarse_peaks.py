"""Contact of round bodies that is only a few points wide is told, with the error of its largest pressure."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from tests.contact.round_bodies import CELL, pressed

PLATE, FLOOR = PlaneStrain(1000.0, 0.3), RigidPlane((0.0, 0.0), (0.0, 1.0))


def told(caplog: pytest.LogCaptureFixture, scene: Scene) -> tuple[list[str], float]:
    """Return what is told of the size of contacts, and the largest pressure; a tenth is a remark alone."""
    caplog.clear()
    with caplog.at_level(logging.INFO):
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    records = [each for each in caplog.records if " is too small for its cells" in each.getMessage()]
    for record in records:
        assert (record.levelno == logging.WARNING) == ("by a half or more" in record.getMessage())
    return [record.getMessage() for record in records], float(state.contact.pressure.max())


@pytest.mark.parametrize("axis", [0.0, 0.5])
@pytest.mark.parametrize("ratio", [None, 1.25])
def test_what_is_told_is_the_error_of_the_peak(
    ratio: float | None, axis: float, caplog: pytest.LogCaptureFixture
) -> None:
    said = list[str]()
    for cells in (0.6, 1.5, 3.0):
        scene, peak = pressed(2, cells, ratio, axis * CELL)
        words, largest = told(caplog, scene)
        said += words or [""]
        off = 0.61 if "by a half or more" in said[-1] else 0.1 if "by a tenth" in said[-1] else 0.03
        assert abs(largest / peak - 1.0) < off
    assert "by a half or more" in said[0]
    assert f": {'2 points press' if axis else '1 point presses'}, and it ends within 1 cell" in said[0]
    assert said[1]
    assert said[2] == ""


def test_balls_are_told_likewise(caplog: pytest.LogCaptureFixture) -> None:
    (words,), _ = told(caplog, pressed(3, 1.5)[0])
    assert words == (
        "the contact of upper z0 on rigid plane is too small for its cells: 4 points press, and it ends "
        "within 2 cells of the largest pressure, which may be off by a tenth; four cells on the half width "
        "of a contact have it to about a percent: refine the meshes there"
    )


def test_plates_that_lift_off_a_floor_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    mesh = rectangle((0.0, 0.0), (4.0, 0.5), (6, 2))
    middle = Traction("plate", "y1", lambda x: np.where(x[:, :1] < 0.5, 1.0, 0.0) * (0.0, -10.0))
    scene = Scene(
        {"plate": Body(mesh, PLATE)},
        [Support("plate", "x0", (0.0, None))],
        [middle],
        [ContactPair(Surface("plate", "y0"), FLOOR)],
    )
    words, largest = told(caplog, scene)
    assert words == []
    assert largest > 0.0


def test_blocks_on_their_edge_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (8, 4))
    leaning = mesh.moved(mesh.points + [0.0, 0.02] * mesh.points[:, ::-1])
    scene = Scene(
        {"block": Body(leaning, PLATE)},
        [Support("block", "x1", (0.0, None))],
        [Traction("block", "y1", (0.0, -1.0))],
        [ContactPair(Surface("block", "y0"), FLOOR, Coulomb(1.0))],
    )
    words, largest = told(caplog, scene)
    assert words == []
    assert largest > 5.0


@pytest.mark.parametrize("slave", ["punch", "plate"])
def test_punches_are_not_told(slave: str, caplog: pytest.LogCaptureFixture) -> None:
    meshes = {
        "punch": rectangle((-0.5, 1.0), (0.5, 2.0), (2, 2)),
        "plate": rectangle((-2.0, 0.0), (2.0, 1.0), (13, 3)),
    }
    sides = [Surface("punch", "y0"), Surface("plate", "y1")]
    scene = Scene(
        {name: Body(mesh, PLATE) for name, mesh in meshes.items()},
        [Support("plate", "y0"), Support("punch", "y1", (0.0, -0.01))],
        contacts=[ContactPair(*(sides if slave == "punch" else sides[::-1]))],
    )
    assert told(caplog, scene)[0] == []
