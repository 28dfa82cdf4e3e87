"""Pictures of states show what the state holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.quiver import Quiver
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, cylinder
from fenics_contact.gallery.blocks import extrude
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.pictures import Units, plot_contact_pressure, plot_contact_status, plot_error, plot_stress
from fenics_contact.pictures import drawing as painting
from fenics_contact.pictures import states as status
from fenics_contact.pictures.canvas import ERROR_MAP, Frame, face_on, oblique_view, sheet
from fenics_contact.pictures.section import (
    Section,
    Spot,
    component,
    contact_places,
    cut,
    drawn_bodies,
    field_entries,
    moved,
    points_of,
    refined,
    section_frame,
    sections_of,
    strongest_contact,
)
from fenics_contact.pictures.states import chosen_scale, plot_field
from fenics_contact.pictures.unrolled import Projection, Unrolling, contact_patches, unrolling_of
from tests.pictures.moving_states import pressed_by_a_lid
from tests.pictures.plane_states import flat_pad, plane_block, ring
from tests.pictures.states import contains, painted, pixels, pulled, touching_blocks

SMALL = 320


def test_stress_is_drawn_with_and_without_sections(tmp_path: Path) -> None:
    state = touching_blocks("tetrahedron")
    with_sections = pixels(plot_stress(state, tmp_path / "both.png", width=SMALL))
    without = pixels(plot_stress(state, tmp_path / "whole.png", width=SMALL, sections=False))
    assert with_sections.shape[1] == without.shape[1] == SMALL
    assert with_sections.shape[0] > 1.3 * without.shape[0]
    assert painted(with_sections) > 0.3
    assert painted(without) > 0.3


def test_the_same_range_makes_pictures_comparable(tmp_path: Path) -> None:
    state = touching_blocks()
    draw = {"width": SMALL, "sections": False}
    images = [
        pixels(plot_stress(state, tmp_path / f"{number}.png", clim=clim, **draw))
        for number, clim in enumerate([(0.0, 4.0), (0.0, 4.0), (0.0, 40.0)])
    ]
    np.testing.assert_array_equal(images[0], images[1])
    assert images[2].mean() > images[0].mean() + 0.02, "stresses low in their range are drawn pale"


def test_chosen_scale_and_range_are_round_and_fit() -> None:
    bodies = drawn_bodies(touching_blocks())
    stresses = np.concatenate([body["von_mises"] for body in bodies.values()])
    (entry,) = (each for each in field_entries([bodies], Units()) if each["name"] == "von_mises")
    low, high = entry["range"]
    assert low == 0.0
    assert np.quantile(stresses, 0.99) < high < 2 * stresses.max()
    assert chosen_scale(bodies) >= 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scale": np.nan}, r"scale must be finite, got nan"),
        ({"clim": (1.0, 0.0)}, r"clim must be finite \(low, high\)"),
        ({"reach": -1.0}, r"reach must be positive, got -1.0"),
    ],
)
def test_stress_refuses_options_that_cannot_be_drawn(
    options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_stress(touching_blocks(), tmp_path / "stress.png", **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("cell", "name"), [("hexahedron27", "stress_xx"), ("triangle6", "displacement_x")])
def test_any_field_of_bodies_is_drawn(cell: str, name: str, tmp_path: Path) -> None:
    blocks = pulled(cell).to_pyvista()
    bodies = {body: blocks[body] for body in blocks.keys()}
    (entry,) = (each for each in field_entries([bodies], Units()) if each["name"] == name)
    column = component(bodies["bar"], entry)
    data = bodies["bar"].cell_data["stress"] if "stress" in name else bodies["bar"].point_data["displacement"]
    np.testing.assert_array_equal(column, data[:, 0])
    image = pixels(plot_field(bodies, name, tmp_path / "field.png", width=SMALL))
    assert painted(image) > 0.2
    other = pixels(plot_field(bodies, name, tmp_path / "more.png", width=SMALL, scale=20.0))
    assert image.shape != other.shape, "the bar is longer where it has moved"
    with pytest.raises(InvalidInputError, match=r"field must be one of nodal_von_mises, .* got 'heat'"):
        plot_field(bodies, "heat")


@pytest.mark.parametrize("name", ["warmth", "contact_status"])
def test_a_field_of_one_body_or_of_statuses_is_drawn(name: str) -> None:
    bodies = drawn_bodies(touching_blocks())
    bodies["upper"].point_data["warmth"] = bodies["upper"].points[:, 2]
    assert painted(pixels(plot_field(bodies, name, width=SMALL))) > 0.2


@pytest.mark.parametrize("cell", ["hexahedron27", "triangle6"])
def test_values_of_nodes_cells_and_gauss_points_are_drawn(cell: str) -> None:
    state = pulled(cell)
    mesh = state.scene.bodies["bar"].mesh
    x = mesh.points[mesh.cells].mean(axis=1)[:, 0]
    words = {"width": SMALL, "clim": (0.0, float(mesh.points[:, 0].max())), "label": "place (mm)"}
    nodal, cells, gauss = (
        pixels(plot_field(state, {"bar": values}, **words))
        for values in (mesh.points[:, 0], x, x[:, None] + [-0.1, 0.0, 0.1])
    )
    assert np.abs(cells - gauss).mean() < 2e-3, "only the title differs, by the extremes"
    assert 0.0 < np.abs(nodal - cells).mean() < 0.1, "the same field, smooth and by cells"
    assert len(np.unique(cells.reshape(-1, cells.shape[2]), axis=0)) > 20
    with pytest.raises(InvalidInputError, match=r"'bar' must be one for each of .* got shape \(3,\)"):
        plot_field(state, {"bar": np.zeros(3)})
    with pytest.raises(InvalidInputError, match="'bar' must be finite somewhere: leave"):
        plot_field(state, {"bar": np.full(state.scene.bodies["bar"].mesh.n_nodes, np.nan)})


def test_bodies_are_chosen_undeformed_and_cut() -> None:
    state, draw = touching_blocks(), {"width": SMALL, "clim": (0.0, 1.0)}
    both, upper = (plot_field(state, "displacement_z", bodies=names, **draw) for names in (None, ["upper"]))
    own = plot_field(state, {"upper": state.gather_displacement("upper")[:, 2]}, **draw)
    assert pixels(both).shape != pixels(upper).shape
    assert np.abs(pixels(own) - pixels(upper)).mean() < 5e-3, "without values the other one is left out"
    middle = tuple(state.scene.bodies["upper"].mesh.points.mean(axis=0))
    whole, cut, rest = (
        pixels(plot_field(state, "von_mises", clip=clip, scale=0.0, **draw))
        for clip in (None, (middle, (0, -1, 0)), (middle, (0, 1, 0)))
    )
    assert np.abs(whole - cut).max() > 0.1 if whole.shape == cut.shape else True
    assert cut.shape != rest.shape or np.abs(cut - rest).max() > 0.1
    for wrong, words in (
        ({"bodies": ["lid"]}, r"bodies must be some of \['lower', 'upper'\], got \['lid'\]"),
        ({"clip": (0, 0, 1)}, r"clip must be \(point, normal\), got"),
        ({"clip": (middle, (0, 0, 0))}, "the normal of clip must be 3 finite numbers, not all zero"),
        ({"clip": ((0, 0), (0, 0, 1))}, "the point of clip must be three finite numbers"),
        ({"clip": ((0, 0, 99), (0, 0, -1))}, "clip leaves nothing of the bodies, got"),
        ({"clim": (1.0, 0.0)}, r"clim must be finite \(low, high\)"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            plot_field(state, **wrong)
    with pytest.raises(InvalidInputError, match="clip is for bodies in space, these are plane"):
        plot_field(pulled("triangle6"), clip=((0, 0, 0), (1, 0, 0)))


def test_pressure_and_status_are_drawn(tmp_path: Path) -> None:
    units = Units("m", "kN", "kPa")
    path = plot_contact_pressure(touching_blocks(), tmp_path / "pressure.png", width=800, units=units)
    image = pixels(path)
    assert image.shape[1] == 800
    left, right = image[:, :400], image[:, 400:]
    assert painted(left) > 0.2
    for colour in ("#0072b2", "#d55e00"):  # sticking and slipping points
        assert contains(right, colour)
        assert not contains(left[:, :300], colour, 0.005)


def test_patch_holds_the_points_of_the_pair_where_they_are() -> None:
    state = touching_blocks()
    patch, contact = contact_patches([state], 0)[0], state.contact
    assert len(patch.points) == contact.points.count
    np.testing.assert_allclose(patch.pressure[patch.points], contact.pressure)
    np.testing.assert_array_equal(patch.status, contact.status)
    places = contact_places(state, drawn_bodies(state))
    np.testing.assert_allclose(patch.places[patch.points], patch.flat.turn(places, places))
    assert patch.normal_forces.sum == pytest.approx(contact.normal_force.sum())
    slips = contact.status == Status.SLIP
    expected = np.linalg.norm(contact.slip[slips], axis=1)
    np.testing.assert_allclose(np.linalg.norm(patch.slip[slips], axis=1), expected, rtol=0.01)
    assert expected.max() > 0


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_refined_patch_keeps_the_integral_of_the_pressure(cell: str) -> None:
    patch = contact_patches([touching_blocks(cell)], 0)[0]
    mesh, values = refined(patch.places, patch.facets, patch.pressure)
    corners = np.column_stack([mesh.x, mesh.y])[mesh.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.sum() == pytest.approx(1.8 * 0.9, rel=1e-6)
    assert values.max() == pytest.approx(patch.pressure.max())
    assert values.min() >= 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pair": 1}, r"pair must be below 1, got 1: draw"),
        ({"reach": 0.0}, r"reach must be positive, got 0"),
        ({"clim": (0.0, 0.0)}, r"clim must be finite \(low, high\)"),
    ],
)
def test_pressure_refuses_options_that_cannot_be_drawn(
    options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_contact_pressure(touching_blocks(), tmp_path / "pressure.png", **options)
    assert not list(tmp_path.iterdir())


RANKS = """
    import sys
    from pathlib import Path
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from fenics_contact import Coulomb
    from fenics_contact.pictures import plot_contact_pressure, plot_decomposition, plot_stress
    from tests.scenes import partitions, two_blocks

    comm, folder = MPI.COMM_WORLD, Path(sys.argv[1])
    scene = two_blocks(Coulomb(0.4))
    state = solve_scene(scene, comm, partitions=partitions(scene), tolerance=1e-6)
    drawn = [
        plot_stress(state, folder / "stress.png", width=320, clim=(0, 4)),
        plot_contact_pressure(state, folder / "pressure.png", width=320, clim=(0, 8)),
        plot_decomposition(scene, partitions(scene), folder / "parts.png", width=320, comm=comm),
        plot_contact_pressure(state, width=320),
    ]
    shown = comm.gather([picture.png is not None for picture in drawn])
    known = comm.gather([picture.path and picture.path.name for picture in drawn])
    (folder / "file").touch()
    comm.barrier()
    caught = None
    try:
        plot_stress(state, folder / "file" / "stress.png", width=320)
    except Exception as error:
        caught = type(error).__name__
    everyone = comm.gather(caught)
    if comm.rank == 0:
        names = ["stress.png", "pressure.png", "parts.png", None]
        print(*everyone, shown == [[True] * 4, [False] * 4] and known == [names, names])
