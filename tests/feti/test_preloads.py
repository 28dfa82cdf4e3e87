"""Bolts drawn together at a section carry what the joint diagram says."""

from __future__ import annotations

import textwrap
import tomllib

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    LoadSequence,
    LoadStep,
    Preload,
    RigidPlane,
    Scene,
    Section,
    Support,
    Surface,
    Tie,
    TotalForce,
    box_partition,
    read_scene_file,
    solve_scene,
    solve_steps,
)
from fenics_contact.__main__ import main
from fenics_contact._equilibrium.deformed import begun_as
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.preloads import shortening_scales
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.output import read_result
from tests.feti.bolts import (
    BOLT,
    LENGTH,
    LOADS,
    MIDDLE,
    SLEEVE,
    SOFT,
    STIFF,
    bar,
    clamped,
    joint,
    plate_with_four_bolts,
    pulled,
)


@pytest.mark.parametrize("boxes", [1, 2])
def test_sleeve_and_bolt_carry_what_the_joint_diagram_says(boxes):
    scene = joint(Preload("bolt", MIDDLE, force=50.0))
    parts = {name: box_partition(body.mesh, (1, 1, boxes)) for name, body in scene.bodies.items()}
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-9)
    states = solve_steps(problem, [LoadStep("tighten"), *map(pulled, LOADS)])
    bolt = [state.preloads()["bolt"].force for state in states]
    sleeve = [state.contact.normal_force.sum() for state in states]
    assert bolt == pytest.approx([50.0, *BOLT], rel=1e-6)
    assert sleeve == pytest.approx([50.0, *SLEEVE], rel=1e-6, abs=1e-6)
    lengths = [state.preloads()["bolt"].shortening for state in states]
    # q = F (1 / k_bolt + 1 / k_sleeve)
    assert lengths == pytest.approx([50.0 * (LENGTH / 1000 + LENGTH / 1500)] * 5, rel=1e-5)
    assert max(state.balance().imbalance for state in states) < 1e-9


def test_a_given_shortening_is_that_of_the_force():
    forced = solve_scene(joint(Preload("bolt", MIDDLE, force=50.0)), MPI.COMM_SELF, tolerance=1e-9)
    length = forced.preloads()["bolt"].shortening
    given = solve_scene(joint(Preload("bolt", MIDDLE, shortening=length)), MPI.COMM_SELF, tolerance=1e-9)
    assert given.preloads()["bolt"].force == pytest.approx(50.0, rel=1e-7)
    assert given.energies.strain == pytest.approx(forced.energies.strain, rel=1e-7)


def test_stress_of_a_drawn_bar_is_uniform_and_its_energy_is_known():
    state = solve_scene(clamped(Preload("bar", MIDDLE, force=10.0)), MPI.COMM_SELF)
    assert state.preloads()["bar"].shortening == pytest.approx(10.0 * LENGTH / 1000.0)
    assert state.gather_von_mises("bar") == pytest.approx(10.0)
    assert state.energies.strain == pytest.approx(10.0**2 * LENGTH / 1000.0 / 2)
    assert state.energies.load == pytest.approx(10.0 * 10.0 * LENGTH / 1000.0)
    assert state.energies.dual == pytest.approx(state.energies.primal)


def test_an_oblique_section_transmits_its_force_along_its_normal():
    normal = np.array([0.0, 0.6, 0.8])
    state = solve_scene(clamped(Preload("bar", Section((0, 0, 2), tuple(normal)), force=3.0)), MPI.COMM_SELF)
    section = state.preloads()["bar"]
    assert section.force == pytest.approx(3.0)
    moved = {name: state.reactions()[number].force for number, name in enumerate(("z0", "z1"))}
    assert moved["z1"] == pytest.approx(-section.resultant.force, abs=1e-8)


def test_the_area_of_an_oblique_section_is_that_across_its_normal():
    """Between cells as high as wide the cut is a stair: 1 across the bar and 1 along it."""
    drawn = Preload("bar", Section((0.0, 0.5, 2.0), (0.0, 0.8, 0.6)), force=1.0)
    mesh = clamped(drawn).bodies["bar"].mesh
    along, across = np.abs(vector_areas(mesh.points, drawn.cut(mesh).facets)).sum(axis=0)[1:]
    assert [along, across] == pytest.approx([1.0, 1.0])
    assert drawn.area(mesh) == pytest.approx(0.8 * along + 0.6 * across)


