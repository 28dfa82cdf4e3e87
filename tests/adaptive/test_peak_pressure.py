"""The peak of a contact pressure from a polynomial through nodes around it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
    ToolMotion,
    TotalForce,
    gallery,
    solve_scene,
    theory,
)
from fenics_contact.design import LargestPressure, PeakPressure
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.gallery import half_disc
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import refined

E, NU, RADIUS = 2.1e5, 0.3, 10.0
FORCE = 600.0


def block() -> Scene:
    """A quarter of a block of tetrahedra, halved again and again where a rigid ball is pressed into it."""
    mesh = gallery.block((0, 0, 0), (4, 4, 4), (4, 4, 4), cell="tetrahedron")
    for size in (2.0, 1.0, 0.7, 0.5, 0.4):
        away = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - (0, 0, 4), axis=1)
        mesh = refined(mesh, away < size).mesh
    cuts = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
    ball = RigidTool("ball", RigidSphere((0, 0, 4 + RADIUS), RADIUS), at=(0, 0, 4 + RADIUS))
    pressed = ToolMotion("ball", (0.0, 0.0, None), (0.0, 0.0, 0.0), force=(0.0, 0.0, -FORCE / 4))
    return Scene(
        bodies={"block": Body(mesh, IsotropicElasticity(E, NU))},
        supports=[*cuts, Support("block", "z0", (None, None, 0.0)), pressed],
        contacts=[ContactPair(Surface("block", "z1"), ball)],
    )


@pytest.fixture(scope="module")
def pressed():
    return solve_scene(block(), MPI.COMM_SELF, tolerance=1e-8)


def at_rest(state):
    """Return the forms of a design that moves nothing."""
    return ShapeForms.at_rest(state.torn)


def with_pressure(state, pressure):
    """Return what `PeakPressure` reads of a state, with another pressure."""
    contact = state.contact
    force = np.maximum(pressure(state.contact_places), 0.0) * contact.area
    return SimpleNamespace(contact=replace(contact, normal_force=force), scene=state.scene, torn=state.torn)


def test_pressures_of_second_degree_are_exact(pressed):
    def pressure(x):
        return 5.0 - (x[:, 0] / 4.0) ** 2 - (x[:, 1] / 5.0) ** 2

    state = with_pressure(pressed, pressure)
    peak = PeakPressure().value(state, at_rest(pressed))
    assert peak == pytest.approx(5.0, rel=1e-9)


def test_a_pressure_that_wavers_by_facets_around_nodes_has_its_mean(pressed):
    places, area = pressed.contact_places, pressed.contact.area
    near = np.linalg.norm(places[:, :2], axis=1) < 0.5
    wavering = np.where(area > np.median(area[near]), -1.0, 1.0)
    # As much force is taken from nodes with large areas as is given to those with small ones.
    small = wavering > 0.0
    wavering[small] *= area[~small & near].sum() / area[small & near].sum()

    state = with_pressure(pressed, lambda _: 100.0 + 10.0 * wavering)
    largest = LargestPressure().value(state, at_rest(pressed))
    peak = PeakPressure().value(state, at_rest(pressed))
    assert abs(peak - 100.0) < 0.5 * abs(largest - 100.0)


def test_the_peak_is_linear_in_the_forces_that_it_weighs(pressed):
    objective, forms = PeakPressure(pair=0), at_rest(pressed)
    partials = objective.partials(pressed, forms)
    assert partials.value == objective.value(pressed, forms)
    assert partials.by_multiplier @ pressed.solution.multiplier == pytest.approx(partials.value, rel=1e-12)
    assert np.count_nonzero(partials.by_multiplier) > 5


def test_tetrahedra_have_the_peak_of_hertz(pressed):
    modulus = theory.contact_modulus(E, NU, np.inf, 0.0)
    hertz = theory.hertz_point(FORCE, (1 / RADIUS, 1 / RADIUS), modulus).peak_pressure
    peak, largest = (each.value(pressed, at_rest(pressed)) for each in (PeakPressure(), LargestPressure()))
    assert peak == pytest.approx(hertz, rel=0.02)
    assert abs(peak - hertz) < abs(largest - hertz)


def test_images_across_planes_of_symmetry_make_halves_equal():
    def of(symmetry):
        mesh = half_disc(RADIUS, 6, symmetry=symmetry, grading=0.0)
        cuts = [Support("roll", "x0", (0.0, None))] if symmetry else [Support("roll", "top", (0.0, None))]
        state = solve_scene(
            Scene(
                bodies={"roll": Body(mesh, PlaneStrain(E, NU))},
                supports=[*cuts],
                loads=[TotalForce("roll", "top", (0.0, -2000.0 / (1 + bool(symmetry))))],
                contacts=[ContactPair(Surface("roll", "contact"), RigidPlane((0, 0), (0, 1)))],
            ),
            MPI.COMM_SELF,
            tolerance=1e-10,
        )
        return with_pressure(state, lambda x: 7.0 - x[:, 0] ** 2 - 0.3 * np.abs(x[:, 0])), state

    peaks = [PeakPressure().value(fake, at_rest(state)) for fake, state in map(of, ("x", ""))]
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-9)


def test_what_cannot_be_asked_is_refused(pressed):
    with pytest.raises(InvalidInputError, match=r"PeakPressure.pair must be the number .*, 0 to 0, got 1"):
        PeakPressure(pair=1).value(pressed, at_rest(pressed))
    with pytest.raises(InvalidInputError, match="no derivative by the shape: take LargestPressure"):
        PeakPressure().partials(pressed, ShapeForms(MPI.COMM_SELF))
    open_everywhere = with_pressure(pressed, lambda x: 0.0 * x[:, 0])
    with pytest.raises(InvalidDesignError, match="but no contact pair of this design transmits"):
        PeakPressure().value(open_everywhere, at_rest(pressed))