"""


def test_two_ranks_draw_the_same_pictures_and_share_their_errors(
    mpirun: Callable[..., str], tmp_path: Path
) -> None:
    answers = mpirun(RANKS, 2, tmp_path).split()
    assert answers == ["FileExistsError", "RemoteError", "True"], "or both ranks hold the same pictures"
    state = touching_blocks()
    plot_stress(state, tmp_path / "stress_1.png", width=SMALL, clim=(0, 4))
    plot_contact_pressure(state, tmp_path / "pressure_1.png", width=SMALL, clim=(0, 8))
    for name in ("stress", "pressure"):
        difference = pixels(tmp_path / f"{name}.png") - pixels(tmp_path / f"{name}_1.png")
        assert np.abs(difference).mean() < 0.002
    assert painted(pixels(tmp_path / "parts.png")) > 0.3


# Pictures of the discretisation error show where it is.
def as_hex(place: float) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in ERROR_MAP(place)[:3])


def test_cells_of_plane_bodies_have_the_colour_of_their_part(tmp_path: Path) -> None:
    state = plane_block()
    mesh = state.scene.bodies["block"].mesh
    right = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0
    given = {"block": np.where(right, 1e-2, 1e-4)}
    # No edges are drawn over cells that are seen this small.
    image = pixels(plot_error(state, tmp_path / "error.png", given, clim=(1e-5, 1e-1), width=2 * SMALL))
    left_half, right_half = image[:, : SMALL - 60], image[:, SMALL - 40 : -140]
    low, high = as_hex(0.25), as_hex(0.75)
    assert contains(left_half, low, 0.06)
    assert contains(right_half, high, 0.06)
    assert not contains(left_half, high, 0.06)


def test_the_label_of_the_colours_fits_beside_a_flat_picture(tmp_path: Path) -> None:
    image = pixels(plot_error(flat_pad(), tmp_path / "error.png", width=1600))
    assert image.shape[0] < 0.45 * image.shape[1]
    edges = (image[:3], image[-3:], image[:, :3], image[:, -3:])
    assert [bool((edge > 0.99).all()) for edge in edges] == [True] * 4


def test_a_body_at_rest_is_drawn_too(tmp_path: Path) -> None:
    state = plane_block()
    nothing = {"block": np.zeros(state.scene.bodies["block"].mesh.n_cells)}
    assert painted(pixels(plot_error(state, tmp_path / "rest.png", nothing, width=SMALL))) > 0.1


@pytest.mark.parametrize(
    ("by_cell", "options", "message"),
    [
        ({}, {}, r"by_cell\['block'\] must hold 192 numbers of at least 0, one a cell, got none: give"),
        ({"block": np.ones(3)}, {}, r"must hold 192 numbers .* got shape \(3,\), the smallest 1.0"),
        ({"block": np.full(192, -1.0)}, {}, r"one a cell, got shape \(192,\), the smallest -1"),
        (None, {"clim": (0.0, 1.0)}, r"clim of a logarithmic scale must be positive, got \(0.0, 1.0\)"),
        (None, {"clim": (1.0, 0.1)}, r"clim must be finite \(low, high\)"),
        (None, {"reach": 0.0}, r"reach must be positive"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    by_cell: dict[str, np.ndarray] | None, options: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_error(plane_block(), tmp_path / "error.png", by_cell, **options)
    assert not list(tmp_path.iterdir())


def test_nonlinear_materials_need_parts_that_are_given(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="errors need small strains and linear materials"):
        plot_error(pressed_by_a_lid(), tmp_path / "error.png")


# Sections run through the middle of the contact, and say where they are.
SOFT = IsotropicElasticity(100.0, 0.3)


@lru_cache(maxsize=4)
def cut_model(cuts: str, floor: bool = False) -> State:
    """A block pressed on another, or on a floor, cut at planes of symmetry: ``cuts`` is "y1" or "x0 y1"."""
    bodies = {"upper": Body(block((0, 0, 1), (1, 1, 2), (2, 2, 2)), SOFT)}
    if not floor:
        bodies["lower"] = Body(block((0, 0, 0), (1, 1, 1), (3, 3, 2)), SOFT)
    rollers = [
        Support(name, side, tuple(0.0 if axis == side[0] else None for axis in "xyz"))
        for name in bodies
        for side in cuts.split()
    ]
    held = [] if floor else [Support("lower", "z0")]
    master = RigidPlane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)) if floor else Surface("lower", "z1")
    push = Support("upper", "z1", (0.0, 0.0, -0.01))
    scene = Scene(bodies, [*rollers, *held, push], contacts=[ContactPair(Surface("upper", "z0"), master)])
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


def spot_of(state: State) -> Spot:
    return strongest_contact(state.contact, contact_places(state, moved(drawn_bodies(state), 1.0)))


def test_sections_cut_through_the_middle_of_the_contact_along_its_normal() -> None:
    state = touching_blocks()
    everything = state.scene.points
    spot = spot_of(state)
    np.testing.assert_allclose(spot.normal, [0, 0, 1], atol=0.1)
    assert 0.1 < spot.centre[0] < 1.9
    assert abs(spot.centre[2]) < 0.05
    sections = sections_of(spot, oblique_view(everything))
    assert abs(sections[0].view.towards @ sections[1].view.towards) < 1e-12
    for section in sections:
        view = section.view
        assert abs(view.towards @ spot.normal) < 1e-12
        assert view.up[2] > 0.9
        np.testing.assert_array_equal(section.origin, spot.centre)
        frame = section_frame(view, spot, everything)
        assert frame.holds(view.project(spot.centre[None]))[0]
        np.testing.assert_allclose(section_frame(view, spot, everything, 0.1).size, [0.28, 0.2])


@pytest.mark.parametrize(("cuts", "floor"), [("y1", False), ("x0 y1", False), ("x0 y1", True)])
def test_sections_of_parts_of_a_model_lie_in_its_planes_of_symmetry(cuts: str, floor: bool) -> None:
    state = cut_model(cuts, floor)
    bodies = moved(drawn_bodies(state), 1.0)
    spot = spot_of(state)
    assert spot.centre[1] == pytest.approx(1.0, abs=1e-12)
    assert spot.inside[1] == -1.0
    if "x0" in cuts:
        assert spot.centre[0] == pytest.approx(0.0, abs=1e-12)
    else:
        assert 0.2 < spot.centre[0] < 0.8
        assert spot.inside[0] == 0.0
    sections = sections_of(spot, oblique_view(points_of(bodies)))
    titles = {section.title(Frame(np.zeros(2), np.ones(2)), "mm"): section for section in sections}
    across = titles["section at y = 1 mm"]
    if "x0" in cuts:
        assert "section at x = 0 mm" in titles
    for face in cut(bodies, across).values():
        assert face.n_points > 3, "shifted out of the bodies"
        assert np.abs(face.points[:, 1] - 1.0).max() < 1e-4


def test_a_section_that_misses_all_bodies_is_shifted_to_the_other_side() -> None:
    bodies = drawn_bodies(touching_blocks())
    edge = max(float(body.points[:, 1].max()) for body in bodies.values())
    section = Section(face_on(np.array([0.0, 1.0, 0.0])), np.array([0, edge, 0]), np.array([0.0, 1.0, 0.0]))
    assert any(face.n_points for face in cut(bodies, section).values())


@pytest.mark.parametrize(
    ("normal", "place", "words"),
    [
        ((0, -1, 0), -1e-9, "section at y = 0 mm"),
        ((1, 0, 0), -12.34567, "section at x = −12.346 mm"),
        ((1, 1, 0), 3.0, "section"),
    ],
)
def test_a_section_says_where_it_is(normal: tuple[float, ...], place: float, words: str) -> None:
    axis = np.array(normal, dtype=float)
    section = Section(face_on(axis), np.full(3, place), axis)
    assert section.title(Frame(np.zeros(2), np.full(2, 5.0)), "mm") == words


def test_sections_have_axes_with_coordinates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[str, str, str]] = []
    draw = painting.label_axes  # type: ignore[attr-defined]

    def noted(axes: Any, view: Any, units: Any) -> None:
        draw(axes, view, units)
        assert axes.axison
        drawn.append((axes.get_title(), axes.get_xlabel(), axes.get_ylabel()))

    monkeypatch.setattr(painting, "label_axes", noted)
    plot_stress(cut_model("x0 y1"), tmp_path / "stress.png", width=320)
    # Which comes first is rounding: both have the same stress.
    first, second = sorted(drawn)
    assert first[0] == "section at x = 0 mm\ndisplacement × 1"
    assert first[1:] == ("y (mm), runs to the left: seen from −x", "z (mm)")
    assert second == ("section at y = 1 mm\ndisplacement × 1", "x (mm)", "z (mm)")


# Surfaces around an axis are unrolled where parts that carry force face away, and nothing is lost.
AROUND, LAYERS = 16, 2
#: Fraction of a turn of a cell, by which the bore's nodes lie beside the seam for some states.
CELL = 2 * np.pi / AROUND


@lru_cache(maxsize=2)
def fitted(shift: float = 0.0) -> State:
    """A hub squeezed onto a shaft along z, also pushed along x by ``shift`` and turned a little."""
    material = IsotropicElasticity(100.0, 0.3)
    bodies = {
        "shaft": Body(extrude(ring(0.5, 1.0, AROUND), np.linspace(0, 0.5, LAYERS + 1)), material),
        "hub": Body(extrude(ring(1.0, 2.0, AROUND), np.linspace(0, 0.5, LAYERS + 1)), material),
    }
    squeeze = (
        lambda x: shift - 0.01 * x[:, 0] - 0.02 * x[:, 1],
        lambda x: 0.02 * x[:, 0] - 0.01 * x[:, 1],
        0.0,
    )
    scene = Scene(
        bodies,
        [Support("shaft", "inner", (0.0, 0.0, 0.0)), Support("hub", "outer", squeeze)],
        contacts=[ContactPair(Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.1))],
    )
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)


def test_a_bore_with_pressure_all_around_shows_all_points() -> None:
    state = fitted()
    (patch,) = contact_patches([state], 0)
    unrolling = patch.flat
    assert isinstance(unrolling, Unrolling)
    assert patch.hidden == 0
    assert patch.behind == ""
    assert len(patch.points) == len(np.unique(patch.points)) == AROUND * (LAYERS + 1)
    np.testing.assert_array_equal(patch.status, state.contact.status)
    np.testing.assert_allclose(patch.pressure[patch.points], state.contact.pressure)
    assert unrolling.radius == pytest.approx(1.0)
    np.testing.assert_allclose(unrolling.frame, np.eye(3), atol=1e-12)
    assert np.ptp(patch.places[:, 0]) == pytest.approx(2 * np.pi)
    assert np.ptp(patch.places[:, 1]) == pytest.approx(0.5)
    assert len(patch.facets) == AROUND * LAYERS
    widths = np.ptp(patch.places[patch.facets][..., 0], axis=1)
    np.testing.assert_allclose(widths, CELL, err_msg="a facet is torn by the cut")
    angles = patch.places[patch.points, 0]
    places = state.scene.bodies["hub"].mesh.points[state.contact.points.slave - shaft_nodes(state)]
    np.testing.assert_allclose(np.column_stack([np.cos(angles), np.sin(angles)]), places[:, :2], atol=1e-12)
    assert unrolling.labels(Units()) == ("around z (mm), 0 towards x", "z (mm)")


def shaft_nodes(state: State) -> int:
    return state.scene.bodies["shaft"].mesh.n_nodes


def test_slip_around_the_axis_runs_to_the_right() -> None:
    state = fitted()
    (patch,) = contact_patches([state], 0)
    assert isinstance(patch.flat, Unrolling)
    slips = state.contact.status == Status.SLIP
    assert np.count_nonzero(slips) > AROUND
    sizes = np.linalg.norm(state.contact.slip_in_space[slips], axis=1)
    np.testing.assert_allclose(np.linalg.norm(patch.slip[slips], axis=1), sizes, rtol=1e-6)
    assert np.all(patch.slip[slips, 0] > 0.5 * sizes), "the hub turns from x to y on the shaft"


def test_the_cut_is_opposite_of_the_largest_force() -> None:
    (patch,) = contact_patches([fitted(-0.01)], 0)
    assert isinstance(patch.flat, Unrolling)
    assert abs(patch.flat.middle) < 0.3, "pushed along −x, the hub presses where x is positive"
    assert patch.places[:, 0].max() < np.pi + CELL
    peak = patch.places[np.argmax(patch.pressure), 0]
    assert abs(peak) < 1.0


def test_states_in_one_picture_are_unrolled_alike() -> None:
    patches = contact_patches([fitted(), fitted(-0.01)], 0)
    assert patches[0].flat is patches[1].flat
    assert isinstance(patches[0].flat, Unrolling)
    np.testing.assert_array_equal(patches[0].places, patches[1].places)


def test_points_that_face_away_on_other_surfaces_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fenics_contact.pictures.unrolled.unrolling_of", lambda *_: None)
    (patch,) = contact_patches([fitted()], 0)
    assert isinstance(patch.flat, Projection)
    total = AROUND * (LAYERS + 1)
    assert 0.3 * total < patch.hidden < 0.6 * total
    assert patch.hidden + len(patch.points) == total
    assert patch.behind == f"; {patch.hidden} of {total} closed points face away"


def square(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """The four sides of a square bar along y, nodes and facets."""
    angles = turn + np.pi / 2 * np.arange(4)
    corner = np.column_stack([np.cos(angles), 0 * angles, np.sin(angles)])
    low = np.arange(4)
    ahead = np.roll(low, -1)
    return np.concatenate([corner, corner + np.eye(3)[1]]), np.column_stack([low, ahead, ahead + 4, low + 4])


def test_only_what_runs_around_an_axis_is_unrolled() -> None:
    points, facets = square(0.0)
    force = np.ones(len(points))
    found = unrolling_of(points, facets, points, force)
    assert found is not None, "corners of a square lie on a circle"
    assert found.labels(Units("m")) == ("around y (m), 0 towards z", "y (m)")
    long = points * [1.0, 1.0, 2.0]
    assert unrolling_of(long, facets, long, force) is None, "not round"
    cube = np.concatenate([facets, [[0, 1, 2, 3], [4, 5, 6, 7]]])
    assert unrolling_of(points, cube, points, force) is None, "with its ends"
    slanted = Unrolling(np.zeros(3), np.array([[0.6, 0.8, 0], [0, 0, 1], [0.8, -0.6, 0]]), 1.0, 0.0)
    assert slanted.labels(Units()) == ("around the axis (mm)", "along the axis (mm)")


def test_unrolled_surfaces_are_drawn(tmp_path: Path) -> None:
    state = fitted()
    image = pixels(plot_contact_pressure(state, tmp_path / "pressure.png", width=800))
    assert image.shape[1] == 800
    assert painted(image[:, :600]) > 0.15
    assert painted(pixels(plot_contact_status(state, tmp_path / "status.png", width=800))) > 0.05


def test_a_pair_is_drawn_by_its_name() -> None:
    state = touching_blocks()
    for draw in (plot_contact_pressure, plot_contact_status):
        by_number, slave, both = (
            pixels(draw(state, pair=pair, width=SMALL)) for pair in (0, "upper z0", "upper z0 on lower z1")
        )
        np.testing.assert_array_equal(by_number, slave)
        np.testing.assert_array_equal(by_number, both)
        with pytest.raises(InvalidInputError, match=r"which has 'upper z0 on lower z1'; got 'lower z1'"):
            draw(state, pair="lower z1")


def test_arrows_of_slip_stay_below_titles(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pin that is pushed along its tube: all arrows point along the axis, those at the end beyond it."""
    steel = IsotropicElasticity(1000.0, 0.3)
    pin, tube = cylinder(1.0, 1.5, 2, 3), cylinder(2.0, 1.5, 3, 2, hole=1.0)
    pair = ContactPair(Surface("pin", "outer"), Surface("tube", "inner"), Coulomb(0.1), interference=0.01)
    scene = Scene(
        {"pin": Body(pin, steel), "tube": Body(tube, steel)},
        [Support("tube", "outer"), Support("pin", "bottom", (None, None, 0.1))],
        contacts=[pair],
    )
    state, seen, original = solve_scene(scene, MPI.COMM_SELF), list[Any](), sheet

    @contextmanager
    def kept(*given: Any) -> Iterator[Any]:
        with original(*given) as figure:
            seen.append(figure)
            yield figure

    monkeypatch.setattr(status, "sheet", kept)
    plot_contact_status(state, width=SMALL)
    (axes,) = seen[0].axes
    (arrows,) = (drawn for drawn in axes.collections if isinstance(drawn, Quiver))
    tips = arrows.XY[:, 1] + arrows.V
    assert tips.max() > 1.5 + 0.02, "they reach beyond the surface"
    assert tips.max() <= axes.get_ylim()[1] + 1e-12