def test_a_bolt_of_revolution_has_the_force_of_a_full_one():
    mesh = rectangle((0.0, 0.0), (2.0, LENGTH), (2, 8))
    supports = [Support("bar", "y0"), Support("bar", "y1")]
    drawn = Preload("bar", Section((0.0, 1.9), (0.0, 1.0)), force=10.0)
    scene = Scene({"bar": Body(mesh, SOFT, axisymmetric=True)}, supports, preloads=[drawn])
    assert "area 12.5664" in scene.plan().preloads[0]
    section = solve_scene(scene, MPI.COMM_SELF).preloads()["bar"]
    assert section.force == pytest.approx(10.0)
    assert section.shortening == pytest.approx(10.0 * LENGTH / 1000.0 / (4.0 * np.pi))


def test_a_joint_of_revolution_is_that_of_its_diagram():
    """The joint above, revolved: bars of the areas π and 1.5 π, so that the load factor is 0.4 again."""
    rim = np.sqrt(1.44 + 1.5)
    sections = {
        "bolt": (rectangle((0.0, 0.0), (1.0, LENGTH), (2, 8)), SOFT),
        "sleeve": (rectangle((1.2, 0.0), (rim, LENGTH), (3, 7)), SOFT),
        "head": (rectangle((0.0, LENGTH), (rim, LENGTH + 1), (5, 2)), STIFF),
    }
    scene = Scene(
        {name: Body(*section, axisymmetric=True) for name, section in sections.items()},
        [Support("bolt", "y0", (None, 0.0)), Support("sleeve", "y0", (None, 0.0))],
        contacts=[ContactPair(Surface("sleeve", "y1"), Surface("head", "y0"))],
        ties=[Tie(Surface("bolt", "y1"), Surface("head", "y0"))],
        preloads=[Preload("bolt", Section((0.0, 1.9), (0.0, 1.0)), force=50.0)],
    )
    load = LoadStep("pull", loads=[TotalForce("head", "y1", (0.0, 60.0))], preloads=[])
    states = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9), [LoadStep("tighten"), load])
    assert [state.preloads()["bolt"].force for state in states] == pytest.approx([50.0, 74.0], rel=1e-5)
    pressed = [state.contact.normal_force.sum() for state in states]
    assert pressed == pytest.approx([50.0, 14.0], rel=1e-5)


def test_a_section_at_the_face_of_two_regions_is_that_of_the_plane():
    whole = bar()
    low = whole.points[whole.cells][:, :, 2].mean(axis=1) < 2.0
    regions = {"low": np.flatnonzero(low), "high": np.flatnonzero(~low)}
    parted = type(whole)(whole.points, whole.cells, whole.surfaces, regions=regions)
    supports = [Support("bar", "z0"), Support("bar", "z1")]
    given = Preload("bar", ("low", "high"), force=10.0, name="stud")
    scene = Scene({"bar": Body(parted, SOFT)}, supports, preloads=[given])
    section = solve_scene(scene, MPI.COMM_SELF).preloads()["stud"]
    assert section.normal == pytest.approx([0.0, 0.0, 1.0])
    assert section.shortening == pytest.approx(10.0 * LENGTH / 1000.0)


def test_bolts_tightened_in_turn_unload_those_before_and_keep_their_lengths():
    scene = plate_with_four_bolts()
    sequence = LoadSequence(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9))
    forces, lengths = [], []
    for bolt in scene.preloads:
        drawn = [type(bolt)(bolt.body, bolt.section, force=-20.0)]
        sections = sequence.advance(LoadStep(f"tighten {bolt.body}", preloads=drawn)).preloads()
        forces.append([section.force for section in sections.values()])
        lengths.append([section.shortening for section in sections.values()])
    for turn in range(4):
        assert forces[turn][turn] == pytest.approx(-20.0, rel=1e-7)
        assert lengths[3][turn] == pytest.approx(lengths[turn][turn], rel=1e-6)
        assert lengths[turn][turn + 1 :] == pytest.approx([0.0] * (3 - turn), abs=1e-9)
    loss = np.array(forces)[3, :3] / -20.0
    assert (loss < 0.98).all()
    assert (np.diff(np.array(forces)[:, 0]) > 0.1).all()
    # All lengths at once lead to the same forces: nothing rubs.
    shortened = [
        type(bolt)(bolt.body, bolt.section, shortening=length)
        for bolt, length in zip(scene.preloads, lengths[3], strict=True)
    ]
    at_once = Scene(
        scene.bodies, scene.supports, contacts=scene.contacts, ties=scene.ties, preloads=shortened
    )
    known = solve_scene(at_once, MPI.COMM_SELF, tolerance=1e-9).preloads()
    assert [section.force for section in known.values()] == pytest.approx(forces[3], rel=1e-6)


