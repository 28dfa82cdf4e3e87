"""A quantity to the accuracy that is asked for."""

import json
import logging
import re
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AccurateResult,
    Body,
    ContactPair,
    Coulomb,
    Level,
    Limits,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    gallery,
    goal_error,
    quantity,
    solve_to,
    theory,
)
from fenics_contact._adaptive.equilibrium import AdaptiveLoop
from fenics_contact._adaptive.goal_errors import value_of
from fenics_contact._adaptive.resultants import StickArea
from fenics_contact._base.memory import available_memory
from fenics_contact._base.progress import Kind
from fenics_contact.design import (
    FrictionWork,
    LargestStress,
    Maximum,
    Movement,
    PeakPressure,
    StrainEnergy,
    TotalPotential,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import split_quadrilaterals
from fenics_contact.materials import IsotropicElasticity, PlaneStrain

E, NU, RADIUS, FORCE = 2.1e5, 0.3, 10.0, 1000.0


def pressed(n: int = 5) -> Scene:
    """Half of a block on a cylinder, on a mesh that knows nothing of the contact: cells of 2 mm."""
    mesh = gallery.rectangle((0.0, 0.0), (10.0, 10.0), (n, n), cell="triangle")
    roll = RigidSphere((0.0, -RADIUS), RADIUS)
    return Scene(
        bodies={"block": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("block", "x0", (0.0, None))],
        loads=[Traction("block", "y1", (0.0, -FORCE / 20.0))],
        contacts=[ContactPair(Surface("block", "y0"), roll)],
    )


@pytest.fixture(scope="module")
def peak() -> AccurateResult:
    return solve_to(pressed(), PeakPressure(), 0.01, MPI.COMM_SELF)


def test_a_coarse_mesh_finds_the_peak_of_hertz(peak):
    modulus = theory.contact_modulus(E, NU, np.inf, 0.0)
    hertz = theory.hertz_line(FORCE, 1.0 / RADIUS, modulus).peak_pressure
    assert peak.reached
    assert peak.relative_error <= 0.01
    assert peak.value == pytest.approx(hertz, rel=0.015)  # half a percent of it is the finite block
    # A mesh as fine everywhere would have a hundred thousand unknowns.
    assert peak.levels[-1].unknowns < 5000
    assert peak.state.scene.bodies["block"].mesh.n_cells == peak.levels[-1].cells


def test_a_roller_pressed_in_by_an_eighth_of_its_radius_has_the_peak_of_hertz():
    """Along the master's normals estimates of the gaps between facets stayed at 0.95 % on every mesh."""
    steel, aluminium = PlaneStrain(E, NU), PlaneStrain(E / 3.0, NU)
    roll = gallery.half_disc(50.0, 4, grading=1.0)
    block = gallery.rectangle((0.0, -200.0), (100.0, 0.0), (4, 8))
    scene = Scene(
        bodies={"roll": Body(roll, steel), "block": Body(block, aluminium)},
        supports=[
            Support("block", "y0"),
            Support("block", "x0", (0.0, None)),
            Support("roll", "x0", (0.0, None)),
        ],
        loads=[TotalForce("roll", "top", (0.0, -17_500.0))],
        contacts=[ContactPair(Surface("roll", "contact"), Surface("block", "y1"))],
    )
    modulus = theory.contact_modulus(E, NU, E / 3.0, NU)
    hertz = theory.hertz_line(35_000.0, 1.0 / 50.0, modulus).peak_pressure
    found = solve_to(scene, PeakPressure(), 0.002, MPI.COMM_SELF, limits=Limits(levels=7))
    assert found.reached
    assert found.value == pytest.approx(hertz, rel=0.0025)  # for half-spaces, of 0.16 % less here


def test_unresolved_contacts_have_an_unknown_error(peak):
    unknown = [np.isinf(level.error) for level in peak.levels]
    assert unknown[0]
    assert unknown == sorted(unknown, reverse=True)
    assert not unknown[-1]
    assert peak.levels[0].value < 0.7 * peak.value


def test_the_levels_are_printed(peak):
    lines = str(peak).splitlines()
    assert lines[0].split() == ["cells", "unknowns", "value", "error", "products", "seconds", "predicted"]
    assert len(lines) == len(peak.levels) + 2
    assert lines[-1] == peak.reason
    assert "1 % were asked for" in peak.reason


def test_an_energy_costs_a_fraction_of_uniform_meshes():
    found = solve_to(pressed(), TotalPotential(), 0.01, MPI.COMM_SELF)
    finer = solve_to(pressed(), TotalPotential(), 0.001, MPI.COMM_SELF)
    assert abs(found.value - finer.value) <= 0.01 * abs(finer.value)
    assert found.levels[-1].unknowns < finer.levels[-1].unknowns


def test_less_than_three_meshes_tell_nothing_of_errors():
    found = solve_to(pressed(), TotalPotential(), 0.5, MPI.COMM_SELF)
    assert [np.isinf(level.error) for level in found.levels[:2]] == [True, True]
    assert found.reached


def error_after(corrected, sums, state_value, missing, *, without_adjoint=""):
    """The error of a value with its estimate, on the last of some meshes."""
    way = AdaptiveLoop(TotalPotential(), 0.01, Limits(), MPI.COMM_SELF)
    way.without_adjoint, way._sums = without_adjoint, sums
    way._corrected = [*corrected, state_value + missing]
    return way._error(missing, state_value + missing)


def test_errors_are_estimates_and_what_these_turned_out_to_miss():
    assert error_after([110.0, 110.0], [9.0, 3.0, 1.0], 109.0, 1.0) == pytest.approx(1.0), "all agree"
    # The estimate now promises 108, and before 109.5 and 109: half of 1, half of that and so on, 1 in all.
    assert error_after([109.5, 109.0], [9.0, 3.0, 1.0], 107.0, 1.0) == pytest.approx(2.0)
    # A small change may be chance: what is left of the one before counts.
    assert error_after([113.0, 109.0], [9.0, 3.0, 1.0], 107.0, 1.0) == pytest.approx(3.0)
    # Estimates that fall to 3 / 4 leave three times the change.
    assert error_after([112.0, 112.0], [9.0, 4.0, 3.0], 111.0, -1.0) == pytest.approx(7.0)


def test_changes_that_fall_slowly_to_one_side_leave_more():
    """A value of 100 that is missed by 20, 16, 12.8, 10.24 and so on, of which estimates see a tenth."""
    off = [20.0 * 0.8**k for k in range(5)]
    error = error_after([100.0 - each for each in off[:4]], [9.0, 3.0, 1.0], 100.0 - off[4] - 0.5, 0.5)
    assert error == pytest.approx(0.5 + off[4])
    # Twice, or to the other side in between, may be chance.
    assert error_after([80.0, 84.0], [9.0, 3.0, 1.0], 86.7, 0.5) == pytest.approx(0.5 + 3.2)
    assert error_after([90.0, 80.0, 84.0], [9.0, 3.0, 1.0], 83.2, 4.0) == pytest.approx(4.0 + 3.2)
    # Changes that do not fall at all.
    assert error_after([80.0, 81.0, 82.0], [9.0, 3.0, 1.0], 83.0, 0.0) == pytest.approx(19.0)


def test_without_adjoint_errors_go_on_to_fall_as_changes_do():
    def error(*values):
        return error_after([*values[:2]], [9.0, 3.0, 1.0], values[2], 0.0, without_adjoint="none")

    assert error(109.0, 103.0, 102.0) == pytest.approx(3.0), "half of 6, and half of that, and so on"
    assert error(109.0, 105.0, 102.0) == pytest.approx(9.0), "what falls to 3 / 4 leaves three times 3"


def test_meshes_that_were_refined_at_a_spot_alone_do_not_count():
    nan = float("nan")
    assert error_after([nan, nan], [nan, nan, 1.0], 109.0, 1.0) == np.inf
    assert error_after([nan, 112.0], [nan, 2.0, 1.0], 109.0, 1.0) == np.inf
    assert error_after([113.0, 112.0], [3.0, 2.0, 1.0], 109.0, 1.0) == pytest.approx(3.0)


def test_an_error_above_the_value_is_unknown():
    assert error_after([1.8, 1.2], [1.0, 1.0, 0.5], 1.0, 0.0) == pytest.approx(0.3)
    assert error_after([9.0, 4.0], [1.0, 1.0, 0.5], 1.0, 0.0) == np.inf


@pytest.mark.parametrize(("missing", "value"), [(-4.0, 6.0), (-15.0, 10.0), (15.0, 10.0)])
def test_an_estimate_above_the_quantity_corrects_nothing(monkeypatch, peak, missing, value):
    """A pressure of 10 that is to be corrected by −15 would become one that pulls."""
    way = AdaptiveLoop(PeakPressure(), 0.01, Limits(), MPI.COMM_SELF)
    way._state, way._doubted = peak.state, False
    way._sums, way._corrected = [9.0, 3.0], [6.0, 6.0]
    found = SimpleNamespace(value=10.0, known=missing, without_adjoint="", by_cell=lambda body: np.ones(1))
    monkeypatch.setattr("fenics_contact._adaptive.equilibrium.goal_error", lambda *_: found)
    assert way._estimated() == (10.0, value, pytest.approx(4.0) if value == 6.0 else np.inf)
    assert np.isnan(way._corrected[-1]) == (value == 10.0)


def test_the_quantity_is_corrected_by_its_estimate(peak):
    last = peak.levels[-1]
    assert peak.value == last.value
    assert peak.value - last.state_value == pytest.approx(goal_error(peak.state, PeakPressure()).total)
    assert last.state_value == value_of(peak.state, PeakPressure())
    corrected = [level.value != level.state_value for level in peak.levels]
    assert (corrected, corrected[0], corrected[-1]) == (sorted(corrected), False, True)


def test_meshes_grow_by_a_factor_of_about_three():
    mesh = gallery.block((0, 0, 0), (1, 1, 1), (2, 2, 2), cell="tetrahedron")
    scene = Scene(
        bodies={"block": Body(mesh, IsotropicElasticity(E, NU))},
        supports=[Support("block", "x0")],
        loads=[TotalForce("block", "x1", (0.0, 0.0, -1.0))],
    )
    found = solve_to(scene, TotalPotential(), 1e-6, MPI.COMM_SELF, limits=Limits(levels=4))
    cells = [level.cells for level in found.levels]
    assert max(after / before for before, after in pairwise(cells)) < 4.0  # six times if nothing bounds it


def test_a_quantity_of_zero_has_no_relative_error():
    class Nothing(PeakPressure):
        without_adjoint = "it is zero"

        def value(self, state, forms):
            return 0.0

    found = solve_to(pressed(), Nothing(), 0.01, MPI.COMM_SELF)
    assert not found.reached
    assert "the quantity is zero on this mesh, and no error is small relative to that" in found.reason


def test_a_quantity_without_adjoint_has_the_error_that_changes_tell(caplog):
    scene = pressed()
    pair = replace(scene.contacts[0], friction=Coulomb(0.5))
    with caplog.at_level(logging.WARNING, logger="fenics_contact"):
        found = solve_to(replace(scene, contacts=[pair]), "stick_area", 0.2, MPI.COMM_SELF)
    (words,) = (record.message for record in caplog.records if "judged by" in record.message)
    assert re.match(r"the error is judged by the changes .* alone: an area changes by the statuses", words)
    assert np.isinf(found.levels[0].error)
    last, before = found.levels[-1], found.levels[-2]
    assert 0.0 < last.error <= 0.2 * last.value
    assert last.error <= 9.0 * abs(last.value - before.value) + 1e-12


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_a_body_without_contact_is_refined_at_its_corners(cell):
    mesh = gallery.rectangle((0.0, 0.0), (2.0, 1.0), (5, 3), cell=cell)
    scene = Scene(
        bodies={"beam": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("beam", "x0")],
        loads=[Traction("beam", "y1", (0.0, -10.0))],
    )
    tip = Movement("beam", "x1", (0.0, 1.0))
    found = solve_to(scene, tip, 0.02, MPI.COMM_SELF)
    finer = solve_to(scene, tip, 0.003, MPI.COMM_SELF)
    assert abs(found.value - finer.value) <= 0.02 * abs(finer.value)
    final = finer.state.scene.bodies["beam"].mesh
    sizes = np.ptp(final.points[final.cells], axis=1).max(axis=1)
    corner = np.linalg.norm(final.points[final.cells].mean(axis=1), axis=1).argmin()
    assert sizes[corner] < 0.5 * sizes.max()


def test_a_start_near_a_kink_of_friction_takes_few_products():
    """Between two faces short steps made no way, and a rescue of 300 products followed."""
    steel = IsotropicElasticity(E, NU)
    parts = {
        "floor": gallery.block((0, 0, 0), (3, 3, 1), (3, 3, 1)),
        "slab": gallery.block((0, 0, 1), (3, 3, 2), (5, 5, 3)),
        "rib": gallery.block((0, 0, 2), (3, 1, 3), (3, 1, 1)),
    }
    scene = Scene(
        bodies={name: Body(mesh, steel) for name, mesh in parts.items()},
        supports=[
            Support("floor", "z0"),
            Support("slab", "x0", (0.0, None, None)),
            Support("slab", "y0", (None, 0.0, None)),
        ],
        loads=[TotalForce("rib", "z1", (0.0, 0.0, -500.0))],
        contacts=[ContactPair(Surface("slab", "z0"), Surface("floor", "z1"), Coulomb(0.3))],
        ties=[Tie(Surface("rib", "z0"), Surface("slab", "z1"))],
    )
    stress = quantity("stress", scene, body="slab", at=(1.5, 0.5, 1.5))
    found = solve_to(scene, stress, 0.02, MPI.COMM_SELF, limits=Limits(levels=2))
    assert found.levels[-1].products < 100


def test_progress_says_what_the_next_mesh_will_cost_before_it_begins(caplog):
    with caplog.at_level(logging.DEBUG, logger="fenics_contact.progress"):
        found = solve_to(pressed(), PeakPressure(), 0.05, MPI.COMM_SELF, limits=Limits(levels=3))
    events = [getattr(record, "progress", None) for record in caplog.records]
    steps = [k for k, each in enumerate(events) if each and each.what == "levels" and each.kind is Kind.STEP]
    assert len(steps) == len(found.levels) == 3
    for place, level, coming in zip(steps, found.levels, found.levels[1:], strict=False):
        assert events[place].words.startswith(f"{level.unknowns} unknowns, {level.value:.6g} ± ")
        assert events[place].words.endswith(
            f"; next: {coming.unknowns} unknowns, about {coming.predicted:.2g} s"
        )
    assert "next" not in events[steps[-1]].words
    begun = [k for k, each in enumerate(events) if each and each.kind is Kind.BEGIN and k > steps[0]]
    assert begun  # the work of the second mesh begins after it was predicted


def test_warnings_are_those_of_the_last_mesh(caplog):
    with caplog.at_level(logging.WARNING):
        solve_to(pressed(), PeakPressure(), 0.05, MPI.COMM_SELF)
    assert not caplog.records
    with caplog.at_level(logging.WARNING):
        solve_to(pressed(), PeakPressure(), 0.05, MPI.COMM_SELF, limits=Limits(levels=1))
    assert [record.message.split(":")[0][:29] for record in caplog.records] == [
        "the contact of block y0 on ri",
        "the accuracy asked for was no",
    ]


def test_limits_stop_before_a_mesh_is_made(caplog):
    with caplog.at_level(logging.WARNING):
        few = solve_to(pressed(), PeakPressure(), 0.01, MPI.COMM_SELF, limits=Limits(levels=2))
    assert not few.reached
    assert len(few.levels) == 2
    assert few.reason == "an unknown error after 2 meshes, as many as limits.levels allows"
    assert f"not reached: {few.reason}" in caplog.text
    for limits, words in (
        (Limits(unknowns=80), r"would be larger than limits.unknowns allows, 80"),
        (Limits(memory=1e4), r"would need about .* GB, 1e-05 are left"),
        (Limits(seconds=1e-9), r"would take about .* s, limits.seconds allows 1e-09"),
    ):
        stopped = solve_to(pressed(), PeakPressure(), 0.01, MPI.COMM_SELF, limits=limits)
        assert len(stopped.levels) == 1
        assert not stopped.reached
        assert re.search(words, stopped.reason)


def test_facets_are_refined_as_facets_and_that_is_told(caplog):
    mesh = split_quadrilaterals(gallery.half_disc(10.0, 3, grading=1.0))
    scene = Scene(
        bodies={"roll": Body(mesh, PlaneStrain(E, NU))},
        supports=[Support("roll", "x0", (0.0, None))],
        loads=[Traction("roll", "top", (0.0, -100.0))],
        contacts=[ContactPair(Surface("roll", "contact"), RigidPlane((0, 0), (0, 1)))],
    )
    told = "roll contact is curved, but its mesh knows no true shape: its facets were refined as facets"
    with caplog.at_level(logging.WARNING):
        solve_to(scene, TotalPotential(), 0.05, MPI.COMM_SELF)
    assert told not in caplog.text
    bare = {"roll": replace(scene.bodies["roll"], mesh=mesh.with_shapes({}))}
    with caplog.at_level(logging.WARNING):
        solve_to(replace(scene, bodies=bare), TotalPotential(), 0.05, MPI.COMM_SELF)
    assert told in caplog.text


def test_the_memory_that_is_left_is_that_of_the_table(tmp_path):
    table = tmp_path / "meminfo"
    table.write_text("MemTotal:       2000 kB\nMemAvailable:   1500 kB\n")
    assert available_memory(table) == 1500 * 1024
    table.write_text("MemTotal:       2000 kB\n")
    assert available_memory(table) is None
    assert available_memory(tmp_path / "none") is None


def test_a_stress_at_a_sharp_corner_grows_without_limit():
    """The edge of a flat rigid punch: contact pressure is unbounded there."""
    mesh = gallery.rectangle((0.0, 0.0), (2.0, 2.0), (2, 2), cell="triangle")
    base = gallery.rectangle((0.0, -6.0), (6.0, 0.0), (6, 6), cell="triangle")
    stiff = PlaneStrain(1e4 * E, NU)
    scene = Scene(
        bodies={"punch": Body(mesh, stiff), "base": Body(base, PlaneStrain(E, NU))},
        supports=[
            Support("punch", "x0", (0.0, None)),
            Support("base", "x0", (0.0, None)),
            Support("base", "y0", (0.0, 0.0)),
        ],
        loads=[Traction("punch", "y1", (0.0, -100.0))],
        contacts=[ContactPair(Surface("base", "y1"), Surface("punch", "y0"))],
    )
    found = solve_to(scene, PeakPressure(), 0.01, MPI.COMM_SELF)
    assert not found.reached
    assert "grows without limit as cells get smaller" in found.reason


def test_only_pressures_and_stresses_grow_without_limit():
    """Four values that rise ever faster: of an area of at most 2, as of a peak."""
    level = Level(10, 10, 1.0, 0.5, 1, 0.1, 0.1, 1.0, 1.0)
    levels = [replace(level, unknowns=10 * 2**k, state_value=1.0 + 0.1 * 1.2**k) for k in range(6)]
    for quantity_, infinite in (
        (PeakPressure(), True),
        (LargestStress("block") + TotalPotential(), True),
        (Maximum((Movement("block", "y1", (0.0, 1.0)), LargestStress("block"))), True),
        (SimpleNamespace(), True),  # an objective of one's own that does not say
        (StickArea(0), False),
        (FrictionWork(), False),
        (StrainEnergy() + 2.0 * TotalPotential(), False),
        (Movement("block", "y1", (0.0, 1.0)), False),
    ):
        way = AdaptiveLoop(quantity_, 0.01, Limits(), MPI.COMM_SELF)
        way.levels, way._corrected = levels, [each.value for each in levels]
        way._state = SimpleNamespace(scene=pressed())
        assert ("grows without limit" in way._hopeless()) == infinite, quantity_


@pytest.mark.parametrize("accuracy", [0.0, 1.0, -0.1, 2.0])
def test_accuracies_between_nothing_and_all_are_wanted(accuracy):
    with pytest.raises(InvalidInputError, match="relative_error must lie between 0 and 1"):
        solve_to(pressed(), PeakPressure(), accuracy, MPI.COMM_SELF)


@pytest.mark.parametrize("name", ["levels", "unknowns", "seconds", "memory"])
def test_limits_allow_something(name):
    with pytest.raises(InvalidInputError, match=f"Limits.{name} must be above zero, got 0: leave it out"):
        Limits(**{name: 0})


def test_hexahedra_with_hanging_nodes_are_refined_alike():
    mesh = gallery.rectangle((0.0, 0.0), (10.0, 10.0), (5, 5))
    scene = pressed()
    scene = replace(scene, bodies={"block": Body(mesh, PlaneStrain(E, NU))})
    found = solve_to(scene, Movement("block", "y1", (0.0, 1.0)), 0.01, MPI.COMM_SELF)
    assert found.reached


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_take_the_same_way(ranks, mpirun, tmp_path):
    script = tmp_path / "levels.py"
    script.write_text(
        """
import json

import numpy as np
from mpi4py import MPI
from fenics_contact import (
    Body, ContactPair, Coulomb, RigidSphere, Scene, Support, Surface, Traction, gallery
)
from fenics_contact._adaptive.equilibrium import solve_to
from fenics_contact.design import PeakPressure
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
mesh = gallery.rectangle((0.0, 0.0), (10.0, 10.0), (5, 5), cell="triangle")
scene = Scene(
    bodies={"block": Body(mesh, PlaneStrain(2.1e5, 0.3))},
    supports=[Support("block", "x0", (0.0, None))],
    loads=[Traction("block", "y1", (0.0, -50.0))],
    contacts=[ContactPair(Surface("block", "y0"), RigidSphere((0.0, -10.0), 10.0), Coulomb(0.2))],
)
found = solve_to(scene, PeakPressure(), 0.01, MPI.COMM_WORLD)
assert found.reached
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([[level.cells for level in found.levels], found.value, found.error]))
"""
    )
    alone, (cells, value, _) = (json.loads(mpirun(script, count)) for count in (1, ranks))
    assert cells == alone[0]
    assert value == pytest.approx(alone[1], abs=0.02 * alone[2]), "what the adjoint's tolerance leaves"
