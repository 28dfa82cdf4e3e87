"""Pictures of meshes, nets and convergence: what is drawn, and what is refused."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from mpi4py import MPI

from fenics_contact import Body, Scene, SurfaceDesign, box_partition
from fenics_contact import pictures as viz
from fenics_contact._optimize.result import Record, StepKind
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface, block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.pictures import (
    Picture,
    plot_control_net,
    plot_convergence,
    plot_curves,
    plot_decomposition,
)
from fenics_contact.pictures.canvas import (
    SHOWN_WIDTH,
    axis_label,
    checked_range,
    face_on,
    frame_around,
    headline,
    nice_number,
    oblique_view,
    written,
)
from fenics_contact.pictures.designs import _net_layers
from fenics_contact.pictures.section import cells_of, drawn_bodies, lengths, moved, nodal
from fenics_contact.results.multi_block import body_grid
from tests.pictures.states import contains, painted, pixels, pulled, touching_blocks

SMALL = 320
STEEL = IsotropicElasticity(2.1e5, 0.3)


def two_bodies() -> tuple[Scene, dict[str, np.ndarray]]:
    """Two blocks side by side, of four and two subdomains."""
    first, second = block((0, 0, 0), (2, 1, 1), (4, 2, 2)), block((2.2, 0, 0), (4, 1, 1), (4, 2, 2))
    partitions = {"first": box_partition(first, (2, 1, 2)), "second": box_partition(second, (2, 1, 1))}
    return Scene({"first": Body(first, STEEL), "second": Body(second, STEEL)}), partitions


def test_decomposition_shows_every_subdomain_in_a_colour_of_its_own(tmp_path: Path) -> None:
    image = pixels(plot_decomposition(*two_bodies(), tmp_path / "parts.png", width=SMALL))
    assert image.shape[1] == SMALL
    assert painted(image) > 0.3
    blue, orange = image[..., 2] - image[..., 0], image[..., 0] - image[..., 2]
    green, red = image[..., 1] - image[..., 0], image[..., 0] - image[..., 1]
    for name, hue in {"blue": blue, "orange": orange, "green": green, "red": red}.items():
        assert np.mean(hue > 0.2) > 0.02, name


def test_exploded_subdomains_show_what_is_behind_them(tmp_path: Path) -> None:
    whole = pixels(plot_decomposition(*two_bodies(), tmp_path / "whole.png", width=SMALL))
    exploded = pixels(plot_decomposition(*two_bodies(), tmp_path / "exploded.png", width=SMALL, explode=0.3))
    assert painted(exploded) < painted(whole) - 0.05


def test_decomposition_refuses_partitions_that_do_not_fit(tmp_path: Path) -> None:
    scene, partitions = two_bodies()
    with pytest.raises(InvalidInputError, match=r"partitions\['second'\] must have shape \(16,\).*got none"):
        plot_decomposition(scene, {"first": partitions["first"]}, tmp_path / "parts.png")
    with pytest.raises(InvalidInputError, match=r"partitions\['first'\] must have shape \(16,\).*got \(3,\)"):
        plot_decomposition(scene, {**partitions, "first": np.zeros(3, int)}, tmp_path / "parts.png")
    with pytest.raises(InvalidInputError, match=r"explode must be at least 0 and below 1, got 1"):
        plot_decomposition(scene, partitions, tmp_path / "parts.png", explode=1.0)
    assert not list(tmp_path.iterdir())


class Moved:
    """A problem whose only body is a design surface."""

    comm = MPI.COMM_SELF

    def __init__(self, points: np.ndarray, normals: np.ndarray, counts: tuple[int, ...], net: Any) -> None:
        ticks = np.meshgrid(*(np.linspace(0, 1, count) for count in counts), indexing="ij")
        parameters = np.column_stack([each.ravel() for each in ticks])
        surface = DesignSurface(np.arange(len(points)), parameters, normals, counts)
        self.designs = (SurfaceDesign("roof", surface, net),)
        self.scene = SimpleNamespace(bodies={"roof": SimpleNamespace(mesh=SimpleNamespace(points=points))})
        self.points = points

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        (design,) = self.designs
        return {"roof": self.points + (design.basis @ alpha)[:, None] * design.lattice.directions}

    def drawn(self, path: Path, size: float, **options: Any) -> np.ndarray:
        """Return the picture of the net whose middle control point moves outwards."""
        alpha = np.zeros(self.designs[0].size)
        alpha[len(alpha) // 2] = size
        return pixels(plot_control_net(self, alpha, path, **options))  # type: ignore[arg-type]


def roof() -> Moved:
    """A bent sheet of 9 x 5 nodes and a net of 5 x 3 control points."""
    s, t = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 5), indexing="ij"))
    points = np.column_stack([4 * s, 2 * t, np.sin(np.pi * s)])
    normals = np.column_stack([-np.pi / 4 * np.cos(np.pi * s), 0 * s, np.ones(45)])
    return Moved(points, normals / np.linalg.norm(normals, axis=1)[:, None], (9, 5), (5, 3))


def test_control_net_is_drawn_before_and_after(tmp_path: Path) -> None:
    image = roof().drawn(tmp_path / "net.png", 0.1, width=600)
    assert image.shape[1] == 600
    before, after = image[:, :270], image[:, 270:540]
    assert painted(before) > 0.1
    violet = [np.mean(part[..., 2] - part[..., 1] > 0.1) for part in (before, after)]
    assert violet[0] < 0.005, "nothing has moved before"
    assert violet[1] > 0.02, "outward movement is violet"


def test_magnified_movement_is_seen_larger(tmp_path: Path) -> None:
    once, often = (
        roof().drawn(tmp_path / f"{factor}.png", 0.1, width=SMALL, magnify=factor) for factor in (1.0, 40.0)
    )
    assert once.shape[0] < often.shape[0], "the frame holds the magnified movement"


def test_a_net_that_does_not_move_is_drawn_too(tmp_path: Path) -> None:
    assert painted(roof().drawn(tmp_path / "net.png", 0.0, width=SMALL)) > 0.1


def test_control_net_refuses_a_design_that_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there are 1 designs, got number 1: count from 0"):
        roof().drawn(tmp_path / "net.png", 0.1, design=1)
    with pytest.raises(InvalidInputError, match="magnify must be finite, got nan: give a factor"):
        roof().drawn(tmp_path / "net.png", 0.1, magnify=np.nan)
    assert not list(tmp_path.iterdir())


def test_a_curve_of_a_plane_body_is_drawn_with_its_control_points(tmp_path: Path) -> None:
    s = np.linspace(0.0, 1.0, 21)
    points = np.column_stack([4 * s, np.sin(np.pi * s)])
    curve = Moved(points, np.tile([0.0, 1.0], (21, 1)), (21,), (5,))
    still, moved = (curve.drawn(tmp_path / f"{size}.png", size, width=600) for size in (0.0, 0.1))
    violet = [np.mean(part[..., 2] - part[..., 1] > 0.1) for part in (still, moved)]
    assert violet[1] > violet[0] + 0.002, "outward movement is violet"


@pytest.mark.parametrize(("counts", "bars"), [((5, 3), 8), ((1, 3), 1), ((1, 1), 0)])
def test_a_net_is_drawn_with_straight_bars_between_its_points(counts: tuple[int, int], bars: int) -> None:
    net = np.random.default_rng(7).random((*counts, 3))
    *tubes, points = _net_layers(net, net, "red", 1.0)
    assert points.mesh.n_points > 0
    assert len(tubes) == bars
    for row, tube in zip(net, tubes if counts[1] > 1 else (), strict=False):
        assert np.asarray(tube.mesh.bounds)[::2] == pytest.approx(row.min(axis=0), abs=0.02)


def history(**steps: float) -> list[Record]:
    """Return records of steps of some kinds, such as ``start=2.0, null_1=3.0``, with their values."""
    return [
        Record(0, StepKind(kind.partition("_")[0]), value, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1, 1)
        for kind, value in steps.items()
    ]


HISTORY = history(start=-100.0, serious=-110.0, null=-105.0, rejected=np.nan, serious_2=-112.0)


def test_convergence_marks_serious_and_null_steps(tmp_path: Path) -> None:
    image = pixels(plot_convergence(HISTORY, tmp_path / "history.png", width=1200, title="Chain"))
    assert image.shape[1] == 1200
    assert contains(image, "#0072b2"), "serious steps"
    assert contains(image, "#d55e00", 0.1), "null steps"
    plain = pixels(plot_convergence(history(start=3.0), tmp_path / "start.png", width=1200))
    assert not contains(plain, "#d55e00", 0.1)


def test_a_logarithmic_convergence_leaves_room_beside_a_trial_far_off(tmp_path: Path) -> None:
    steps = history(start=2.0, null=1000.0, serious=1.0)

    def height(logarithmic: bool) -> int:
        path = tmp_path / "history.png"
        image = pixels(plot_convergence(steps, path, logarithmic=logarithmic, width=600))
        blue = np.abs(image - np.array([0, 114, 178]) / 255).max(axis=-1) < 0.02
        return int(np.ptp(np.flatnonzero(blue[:, 60:400].any(axis=1))))

    assert height(True) > 1.5 * height(False) > 0
    needed = "logarithmic=True needs a positive objective, got -1"
    with pytest.raises(InvalidInputError, match=needed):
        plot_convergence(history(start=-1.0), logarithmic=True)


@pytest.mark.parametrize("given", [object(), [], [3.0, 2.0]])
def test_convergence_refuses_what_is_no_history(given: Any, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"history must be result.history of a run, got \w+"):
        plot_convergence(given, tmp_path / "history.png")
    assert not list(tmp_path.iterdir())


# A picture is shown by Jupyter and stands for its file; on ranks that did not draw it shows nothing.
LINE: dict[str, Any] = {"series": {"line": ([0.0, 1.0], [0.0, 2.0])}, "xlabel": "x (mm)", "ylabel": "y (N)"}


def test_every_plot_function_writes_where_it_is_told_and_returns_a_picture() -> None:
    functions = {name: getattr(viz, name) for name in viz.__all__ if name.startswith("plot_")}
    assert len(functions) > 5, "hardly any functions were found: nothing was tested"
    for name, function in functions.items():
        signature = inspect.signature(function)
        assert signature.return_annotation == "Picture", name
        assert signature.parameters["path"].default is None, name
        assert signature.parameters["path"].annotation == "str | Path | None", name


def test_a_picture_without_a_path_writes_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    picture = plot_curves(**LINE, width=400)
    assert picture.png is not None
    assert picture.png.startswith(b"\x89PNG")
    assert picture.path is None
    assert str(picture) == "picture without a file"
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InvalidInputError, match=r"the picture was not written to a file: give plot_"):
        os.fspath(picture)


def test_a_written_picture_stands_for_its_file(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "line.png"
    picture = plot_curves(**LINE, path=path, width=400)
    assert picture.path == path
    assert Path(picture) == path
    assert str(picture) == str(path)
    assert path.read_bytes() == picture.png
    assert picture.size == (400, 240)


def test_a_picture_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "line.png"
    path.write_bytes(b"old")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        plot_curves(**LINE, path=path, width=400)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_jupyter_shows_a_picture_no_wider_than_a_notebook() -> None:
    for across, shown in ((1600, SHOWN_WIDTH), (400, 400)):
        picture = plot_curves(**LINE, width=across)
        data, metadata = DisplayFormatter().format(picture)
        assert data["image/png"] == picture.png
        assert metadata["image/png"] == {"width": shown}


def test_a_rank_that_did_not_draw_shows_nothing() -> None:
    picture = Picture(None, Path("line.png"))
    data, _ = DisplayFormatter().format(picture)
    assert data == {"text/plain": ""}
    assert picture.size is None
    assert str(picture) == "line.png"


# Numbers and titles as readers like them.
@pytest.mark.parametrize(
    ("value", "text"),
    [
        (15360, "15\u202f360"),
        (np.int64(-7), "−7"),
        (79713.4, "79\u202f710"),
        (-0.13849, "−0.1385"),
        (0.0, "0"),
        (1.234e-5, "1.234e−05"),
        (9.99996, "10.000"),
    ],
)
def test_numbers_are_written_with_spaces_and_a_true_minus(value: float, text: str) -> None:
    assert written(value) == text


@pytest.mark.parametrize(
    ("value", "nice"), [(1.0, 1.0), (1.99, 1.0), (2.0, 2.0), (49.0, 20.0), (0.051, 0.05), (0.0, 1.0)]
)
def test_nice_number_is_one_two_or_five_times_a_power_of_ten(value: float, nice: float) -> None:
    assert nice_number(value) == pytest.approx(nice)


def test_headline_starts_with_a_capital() -> None:
    assert headline("", "largest 3") == "Largest 3"
    assert headline("", "σ² / 2E") == "σ² / 2E"
    assert headline("Before", "largest 3") == "Before: largest 3"


@pytest.mark.parametrize("clim", [(1.0, 1.0), (2.0, 1.0), (0.0, np.nan), (-np.inf, 0.0)])
def test_a_range_without_width_is_refused(clim: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"clim must be finite .* widen it"):
        checked_range(clim)


# What is drawn belongs to the nodes and cells it is said to belong to.
def test_nodal_stress_of_a_constant_is_the_constant_and_a_mean_else() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    body = body_grid(mesh, mesh.points)
    body.cell_data["stress"] = np.full(2, 7.0)
    np.testing.assert_allclose(nodal(body, "stress"), 7.0)
    body.cell_data["stress"] = np.array([1.0, 3.0])
    mean = nodal(body, "stress")
    np.testing.assert_allclose(mean[np.isclose(mesh.points[:, 0], 1.0)], 2.0)
    assert set(mean.round(12)) == {1.0, 2.0, 3.0}


def test_drawn_bodies_have_the_fields_of_the_state() -> None:
    state = touching_blocks()
    bodies = drawn_bodies(state)
    assert set(bodies) == {"lower", "upper"}
    for name, body in bodies.items():
        displacement = state.gather_displacement(name)
        np.testing.assert_array_equal(body["displacement"], displacement)
        np.testing.assert_allclose(lengths(body), np.linalg.norm(displacement, axis=1))
        np.testing.assert_array_equal(cells_of(body), state.scene.bodies[name].mesh.cells)
        assert body["von_mises"].min() > 0
        np.testing.assert_allclose(np.sort(body["von_mises"]), np.sort(state.von_mises[name].x.array))
    shifted = moved(bodies, 2.0)["upper"].points - bodies["upper"].points
    np.testing.assert_allclose(shifted, 2 * bodies["upper"]["displacement"], atol=1e-12)


def test_quadratic_cells_are_cut_into_linear_ones_that_repeat_their_values() -> None:
    state = pulled("hexahedron27")
    (body,) = drawn_bodies(state).values()
    whole = state.to_pyvista()["bar"]
    assert body.n_points == whole.n_points
    assert body.n_cells == 8 * whole.n_cells
    np.testing.assert_allclose(body["von_mises"], np.repeat(whole["von_mises"], 8))
    np.testing.assert_allclose(body["stress"], np.repeat(whole["stress"], 8, axis=0))


# Views are right-handed, and frames hold what they should.
RNG = np.random.default_rng(3)


def box(*size: float) -> np.ndarray:
    return RNG.uniform(size=(50, 3)) * size


@pytest.mark.parametrize("size", [(9.0, 2.0, 2.0), (2.0, 9.0, 2.0), (1.0, 2.0, 9.0)])
def test_view_is_a_right_handed_frame(size: tuple[float, float, float]) -> None:
    view = oblique_view(box(*size))
    frame = np.array([view.right, view.up, view.towards])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_longest_horizontal_direction_is_horizontal_in_the_picture() -> None:
    for axis, size in enumerate([(9.0, 2.0, 2.0), (2.0, 9.0, 2.0)]):
        shown = oblique_view(box(*size)).project(np.eye(3))
        assert shown[axis, 0] > 0.5
        assert abs(shown[axis, 1]) < 1e-14
        assert shown[2, 1] > 0.5, "z points up"


def test_what_is_as_long_as_wide_is_seen_alike_whatever_its_rounding() -> None:
    square = np.array([[0.0, 0.0, 0.0], [4.0, 4.0, 3.0]])
    rounded = square + np.outer([0.0, 1e-7], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(oblique_view(rounded).right, oblique_view(square).right, atol=1e-14)


def test_frame_holds_all_points_and_its_margin() -> None:
    points = box(4.0, 2.0, 3.0)
    view = oblique_view(points)
    places, frame = view.project(points), frame_around(view, points, 0.1)
    assert np.all(places > frame.low)
    assert np.all(places < frame.high)
    np.testing.assert_allclose(frame.size - np.ptp(places, axis=0), 0.2 * np.ptp(places, axis=0).max())


@pytest.mark.parametrize(
    ("normal", "right", "up"),
    [((1, 0, 0), "y", "z"), ((0, -2, 0), "x", "z"), ((0, 0, 1), "x", "y"), ((0, 0, -1), "−x", "y")],
)
def test_face_on_keeps_the_axes_upright(normal: tuple[float, ...], right: str, up: str) -> None:
    view = face_on(np.array(normal, dtype=float))
    assert (axis_label(view.right), axis_label(view.up)) == (right, up)


def test_a_slanted_direction_has_no_axis_name() -> None:
    assert axis_label(np.array([0.6, 0.8, 0.0])) == ""


# Diagrams of curves.
X = np.linspace(0.0, 1.0, 11)
NAMES = {"xlabel": "x (mm)", "ylabel": "p (MPa)"}


def test_series_and_reference_are_drawn_apart(tmp_path: Path) -> None:
    series = {"first": (X, X**2), "second": (X, X**3)}
    path = plot_curves(series, tmp_path / "curves.png", reference={"theory": (X, X)}, title="Known", **NAMES)
    image = pixels(path)
    assert image.shape == (720, 1200, 3)
    for colour in ("#0072b2", "#d55e00", "#222222"):
        assert contains(image, colour)
    alone = pixels(plot_curves({"first": (X, X**2)}, tmp_path / "one.png", **NAMES))
    assert not contains(alone, "#d55e00")


def test_points_may_be_connected_and_gaps_left(tmp_path: Path) -> None:
    broken = {"path": (X, np.where(X > 0.5, np.nan, X))}
    loose = pixels(plot_curves(broken, tmp_path / "loose.png", **NAMES))
    bound = pixels(plot_curves(broken, tmp_path / "bound.png", connected=True, **NAMES))
    blue = [np.sum(image[..., 2] - image[..., 0] > 0.5) for image in (loose, bound)]
    assert blue[1] > 1.3 * blue[0]


def test_many_points_become_a_line_and_axes_logarithmic(tmp_path: Path) -> None:
    x = np.geomspace(1.0, 100.0, 200)
    path = plot_curves({"error": (x, 1 / x)}, tmp_path / "log.png", logarithmic=True, width=600, **NAMES)
    assert contains(pixels(path), "#0072b2", 0.05)


@pytest.mark.parametrize(
    ("series", "message"),
    [
        ({}, r"a diagram needs at least one curve, got none"),
        ({"a": (X, X[:3])}, r"curve 'a' must have one value for each place, got \(3,\) for \(11,\)"),
        ({"a": ([], [])}, r"curve 'a' must have one value for each place, got \(0,\) for \(0,\)"),
    ],
)
def test_curves_that_cannot_be_drawn_are_refused(series: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_curves(series, tmp_path / "curves.png", **NAMES)
    assert not list(tmp_path.iterdir())