@pytest.mark.parametrize("wall", [True, False])
@pytest.mark.parametrize("material", [SOFT, NeoHooke(1000.0, 0.0)])
def test_contact_across_a_section_has_the_pressure_of_the_whole_surface(material, wall):
    """The lateral surface of a drawn bar is pressed against a wall: pressure is even, also at the section."""
    bodies = {"bar": Body(bar(), material)}
    supports = [
        Support("bar", "z0", (None, None, 0.0)),
        Support("bar", "z1", (None, None, 0.0)),
        Support("bar", "y0", (None, 0.0, None)),
        Support("bar", "x0", (0.01 if wall else 0.005, None, None)),
    ]
    master = RigidPlane((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    if wall:
        bodies["wall"] = Body(block((1, 0, 0), (2, 1, LENGTH), (2, 2, 8)), material)
        supports.append(Support("wall", "x1"))
        master = Surface("wall", "x0")
    contacts = [ContactPair(Surface("bar", "x1"), master, discretisation="node")]
    drawn = Preload("bar", MIDDLE, force=10.0)
    state = solve_scene(
        Scene(bodies, supports, contacts=contacts, preloads=[drawn]), MPI.COMM_SELF, tolerance=1e-9
    )
    assert state.contact.points.count == 27
    pressure = state.contact.normal_force / state.contact.nominal_area
    # Of rubber the strains are finite; on a wall its nodes have moved away from those of the other body.
    assert pressure.mean() == pytest.approx(5.0, rel=1e-6 if material is SOFT else 5e-3)
    assert pressure == pytest.approx(pressure.mean(), rel=0.02 if material is not SOFT and wall else 1e-6)
    assert state.contact.nominal_area.sum() == pytest.approx(LENGTH)
    assert state.preloads()["bar"].force == pytest.approx(10.0)


@pytest.mark.parametrize("by", ["node", "mortar"])
def test_a_section_may_cut_the_master_of_a_tie_but_not_its_slave(by):
    """Tied to a wall along which it slides, a drawn bar has the stress of its force, everywhere alike."""
    wall = block((1, 0, 0), (2, 1, LENGTH), (1, 2, 8) if by == "node" else (1, 3, 7))
    bodies = {"bar": Body(bar(), SOFT), "wall": Body(wall, SOFT)}
    supports = [
        Support("wall", "x1"),
        Support("bar", "z0", (None, None, 0.0)),
        Support("bar", "z1", (None, None, 0.0)),
        Support("bar", "y0", (None, 0.0, None)),
        Support("bar", "x0", (0.01, None, None)),
    ]
    sides = Surface("wall", "x0"), Surface("bar", "x1")
    drawn = [Preload("bar", MIDDLE, force=10.0)]
    scene = Scene(bodies, supports, ties=[Tie(*sides, True, by)], preloads=drawn)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    stress = state.stress["bar"].x.array.reshape(-1, 9)
    assert stress[:, 0] == pytest.approx(-5.0, abs=1e-7)
    assert stress[:, 8] == pytest.approx(10.0, abs=1e-7)
    assert state.preloads()["bar"].shortening == pytest.approx(10.0 * LENGTH / 1000.0, rel=1e-8)
    turned = Scene(bodies, supports, ties=[Tie(*sides[::-1], True, by)], preloads=drawn)
    with pytest.raises(InvalidInputError, match="a section must not cut slaves of ties, that of body 'bar'"):
        solve_scene(turned, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("preload", "message"),
    [
        (Preload("bar", Section((0, 0, 9), (0, 0, 1))), "through nothing: the body reaches from -9 to -5"),
        (Preload("bar", Section((0, 0, 2), (0, 0, 1), radius=0.6)), "ends inside the body, at 3 nodes"),
        (Preload("bar", Section((0, 0, 2), (0, 0, 1), radius=0.1)), "its 0 cells within 0.1 matter"),
        (Preload("bar", Section((0, 0, 2), (0, 0, 1), region="shank")), "names region 'shank'"),
        (Preload("bar", ("low", "high")), "names region 'low'"),
        (Preload("bar", Section((0, 0), (0, 1))), "must have 3 coordinates"),
        (Preload("screw", MIDDLE), "names body 'screw'"),
    ],
)
def test_sections_that_do_not_cut_are_refused(preload, message):
    with pytest.raises(InvalidInputError, match=message):
        clamped(preload)


def test_sections_that_meet_are_refused():
    with pytest.raises(InvalidInputError, match="must not meet, but two of body 'bar' share 6 nodes"):
        clamped(Preload("bar", MIDDLE), Preload("bar", Section((0.5, 0.5, 2.0), (1, 0, 0))))
    with pytest.raises(InvalidInputError, match="needs one Preload, that of body 'bar' has two"):
        clamped(Preload("bar", MIDDLE), Preload("bar", MIDDLE, force=1.0))


def test_preload_against_an_open_joint_is_refused():
    scene = Scene({"bar": Body(bar(), SOFT)}, [Support("bar", "z0")], preloads=[Preload("bar", MIDDLE, 3.0)])
    with pytest.raises(InfeasibleError, match="acts against an open joint, force 3"):
        solve_scene(scene, MPI.COMM_SELF)


def test_supports_that_hold_a_section_are_refused():
    supports = [Support("bar", "z0"), Support("bar", "y0")]
    scene = Scene({"bar": Body(bar(), SOFT)}, supports, preloads=[Preload("bar", MIDDLE, shortening=0.1)])
    with pytest.raises(InvalidInputError, match="must leave sections of preloads free, hold"):
        solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: Preload("bar", MIDDLE, 1.0, 1.0), "must have a finite force or a finite shortening"),
        (lambda: Preload("bar", ("low", "low")), "names of two regions"),
        (lambda: Section((0, 0, 0), (0, 0, 0)), "Section.normal must be 3 finite numbers"),
        (lambda: Section((0, np.inf, 0), (0, 0, 1)), "Section.point must be three finite coordinates"),
        (lambda: Section((0, 0, 0), (0, 0, 1), radius=0.0), "Section.radius must be positive"),
    ],
)
def test_preloads_that_say_nothing_definite_are_refused(made, message):
    with pytest.raises(InvalidInputError, match=message):
        made()


