"""Pictures of plane states, of designs before and after, and of sheets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    RigidSurface,
    Roller,
    Scene,
    State,
    Status,
    Surface,
    solve_scene,
    solve_steps,
)
from fenics_contact._base.display import DerivedUnits
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import disc, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.pictures import (
    Picture,
    Units,
    plot_before_after,
    plot_contact_pressure,
    plot_contact_status,
    plot_decomposition,
    plot_stress,
)
from fenics_contact.pictures import designs as before_after
from fenics_contact.pictures import states as status
from fenics_contact.pictures.canvas import (
    GREY,
    ORANGE,
    Frame,
    add_colour_bar,
    axis_label,
    face_on,
    oblique_view,
    png_path,
    sheet,
    show_image,
)
from fenics_contact.pictures.curves import contact_trace, walk
from fenics_contact.pictures.designs import _outlines as profiles
from fenics_contact.pictures.drawing import obstacle_layers, obstacles_of, outline, shade_obstacles
from fenics_contact.pictures.section import refined, strongest_contact
from fenics_contact.pictures.unrolled import contact_patches, label_axes, mirrored, viewing_side
from fenics_contact.shapes import Box, Cone, Plane, SignedDistance, Sphere, SurfaceShape, Torus, Triangulation
from tests.pictures.moving_states import block_among_movers, pressed_by_a_lid
from tests.pictures.plane_states import caged_block, hung_block, pin_in_ring, plane_block
from tests.pictures.states import contains, painted, pixels, pulled, touching_blocks
from tests.scenes import partitions

SMALL = 640


def test_an_open_line_is_walked_from_its_beginning() -> None:
    order, starts = walk(np.array([[7, 2], [9, 7], [2, 4]]))
    assert order.tolist() == [9, 7, 2, 4]
    assert starts.tolist() == [0]


def test_a_closed_line_is_walked_once_and_pieces_one_after_the_other() -> None:
    order, starts = walk(np.array([[0, 1], [1, 2], [2, 0], [5, 4]]))
    assert order[:3].tolist() in ([0, 1, 2], [1, 2, 0], [2, 0, 1])
    assert order[3:].tolist() == [5, 4]
    assert starts.tolist() == [0, 3]


def test_the_trace_of_a_flat_surface_runs_over_x_and_holds_the_forces() -> None:
    state = plane_block()
    trace, contact = contact_trace(state, 0), state.contact
    assert trace.axis == "x"
    assert np.all(np.diff(trace.places) > 0)
    points = state.scene.bodies["block"].mesh.points[contact.points.slave]
    np.testing.assert_allclose(trace.places[trace.points], points[:, 0])
    np.testing.assert_allclose(trace.pressure[trace.points], contact.pressure)
    np.testing.assert_array_equal(trace.status, contact.status)
    assert trace.normal_forces.sum == pytest.approx(contact.normal_force.sum())
    # The floor holds the block back: what it feels points against x.
    dragged = np.abs(contact.friction_force[:, 0]) > 0.1 * np.abs(contact.friction_force).max()
    assert np.count_nonzero(dragged) > 3
    flat = -contact.friction_force[:, 0] * contact.points.tangents[:, 0, 0]
    np.testing.assert_allclose(trace.traction[trace.points] * contact.points.area, flat, atol=1e-12)
    assert trace.shear == pytest.approx(flat.sum())
    assert trace.shear < 0
    assert np.all(np.abs(trace.traction) <= trace.bound + 1e-6 * trace.bound.max())
    # Points that slip move on the floor against the traction that they feel.
    slips = trace.status == Status.SLIP
    assert np.count_nonzero(slips) > 0
    assert np.all(trace.slip[slips] * trace.traction[trace.points[slips]] < 0)
    assert np.abs(trace.slip[slips]).max() == pytest.approx(np.abs(contact.slip[slips]).max())


def test_the_window_of_a_trace_holds_what_is_closed() -> None:
    trace = contact_trace(plane_block(), 0)
    low, high = trace.window()
    closed = trace.places[trace.pressure > 0]
    assert trace.places[0] <= low < closed.min() + 1e-12
    assert closed.max() - 1e-12 < high <= trace.places[-1]
    low, high = trace.window(0.1)
    assert high - low == pytest.approx(0.2)


def test_the_window_of_a_small_contact_holds_the_open_nodes_beside_it() -> None:
    """So that curves end at zero, not in the air."""
    trace = contact_trace(plane_block(), 0)
    small = replace(trace, pressure=np.where(np.isin(np.arange(25), (10, 11, 12)), 1.0, 0.0))
    assert small.window() == (trace.places[9], trace.places[13])


def test_the_trace_of_a_ring_runs_along_it() -> None:
    trace = contact_trace(pin_in_ring(), 0)
    assert trace.axis == "along the surface"
    assert len(trace.places) == len(trace.points) == 24
    np.testing.assert_allclose(np.diff(trace.places), 2 * np.sin(np.pi / 24))
    np.testing.assert_allclose(trace.pressure, trace.pressure.mean(), rtol=1e-3)


def test_tractions_of_a_body_that_turns_are_those_along_its_surface() -> None:
    """A rubber ring whose rigid core has turned by a right angle, pressed on a floor and pushed along it."""
    ring = Body(disc(2.0, 4, hole=1.2), NeoHooke(1.0, 0.3))
    floor = RigidPlane((0.0, -2.0), (0.0, 1.0))
    pair = ContactPair(Surface("ring", "outer"), floor, Coulomb(0.3))

    def held(*motion: float) -> list[RigidSurface]:
        return [RigidSurface("ring", "inner", (0.0, 0.0), motion[:2], motion[2])]

    problem = ContactProblem(Scene({"ring": ring}, held(0.0, 0.0, 0.0), contacts=[pair]), MPI.COMM_SELF)
    turn = 0.5 * np.pi
    steps = [
        LoadStep("turned", supports=held(0.0, 0.0, turn)),
        LoadStep("pressed", supports=held(0.0, -0.3, turn)),
        LoadStep("pushed", supports=held(0.2, -0.3, turn)),
    ]
    state = solve_steps(problem, steps)[-1]
    trace, contact = contact_trace(state, 0), state.contact
    push = state.resultants().friction["ring outer"].force[0]
    assert push < -0.01
    assert abs(trace.shear) == pytest.approx(-push, rel=1e-9)
    slips = trace.points[contact.status == Status.SLIP]
    assert len(slips) > 0
    np.testing.assert_allclose(np.abs(trace.traction[slips]), trace.bound[slips], rtol=1e-6)


def test_a_surface_that_runs_against_x_is_shown_forwards() -> None:
    """The upper edge of a body runs against x: the body lies on its left."""
    state = hung_block()
    trace = contact_trace(state, 0)
    assert trace.axis == "x"
    assert np.all(np.diff(trace.places) > 0)
    points = state.scene.bodies["block"].mesh.points[state.contact.points.slave]
    np.testing.assert_allclose(trace.places[trace.points], points[:, 0])


def test_small_triangles_keep_the_integral() -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (3, 2))
    values = mesh.points[:, 0] * mesh.points[:, 1]
    cut, shown = refined(mesh.points, mesh.cells, values)
    corners = np.column_stack([cut.x, cut.y])[cut.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.min() > 0
    assert area @ shown[cut.triangles].mean(axis=1) == pytest.approx(1.0, rel=0.003)


def test_plane_stress_pictures_show_bodies_and_floor(tmp_path: Path) -> None:
    state = plane_block("triangle")
    smooth = pixels(plot_stress(state, tmp_path / "smooth.png", width=SMALL))
    cells = pixels(plot_stress(state, tmp_path / "cells.png", width=SMALL, smooth=False))
    assert smooth.shape[1] == SMALL
    assert painted(smooth) > 0.25
    assert contains(smooth, "#e3e6e8"), "the floor is shaded"
    assert np.abs(smooth - cells).max() > 0.1


def test_a_small_contact_is_shown_at_a_larger_scale_beside_the_bodies(tmp_path: Path) -> None:
    state = plane_block()
    alone = pixels(plot_stress(state, tmp_path / "alone.png", width=SMALL, sections=False))
    both = pixels(plot_stress(state, tmp_path / "both.png", width=SMALL, reach=0.2))
    assert both.shape != alone.shape
    assert painted(both) > 0.2


def test_contact_pictures_show_pressure_and_with_friction_its_traction(tmp_path: Path) -> None:
    image = pixels(plot_contact_pressure(plane_block(), tmp_path / "rubs.png", width=1200))
    smooth = pixels(plot_contact_pressure(plane_block(friction=0.0), tmp_path / "smooth.png", width=1200))
    assert image.shape[0] > 1.4 * smooth.shape[0], "a second diagram for the traction"
    for colour in ("#0072b2", "#d55e00"):
        assert contains(image, colour)
    assert contains(image, "#e3e6e8"), "between the slip bounds"
    assert not contains(smooth, "#e3e6e8", 0.01)


def test_slip_at_both_ends_of_a_surface_alone_is_drawn(tmp_path: Path) -> None:
    """A hub on a shaft slips at its edges, where the diagram ends."""
    steel = IsotropicElasticity(2.1e5, 0.3)
    meshes = {"shaft": rectangle((0, 0), (10, 60), (3, 13)), "hub": rectangle((10, 20), (25, 40), (4, 7))}
    pair = ContactPair(Surface("hub", "x0"), Surface("shaft", "x1"), Coulomb(0.2), interference=0.02)
    scene = Scene(
        {name: Body(mesh, steel, axisymmetric=True) for name, mesh in meshes.items()},
        [Roller("shaft", "y0")],
        contacts=[pair],
    )
    state = solve_scene(scene, MPI.COMM_WORLD)
    places = scene.points[state.contact.points.slave][:, 1]
    assert set(places[state.contact.status == Status.SLIP].round(9)) == {20.0, 40.0}
    assert contains(pixels(plot_contact_pressure(state, tmp_path / "hub.png", width=SMALL)), "#d55e00")
    trace = contact_trace(state, 0)
    assert trace.axis.strip("−") == "z"
    assert DerivedUnits.of("N", "mm", trace.space).per == " per revolution"


def test_plane_subdomains_have_colours_of_their_own(tmp_path: Path) -> None:
    first, second = rectangle((0, 0), (2, 1), (4, 2)), rectangle((2.2, 0), (4, 1), (4, 2))
    material = PlaneStrain(1.0, 0.3)
    scene = Scene({"first": Body(first, material), "second": Body(second, material)})
    halves = {"first": np.repeat([0, 1], 4), "second": np.zeros(8, dtype=int)}
    whole = pixels(plot_decomposition(scene, halves, tmp_path / "parts.png", width=SMALL))
    exploded = pixels(plot_decomposition(scene, halves, tmp_path / "exploded.png", width=SMALL, explode=0.3))
    for colour in ("#1f77b4", "#aec7e8", "#ff7f0e"):
        assert contains(whole, colour)
    assert painted(exploded) < painted(whole) - 0.05


# Before and after an optimisation: the same colours, and outlines that moved by what the design moved.
WIDTH = 700
RISE = 0.012


@lru_cache(maxsize=2)
def raised(dim: int) -> State:
    """The blocks, or the plane block, with their contact surfaces bent by up to `RISE`."""
    first = touching_blocks() if dim == 3 else plane_block()
    scene, bodies = first.scene, dict(first.scene.bodies)
    name = "lower" if dim == 3 else "block"
    mesh = bodies[name].mesh
    points = mesh.points.copy()
    low, high = points[:, -1].min(), points[:, -1].max()
    weight = (points[:, -1] - low) / (high - low) if dim == 3 else (high - points[:, -1]) / (high - low)
    along = (points[:, 0] - points[:, 0].min()) / np.ptp(points[:, 0])
    # Away from the other body, which must not be overlapped.
    points[:, -1] += (RISE if dim == 2 else -RISE) * weight * along
    bodies[name] = replace(bodies[name], mesh=mesh.moved(points))
    cut = partitions(scene) if dim == 3 else None
    return solve_scene(replace(scene, bodies=bodies), MPI.COMM_SELF, partitions=cut, tolerance=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_pressures_and_outlines_of_both_are_drawn(dim: int, tmp_path: Path) -> None:
    first = touching_blocks() if dim == 3 else plane_block()
    image = pixels(plot_before_after(first, raised(dim), tmp_path / "both.png", width=WIDTH))
    assert image.shape[1] == WIDTH
    assert painted(image) > 0.05
    assert contains(image, ORANGE, 0.1)
    assert contains(image, GREY, 0.1)


@pytest.mark.parametrize("dim", [2, 3])
def test_outlines_move_as_the_design_does(dim: int) -> None:
    first = touching_blocks() if dim == 3 else plane_block()
    found = profiles(first, raised(dim), None, "mm")
    assert len(found) == dim - 1
    largest = 0.0
    for profile in found:
        assert set(profile.before) == set(first.scene.bodies)
        assert profile.largest <= RISE + 1e-12
        largest = max(largest, profile.largest)
        size = float(np.max(profile.frame.size))
        assert profile.factor * profile.largest < 0.1 * size
    assert largest > 0.3 * RISE, "hardly anything moved: nothing was tested"
    still = profiles(first, first, None, "mm")
    assert all(profile.largest == 0 and profile.factor == 1 for profile in still)


def test_outlines_after_are_drawn_in_true_scale_and_magnified() -> None:
    (profile,) = profiles(plane_block(), raised(2), None, "mm")
    axes = Figure().subplots()
    profile.draw(axes, profile.factor, Units())
    lines = {each.get_label(): np.array(each.get_segments()) for each in axes.collections}
    assert profile.factor > 1.0
    words = ["before", f"after, movement × {profile.factor:g}", "after"]
    name = next(iter(profile.before))
    for word, factor in zip(words, (0.0, profile.factor, 1.0), strict=True):
        np.testing.assert_allclose(lines[word], profile.before[name] + factor * profile.moves[name])


def test_a_section_cuts_the_outline_where_it_is() -> None:
    for profile in profiles(touching_blocks(), raised(3), None, "mm"):
        ends = profile.before["lower"].reshape(-1, 2)
        points = touching_blocks().scene.bodies["lower"].mesh.points
        assert axis_label(profile.view.up) == "z"
        assert ends[:, 1].min() == pytest.approx(points[:, 2].min())
        assert ends[:, 1].max() == pytest.approx(points[:, 2].max(), abs=0.01)


def test_names_stand_in_their_bodies() -> None:
    scene = touching_blocks().scene
    for profile in profiles(touching_blocks(), raised(3), None, "mm"):
        axes = Figure().subplots()
        profile.draw(axes, profile.factor, Units())
        places = {text.get_text(): text.get_position()[1] for text in axes.texts}
        for name, body in scene.bodies.items():
            z = body.mesh.points[:, 2]
            assert z.min() + 0.1 * np.ptp(z) < places[name] < z.max() - 0.1 * np.ptp(z)


def test_the_title_says_by_how_much_the_objective_fell(monkeypatch: pytest.MonkeyPatch) -> None:
    titles: list[str] = []
    draw = before_after.sheet  # type: ignore[attr-defined]

    def noted(paper: Any, size: Any, title: str) -> Any:
        titles.append(title)
        return draw(paper, size, title)

    monkeypatch.setattr(before_after, "sheet", noted)
    monkeypatch.setattr(before_after, "DesignPoint", SimpleNamespace)
    first = SimpleNamespace(value=-100.0, state=plane_block())
    best = SimpleNamespace(value=-112.0, state=raised(2))
    plot_before_after(first, best, label="energy (N mm)", title="Block", width=WIDTH)  # type: ignore[arg-type]
    assert titles[0].startswith("Block: energy (N mm) −100.000 → −112.000, 12.00 % lower; largest pressure")
    assert "; seat gives way by 0.0056 mm" in titles[0]
    for point in (first, best):
        point.value = point.state.contact.pressure.max()
    plot_before_after(first, best, label="peak (MPa)", title="Block", width=WIDTH)  # type: ignore[arg-type]
    assert "largest pressure" not in titles[1], "the objective says it already"


def test_a_seat_that_moved_by_rounding_does_not_give_way() -> None:
    first, contact = plane_block(), plane_block().contact
    for change, expected in ((1.8e-11, 0.0), (1e-6, 1e-6)):
        points = replace(contact.points, gap=contact.points.gap - change)
        after: Any = SimpleNamespace(contact=replace(contact, points=points), scene=first.scene)
        retreat = before_after._retreat(first, after, 0)  # type: ignore[attr-defined]
        assert -retreat == pytest.approx(expected, rel=0.1, abs=0.0)


def test_what_does_not_belong_together_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"must have the same bodies and cells, got .* and "):
        plot_before_after(plane_block(), touching_blocks())
    with pytest.raises(InvalidInputError, match=r"pair must be below 1, got 1: draw"):
        plot_before_after(plane_block(), raised(2), pair=1)
    with pytest.raises(InvalidInputError, match=r"pair must be below 0, got 0"):
        plot_before_after(pulled("triangle6"), pulled("triangle6"))


# Sheets have the size asked for, and drawing leaves no trace in matplotlib's settings.
def drawn(
    size: tuple[int, int], title: str, draw: Callable[[Any], object] = lambda figure: None
) -> np.ndarray:
    """Return the pixels of a sheet."""
    paper = BytesIO()
    with sheet(paper, size, title) as figure:
        draw(figure)
    return pixels(Picture(paper.getvalue()))


def test_a_sheet_has_the_size_asked_for_and_a_title() -> None:
    assert drawn((320, 200), "title").shape == (200, 320, 3)
    assert np.any(drawn((320, 200), "title") < 0.5), "the title is missing"
    assert not np.any(drawn((320, 200), "") < 0.5)


def test_an_image_keeps_its_proportions_and_its_coordinates() -> None:
    frame = Frame(np.array([1.0, 2.0]), np.array([4.0, 3.0]))
    image = np.full((20, 60, 3), 128, dtype=np.uint8)

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        show_image(axes, image, frame)
        assert (axes.get_xlim(), axes.get_ylim()) == ((1.0, 4.0), (2.0, 3.0))
        axes.set_axis_off()

    found = drawn((800, 600), "", draw)
    grey = np.all(np.abs(found - 128 / 255) < 0.02, axis=-1)
    width, height = (np.count_nonzero(np.any(grey, axis=axis)) for axis in (0, 1))
    assert width == pytest.approx(3 * height, rel=0.03)


@pytest.mark.parametrize(
    ("beyond", "ends"),
    [((0.0, 515.0), "max"), ((-2.0, 515.0), "both"), ((-2.0, 400.0), "min"), (None, "neither")],
)
def test_a_bar_is_pointed_where_values_lie_beyond_its_colours(
    beyond: tuple[float, float] | None, ends: str
) -> None:
    def draw(figure: Any) -> None:
        panel, key = figure.subplots(), ScalarMappable(Normalize(0, 400))
        add_colour_bar(figure, [panel], key, "σ", beyond=beyond)
        assert key.colorbar.extend == ends

    drawn((640, 400), "", draw)


def test_an_axis_that_runs_backwards_says_so() -> None:
    labels = []

    def draw(figure: Any) -> None:
        for view, turned in (
            (face_on(np.array([0.0, 0.0, -1.0])), viewing_side),
            (face_on(np.array([0.0, 0.0, -1.0])), mirrored),
            (face_on(np.array([1.0, 0.0, 0.0])), viewing_side),
        ):
            axes = figure.subplots()
            axes.set_xlim(0.0, 2.0)
            label_axes(axes, view, Units(), turned)
            labels.append((axes.get_xlabel(), axes.get_ylabel(), axes.xaxis_inverted()))

    drawn((640, 400), "", draw)
    assert labels == [
        ("x (mm), runs to the left: seen from −z", "y (mm)", False),
        ("x (mm)", "y (mm)", True),
        ("y (mm)", "z (mm)", False),
    ]


def test_a_title_that_is_too_long_is_made_smaller() -> None:
    for words in ("short", "a title of very many words " * 6):
        ink = np.flatnonzero(np.any(drawn((640, 200), words) < 0.5, axis=(0, 2)))
        assert ink.size > 20
        assert 0.005 * 640 < ink.min()
        assert ink.max() < 0.995 * 640


def test_settings_of_the_user_neither_matter_nor_change() -> None:
    plain = drawn((320, 200), "title")
    with mpl.rc_context({"font.size": 40, "figure.facecolor": "black"}):
        before = dict(mpl.rcParams)
        odd = drawn((320, 200), "title")
        assert dict(mpl.rcParams) == before
    np.testing.assert_array_equal(plain, odd)


@pytest.mark.parametrize("name", ["picture.jpg", "picture"])
def test_only_png_files_are_written(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"pictures are PNG files, got the name .* end in '\.png'"):
        png_path(name)


# Rigid obstacles in pictures, and maps of the status.
def test_obstacles_in_space_are_drawn_where_they_are() -> None:
    state = caged_block()
    points, obstacles = state.scene.bodies["block"].mesh.points, obstacles_of(state)
    view = oblique_view(points)
    layers, corners = obstacle_layers(obstacles, points, view)
    assert [type(obstacle).__name__ for obstacle in obstacles] == [
        "RigidPlane", "RigidSphere", "RigidCylinder", "DistanceObstacle", "RigidPlane"
    ]  # fmt: skip
    # The floor as sheet and edge; ball and bar by circles and lines; of the front wall, which would hide all
    # as it lies between the viewer and the block, the edge. The distance by ten sections.
    assert view.towards[1] < 0
    assert len(layers) == 2 + 3 + 6 + 10 + 1
    assert corners.shape == (10, 3)
    shown = [0] * 2 + [1] * 3 + [2] * 6 + [3] * 10 + [4]
    for number, layer in zip(shown, layers, strict=True):
        away = obstacles[number].distance(np.asarray(layer.mesh.points))
        np.testing.assert_allclose(away, 0.0, atol=0.01 if number == 3 else 1e-6)


def test_outlines_in_the_plane_are_an_edge_and_a_circle() -> None:
    points = np.array([[0.0, 0.0], [2.0, 1.0]])
    disc = Sphere((1.0, 3.0), 0.5)
    (edge,), (circle,) = outline(Plane((0.0, 0.0), (0.0, 1.0)), points), outline(disc, points)
    np.testing.assert_allclose(np.sort(edge[:, 0]), [-0.12, 2.12])
    np.testing.assert_allclose(disc.distance(circle), 0.0, atol=1e-12)


TIPS = np.array([[0.2, 0.2, 0.8], [1.8, 0.2, 0.8], [0.2, 1.8, 0.8], [1.0, 1.0, 2.0]])
SOLIDS: dict[str, SurfaceShape] = {
    "cone": Cone((1.1, 0.9, 1.2), (0.1, 0.0, 1.0), 1.0, radius=0.2),
    "torus": Torus((1.0, 1.0, 1.3), (0.0, 0.0, 1.0), 0.6, 0.3),
    "triangles": Triangulation(TIPS, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])),
    "ring of my own": SignedDistance(lambda x: np.hypot(x[:, 0] - 1.0, x[:, 2] - 1.5) - 0.7),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_obstacles_of_any_shape_are_sections_near_the_bodies(name: str) -> None:
    points, shape = np.array([[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]]), SOLIDS[name]
    lines = np.concatenate(outline(shape, points))
    away = np.abs(shape.distance(lines))
    assert np.quantile(away, 0.9) < 0.01
    assert away.max() < 0.07, "at sharp edges, that of two samples"
    assert lines.min() >= -0.5 - 1e-12
    assert lines.max() <= 2.5 + 1e-12
    assert np.ptp(lines, axis=0).min() > 0.2, "in all directions"


def test_boxes_are_drawn_by_the_edges_of_their_faces() -> None:
    box = Box((1.0, 2.0, 3.0), (2.0, 3.0, 4.0), radius=0.5, rotation=(0.1, 0.2, 0.3))
    loops = outline(box, np.zeros((1, 3)))
    assert len(loops) == 6
    np.testing.assert_allclose(box.distance(np.concatenate(loops)), 0.0, atol=1e-12)
    assert sum(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum() for loop in loops) == pytest.approx(48.0)
    assert outline(Box((0.0, 0.0), (1.0, 1.0)), np.zeros((1, 2))) == []


def test_obstacles_that_move_are_drawn_where_they_are_in_each_state() -> None:
    for state, time in zip(block_among_movers(), (0.0, 0.5, 1.0), strict=True):
        points = state.scene.bodies["block"].mesh.points
        there = [pair.master.at(time) for pair in state.scene.contacts]  # type: ignore[union-attr]
        layers, corners = obstacle_layers(obstacles_of(state), points, oblique_view(points))
        assert corners.shape == (5, 3)
        for number, layer in zip([0] * 2 + [1] * 3 + [2] * 6, layers, strict=True):
            np.testing.assert_allclose(there[number].distance(np.asarray(layer.mesh.points)), 0.0, atol=1e-6)
        assert np.ptp(corners[:, 2]) == pytest.approx(np.sin(0.05 * time) * np.ptp(corners[:, 0]), rel=2e-3)


def test_a_picture_in_the_plane_shades_an_obstacle_where_it_has_moved(tmp_path: Path) -> None:
    state, axes = pressed_by_a_lid(), Figure().add_subplot()
    shade_obstacles(axes, obstacles_of(state), Frame(np.array([0.0, 0.0]), np.array([2.0, 2.0])))
    *_, line = axes.collections
    (edge,) = line.get_paths()
    np.testing.assert_allclose(edge.vertices[:, 1], 0.9, atol=1e-9)
    assert contains(pixels(plot_stress(state, tmp_path / "lid.png", width=640)), "#e3e6e8"), "the lid"


def test_a_scene_with_obstacles_is_drawn(tmp_path: Path) -> None:
    image = pixels(plot_stress(caged_block(), tmp_path / "caged.png", width=640))
    assert painted(image) > 0.3
    assert contains(image, "#e3e6e8"), "the floor"


def test_bodies_on_obstacles_are_drawn_in_true_scale(tmp_path: Path) -> None:
    left, true, large = (
        pixels(plot_stress(plane_block(), tmp_path / f"{k}.png", width=640, **options))
        for k, options in enumerate([{}, {"scale": 1.0}, {"scale": 10.0}])
    )
    np.testing.assert_array_equal(left, true)
    assert large.shape != true.shape or np.abs(large - true).max() > 0.1


def test_where_normals_cancel_the_strongest_point_gives_the_direction() -> None:
    angle = 2 * np.pi * np.arange(12) / 12
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    mirrors = np.zeros((12, 3), dtype=bool)
    points = SimpleNamespace(pair=np.zeros(12, dtype=int), normal=normal, area=np.ones(12), symmetric=mirrors)
    force = np.where(np.arange(12) == 3, 1.0 + 1e-6, 1.0)
    spot = strongest_contact(SimpleNamespace(normal_force=force, points=points), normal)
    np.testing.assert_allclose(spot.normal, normal[3], atol=1e-12)


def test_of_a_quarter_of_a_bore_the_sections_are_those_of_the_whole() -> None:
    angle = np.pi / 2 * np.linspace(0, 1, 5)
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(5)])
    mirrors = np.abs(normal) < 1e-12
    mirrors[:, 2] = False
    points = SimpleNamespace(pair=np.zeros(5, dtype=int), normal=normal, area=np.ones(5), symmetric=mirrors)
    force = np.array([1.0, 2.0, 3.0, 2.0, 1.5])
    places = normal + np.array([0, 0, 7])
    spot = strongest_contact(SimpleNamespace(normal_force=force, points=points), places)
    np.testing.assert_allclose(spot.centre, [0, 0, 7], atol=1e-12)
    np.testing.assert_allclose(spot.normal, [0, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(spot.inside, [1, 1, 0])


def test_status_maps_show_stick_and_slip_of_each_state(tmp_path: Path) -> None:
    state = touching_blocks()
    one = pixels(plot_contact_status(state, tmp_path / "one.png", width=1200))
    four = pixels(plot_contact_status(dict.fromkeys("abcd", state), tmp_path / "four.png", width=1200))
    for colour in ("#0072b2", "#d55e00"):
        assert contains(one, colour)
        assert contains(four, colour)


def test_points_without_friction_have_no_arrows() -> None:
    patch = contact_patches([touching_blocks()], 0)[0]
    assert 0 < np.count_nonzero(patch.slips) < len(patch.status)
    assert patch.largest_slip > 0.0
    assert replace(patch, rubs=False).largest_slip == 0.0


def test_status_maps_refuse_what_they_cannot_show(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"maps of the status need a state, got none"):
        plot_contact_status({}, tmp_path / "maps.png")
    with pytest.raises(InvalidInputError, match=r"states in space with contact pair 1, got 'a'"):
        plot_contact_status({"a": touching_blocks()}, tmp_path / "maps.png", pair=1)
    with pytest.raises(InvalidInputError, match=r"states in space with contact pair 0, got 'flat'"):
        plot_contact_status({"flat": plane_block()}, tmp_path / "maps.png")
    assert not list(tmp_path.iterdir())


def test_a_map_of_one_state_says_its_title_once(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    state = touching_blocks()

    @contextmanager
    def kept(paper: BinaryIO, size: tuple[int, int], title: str) -> Iterator[Figure]:
        with sheet(paper, size, title) as figure:
            yield figure
            texts.extend([title, *(axes.get_title() for axes in figure.axes)])

    monkeypatch.setattr(status, "sheet", kept)
    plot_contact_status(state, title="Pressed")
    assert sum(text.count("Pressed") for text in texts) == 1
    texts.clear()
    plot_contact_status({"first": state, "second": state}, title="Pressed")
    assert [text.splitlines()[0] for text in texts] == ["Pressed", "first", "second"]
