"""Before and after an optimisation: the same colours, and outlines that moved by what the design moved."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from mpi4py import MPI

from fenics_contact import State, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import Units, plot_before_after
from fenics_contact.pictures import designs as before_after
from fenics_contact.pictures.canvas import GREY, ORANGE, axis_label
from fenics_contact.pictures.designs import _outlines as profiles
from tests.contact.gallery import partitions
from tests.viz.plane_states import plane_block
from tests.viz.states import contains, painted, pixels, pulled, touching_blocks

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
    with pytest.raises(InvalidInputError, match=r"must have the same bodies and cells, got .*two designs"):
        plot_before_after(plane_block(), touching_blocks())
    with pytest.raises(InvalidInputError, match=r"pair must number one of .* 1 contact pairs from 0, got 1"):
        plot_before_after(plane_block(), raised(2), pair=1)
    with pytest.raises(InvalidInputError, match=r"pair must number one of the scene's 0 contact pairs"):
        plot_before_after(pulled("triangle6"), pulled("triangle6"))