def test_load_steps_and_results_name_preloads_of_the_scene():
    scene = clamped(Preload("bar", MIDDLE, force=1.0))
    other = Preload("bar", Section((0, 0, 3), (0, 0, 1)), force=1.0)
    with pytest.raises(InvalidInputError, match="has a section of body 'bar' that the scene does not have"):
        LoadStep("more", preloads=[other]).applied_to(scene)
    with pytest.raises(InvalidInputError, match="was cut at a section that no Preload holds together"):
        Scene(scene.bodies, scene.supports)
    preloads = solve_scene(scene, MPI.COMM_SELF).preloads()
    with pytest.raises(InvalidInputError, match="preloads of the scene are 'bar', got 'bolt'"):
        preloads["bolt"]


def test_a_plan_says_where_bodies_are_cut():
    plan = clamped(Preload("bar", Section((0, 0, 2), (0, 0.2, 1)), force=2.0)).plan()
    assert plan.subdomains == 2
    assert plan.preloads[0].startswith("bar drawn by 2 [force]; cut along 4 faces of cells")
    assert "within a layer of" in plan.preloads[0]
    assert "preload" not in str(Scene({"bar": Body(bar(), SOFT)}).plan())


def test_large_deformations_have_prescribed_shortenings():
    bodies = {"bar": Body(bar(), NeoHooke(1000.0, 0.0))}
    supports = [Support("bar", "z0"), Support("bar", "z1")]
    scene = Scene(bodies, supports, preloads=[Preload("bar", MIDDLE, shortening=0.4)])
    state = solve_scene(scene, MPI.COMM_SELF)
    stretch = (LENGTH + 0.4) / LENGTH
    assert state.preloads()["bar"].shortening == pytest.approx(0.4, rel=1e-7)
    # With ν = 0 the material is U = μ/2 (λ² + 2 − 3) − μ ln λ: nominal stress μ (λ − 1/λ).
    assert state.preloads()["bar"].force == pytest.approx(500.0 * (stretch - 1.0 / stretch), rel=1e-6)


