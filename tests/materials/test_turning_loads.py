"""Centrifugal forces and fastened masses act as their formulas say."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    Scene,
    Support,
    centrifugal,
    point_mass,
    read_scene_file,
    solve_scene,
    write_result,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStress
from fenics_contact.output import read_result

YOUNG, POISSON, DENSITY, SPEED = 2.1e5, 0.3, 7.85e-9, 1000.0
RADIUS = 100.0
#: Radial displacement of the rim of a thin disc, by its radius.
RIM = DENSITY * SPEED**2 * RADIUS**3 * (1.0 - POISSON) / (4.0 * YOUNG)
AXIS = (0.0, 0.0), (0.0, 1.0)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_the_rim_of_a_turning_disc_moves_out_as_its_formula_says(cell: str) -> None:
    mesh = rectangle((0.0, 0.0), (RADIUS, 1.0), (40, 1), cell)
    body = Body(mesh, IsotropicElasticity(YOUNG, POISSON), axisymmetric=True)
    spin = centrifugal("disc", DENSITY, SPEED, *AXIS)
    state = solve_scene(Scene({"disc": body}, [Support("disc", "y0", (None, 0.0))], [spin]), MPI.COMM_SELF)
    rim = state.gather_displacement("disc")[np.isclose(mesh.points[:, 0], RADIUS), 0]
    assert rim.mean() == pytest.approx(RIM, rel=1e-3)


def test_a_plane_disc_turns_about_its_normal_by_default() -> None:
    mesh = rectangle((0.0, 0.0), (60.0, 60.0), (12, 12))
    supports = [Support("part", "x0", (0.0, None)), Support("part", "y0", (None, 0.0))]
    body = Body(mesh, PlaneStress(YOUNG, POISSON))
    state = solve_scene(
        Scene({"part": body}, supports, [centrifugal("part", DENSITY, SPEED, (0.0, 0.0))]), MPI.COMM_SELF
    )
    # ∫ ρ ω² x over the quarter
    half = DENSITY * SPEED**2 * 60.0**2 / 2.0 * 60.0
    assert state.reactions()[0].force[0] == pytest.approx(-half, rel=1e-9)
    assert state.balance().loads.force == pytest.approx([half, half])


def test_an_arm_pulls_at_its_hub_whatever_the_direction_of_the_axis(tmp_path) -> None:
    mesh = block((0, 10, 0), (1, 110, 1), (1, 20, 1))
    body = Body(mesh, IsotropicElasticity(YOUNG, 0.0))
    spin = centrifugal("arm", DENSITY, SPEED, (0.5, 0.0, 7.0), (0.0, 0.0, -2.0))
    state = solve_scene(Scene({"arm": body}, [Support("arm", "y0")], [spin]), MPI.COMM_SELF)
    pull = DENSITY * SPEED**2 * (110.0**2 - 10.0**2) / 2.0
    assert state.reactions()[0].force == pytest.approx([0.0, -pull, 0.0], abs=1e-9 * pull)
    write_result(state, tmp_path)
    assert read_result(tmp_path)["scene"]["loads"][0]["value"]["speed"] == SPEED


def test_a_mass_pulls_with_its_weight_at_its_centre() -> None:
    body = Body(block((0, 0, 0), (10, 10, 10), (2, 2, 2)), IsotropicElasticity(YOUNG, POISSON))
    motor = point_mass("frame", "z1", 0.025, (0.0, 0.0, -9810.0), at=(25.0, 5.0, 40.0))
    state = solve_scene(Scene({"frame": body}, [Support("frame", "z0")], [motor]), MPI.COMM_SELF)
    reaction = state.reactions(about=(5.0, 5.0, 0.0))[0]
    assert reaction.force == pytest.approx([0.0, 0.0, 245.25], abs=1e-9)
    assert reaction.moment == pytest.approx([0.0, -245.25 * 20.0, 0.0], abs=1e-6)


def test_scene_files_spin_bodies_and_fasten_masses() -> None:
    file = read_scene_file(
        {
            "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [2, 1, 1], "counts": [2, 1, 1]}},
            "materials": {"s": {"young_modulus": 2.1e5, "poisson_ratio": 0.3}},
            "bodies": {"bar": {"mesh": "m", "material": "s"}},
            "supports": [{"body": "bar", "surface": "x0"}],
            "loads": [
                {"kind": "centrifugal", "name": "spin", "body": "bar", "density": DENSITY, "speed": 1.0},
                {"kind": "point_mass", "body": "bar", "surface": "x1", "mass": 1, "acceleration": [0, 0, -9]},
            ],
            "steps": [{"loads": {"spin": 200.0}, "count": 2}, {"loads": {"spin": "100 * t"}}],
        },
        MPI.COMM_SELF,
    )
    spins = [step.loads[0].value.speed for step in file.steps]
    assert spins == pytest.approx([100.5, 200.0, 300.0])
    assert file.scene.loads[1] == point_mass("bar", "x1", 1.0, (0.0, 0.0, -9.0))


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: centrifugal("disc", DENSITY, np.inf), "needs finite numbers and the coordinates of a point"),
        (lambda: centrifugal("disc", 1.0, SPEED, axis=(0, 0, 0)), "must be 3 finite numbers, not all zero"),
        (lambda: point_mass("disc", "y0", np.nan, (0, -1)), "a point mass must be finite, got nan"),
    ],
)
def test_what_is_no_motion_or_mass_is_refused(made, message) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


@pytest.mark.parametrize("given", [((0.0, 0.0),), ((0, 0, 0), (0, 0, 1)), ((1.0, 0.0), (0.0, 1.0))])
def test_bodies_of_revolution_turn_about_their_own_axis(given) -> None:
    body = Body(rectangle((0, 0), (1, 1), (1, 1)), IsotropicElasticity(1.0, 0.3), axisymmetric=True)
    message = r"needs the axis of the body, with point \(0, 0\) and axis \(0, 1\)"
    with pytest.raises(InvalidInputError, match=message):
        Scene({"disc": body}, loads=[centrifugal("disc", 1.0, 1.0, *given)])
