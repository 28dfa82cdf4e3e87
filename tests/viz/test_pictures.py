"""Pictures of subdomains, control nets and optimisations."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, SurfaceDesign, box_partition
from fenics_contact._optimize.result import Record, StepKind
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface, block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.pictures import plot_control_net, plot_convergence, plot_decomposition
from fenics_contact.pictures.designs import _net_layers
from tests.viz.states import contains, painted, pixels

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
        roof().drawn(tmp_path / f"{factor}.png", 0.1, width=SMALL, magnify=factor) for factor in (1.0, 10.0)
    )
    assert once.shape[0] < often.shape[0], "the frame holds the magnified movement"


def test_a_net_that_does_not_move_is_drawn_too(tmp_path: Path) -> None:
    assert painted(roof().drawn(tmp_path / "net.png", 0.0, width=SMALL)) > 0.1


def test_control_net_refuses_a_design_that_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="there are 1 designs, got number 1: count from 0"):
        roof().drawn(tmp_path / "net.png", 0.1, design=1)
    with pytest.raises(InvalidInputError, match="magnify must be finite, got nan: give the factor"):
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
    needed = "needs a positive objective, got -1: leave logarithmic=False"
    with pytest.raises(InvalidInputError, match=needed):
        plot_convergence(history(start=-1.0), logarithmic=True)


@pytest.mark.parametrize("given", [object(), [], [3.0, 2.0]])
def test_convergence_refuses_what_is_no_history(given: Any, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"the records of an optimisation, got \w+: give result"):
        plot_convergence(given, tmp_path / "history.png")
    assert not list(tmp_path.iterdir())