RANKS = """
    import sys
    from mpi4py import MPI
    from fenics_contact import ContactProblem, LoadStep, solve_steps
    from fenics_contact import Preload
    from tests.feti.bolts import MIDDLE, joint, pulled

    comm = MPI.COMM_WORLD
    scene = joint(Preload("bolt", MIDDLE, force=50.0))
    problem = ContactProblem(scene, comm, tolerance=1e-9)
    for state in solve_steps(problem, [LoadStep("tighten"), pulled(60.0)]):
        bolt, lowest = state.preloads()["bolt"], state.gather_displacement("bolt").min()
        if comm.rank == 0:
            print(repr((bolt.force, bolt.shortening, float(lowest))))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_find_the_same_forces_and_lengths(ranks, mpirun):
    one, other = ([eval(line) for line in mpirun(RANKS, count).splitlines()] for count in (1, ranks))
    assert one[1][0] == pytest.approx(74.0, rel=1e-6)
    np.testing.assert_allclose(other, one, rtol=1e-8)


def test_a_stopped_history_goes_on_with_the_lengths_it_had(tmp_path):
    def run(steps):
        problem = ContactProblem(joint(Preload("bolt", MIDDLE, force=50.0)), MPI.COMM_SELF, tolerance=1e-9)
        states = solve_steps(problem, steps, checkpoint=Checkpoint(tmp_path / "history"))
        return [state.preloads()["bolt"] for state in states], states

    steps = [LoadStep("tighten"), pulled(20.0), pulled(60.0)]
    first, _ = run(steps[:2])
    again, states = run(steps)
    assert states[1].solution.reason == "read from a checkpoint"
    assert states[1].solution.gluing_residual < 1e-8
    assert again[1].force == pytest.approx(first[1].force, rel=1e-9)
    assert again[2].force == pytest.approx(74.0, rel=1e-6)


TOML = """
    [meshes.m]
    shape = "block"
    lower = [0.0, 0.0, 0.0]
    upper = [1.0, 1.0, 4.0]
    counts = [2, 2, 8]

    [materials.s]
    young_modulus = 1000.0
    poisson_ratio = 0.0

    [bodies.bar]
    mesh = "m"
    material = "s"

    [[supports]]
    body = "bar"
    surface = "z0"

    [[supports]]
    name = "end"
    body = "bar"
    surface = "z1"

    [[preloads]]
    name = "screw"
    body = "bar"
    point = [0.5, 0.5, 2.0]
    normal = [0.0, 0.0, 1.0]

    [[steps]]
    name = "tighten"
    preloads.screw = { force = 10.0 }

    [[steps]]
    name = "pull"
    count = 2
    preloads = {}
    supports.end = [0.0, 0.0, 0.04]

    [output]
    folder = "FOLDER"
    pictures = []
    files = []
"""


def test_scene_files_tighten_and_hold_bolts(tmp_path, capfd):
    path = tmp_path / "screw.toml"
    path.write_text(textwrap.dedent(TOML).replace("FOLDER", str(tmp_path / "out")))
    assert main(["run", str(path)]) == 0
    result = read_result(tmp_path / "out")
    assert result["more"]["steps"]["preload screw"] == pytest.approx([10.0, 15.0, 20.0])
    section = result["forces"]["preloads"][0]
    assert section["name"] == "screw"
    assert section["axial_force"] == pytest.approx(20.0)
    assert section["shortening"] == pytest.approx(0.04)
    assert result["scene"]["preloads"][0]["body"] == "bar"
    printed = capfd.readouterr().out
    assert "shorter by 0.04 mm" in printed
    assert "section of screw" in printed


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("preloads.screw", "preloads.bolt", "must be the name of a preload, one of 'screw'"),
        ("normal = [0.0, 0.0, 1.0]\n", "", "needs the point and normal of a plane, or two regions"),
        ("2.0]\n    normal", "9.0]\n    normal", "cuts through nothing"),
        ('name = "screw"\n', "", 'one of none, got "screw": give it name = "screw" there'),
    ],
)
def test_mistakes_in_scene_files_are_named(old, new, message):
    text = TOML.replace(old, new)
    assert text != TOML
    with pytest.raises(InvalidInputError, match=message):
        read_scene_file(tomllib.loads(textwrap.dedent(text)), MPI.COMM_SELF).scene.plan()


@pytest.mark.parametrize("boxes", [1, 2])
def test_a_force_in_rubber_is_reached_by_exact_tangents(boxes):
    stretch = (LENGTH + 0.4) / LENGTH
    force = 500.0 * (stretch - 1.0 / stretch)
    bodies = {"bar": Body(bar(), NeoHooke(1000.0, 0.0))}
    supports = [Support("bar", "z0"), Support("bar", "z1")]
    scene = Scene(bodies, supports, preloads=[Preload("bar", MIDDLE, force=force)])
    parts = {"bar": box_partition(bar(), (1, 1, boxes))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts)
    section = state.preloads()["bar"]
    assert section.force == pytest.approx(force, rel=1e-8)
    assert section.shortening == pytest.approx(0.4, rel=1e-7)
    residuals = [step.residuals.coarse for step in state.solution.history]
    assert len(residuals) <= 4
    assert residuals[-1] < 1e-4 * residuals[-2]


def test_a_joint_of_rubber_is_tightened_held_pulled_and_tightened_again():
    scene = joint(Preload("bolt", MIDDLE, force=50.0))
    rubber, stiff = NeoHooke(1000.0, 0.0), IsotropicElasticity(1e6, 0.0)
    bodies = {name: Body(body.mesh, rubber) for name, body in scene.bodies.items()}
    bodies["head"] = Body(scene.bodies["head"].mesh, stiff)
    scene = Scene(bodies, scene.supports, contacts=scene.contacts, ties=scene.ties, preloads=scene.preloads)
    again = LoadStep("again", loads=[], preloads=[Preload("bolt", MIDDLE, force=70.0)])
    steps = [LoadStep("tighten"), pulled(20.0), pulled(100.0), again]
    problem = ContactProblem(scene, MPI.COMM_SELF, steps=AutomaticSteps(first=0.5))
    tightened, little, apart, more = solve_steps(problem, steps)
    assert more.fractions == (0.5, 1.0)
    length = tightened.preloads()["bolt"].shortening
    for state, force in ((tightened, 50.0), (apart, 100.0), (more, 70.0)):
        assert state.preloads()["bolt"].force == pytest.approx(force, rel=1e-6)
    assert little.preloads()["bolt"].shortening == pytest.approx(length, rel=1e-7)
    assert apart.preloads()["bolt"].shortening == pytest.approx(length, rel=1e-7)
    assert more.preloads()["bolt"].shortening > 1.3 * length
    sleeve = little.contact.normal_force.sum()
    assert little.preloads()["bolt"].force == pytest.approx(20.0 + sleeve, rel=1e-5)
    assert more.contact.normal_force.sum() == pytest.approx(70.0, rel=1e-5)
    # On the way forces start from what held bolts carried, and lengths from where free ones were.
    half = more.load.between(begun_as(apart, apart.load, more.load), 0.5)
    assert half.torn.free.load * shortening_scales(scene) == pytest.approx(85.0, rel=1e-6)
    half = little.load.between(begun_as(tightened, tightened.load, little.load), 0.5)
    open_ = half.torn.right - half.torn.jump(tightened.torn_displacement)
    ties = slice(half.torn.n_gluing, half.torn.n_equality)
    assert np.abs(half.torn.numbering.gather(open_, np.arange(half.torn.n_equality))[ties]).max() < 1e-6
    # Both get stiffer or softer by their strains: the load factor is 0.4 to some percent.
    assert (little.preloads()["bolt"].force - 50.0) / 20.0 == pytest.approx(0.4, abs=0.05)


def test_rubber_preloaded_against_an_open_joint_is_refused():
    bodies = {"bar": Body(bar(), NeoHooke(1000.0, 0.0))}
    scene = Scene(bodies, [Support("bar", "z0")], preloads=[Preload("bar", MIDDLE, 3.0)])
    with pytest.raises(InfeasibleError, match="acts against an open joint, force 3"):
        solve_scene(scene, MPI.COMM_SELF)
