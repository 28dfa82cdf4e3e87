"""Pictures of the way to an accuracy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fenics_contact import Body, Level, Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic, refined
from fenics_contact.pictures import canvas, plot_levels, plot_meshes
from tests.pictures.states import painted, pixels

LEVELS = [
    Level(cells, 3 * cells, 5.0 + off, error, 9, 0.5, float("nan"), 5.0 + 2.0 * off, 5.0 + off)
    for cells, off, error in ((10, 1.0, float("inf")), (40, 0.5, 0.25), (160, 0.0, 0.05))
]


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    kept: list[Figure] = []

    def keep(*arguments: object, **options: object) -> Figure:
        kept.append(Figure(*arguments, **options))  # type: ignore[arg-type]
        return kept[-1]

    monkeypatch.setattr(canvas, "Figure", keep)
    return kept


def curves(figure: Figure) -> list[list[tuple[list[float], list[float]]]]:
    return [
        [
            (np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist())
            for line in axes.lines
        ]
        for axes in figure.axes
    ]


def test_estimates_are_drawn_against_unknowns_and_seconds(tmp_path: Path, figures: list[Figure]) -> None:
    image = pixels(plot_levels({"adaptive": LEVELS}, tmp_path / "levels.png", wanted=0.02, width=640))
    assert image.shape[1] == 640
    by_unknowns, by_seconds = curves(figures[0])
    expected = [np.nan, 0.25 / 5.5, 0.01]
    for (x, y), cost in zip((by_unknowns[0], by_seconds[0]), ([30, 120, 480], [0.5, 1.0, 1.5]), strict=True):
        np.testing.assert_allclose(x, cost)
        np.testing.assert_allclose(y, expected)
    assert by_unknowns[1][1] == by_seconds[1][1] == [0.02, 0.02]


def test_true_errors_are_drawn_where_they_are_known(figures: list[Figure]) -> None:
    plot_levels({"adaptive": LEVELS}, exact=5.0, width=640)
    (_, true), (_, estimated) = curves(figures[0])[0]
    np.testing.assert_allclose(true, [0.2, 0.1, np.nan])
    np.testing.assert_allclose(estimated, [np.nan, 0.05, 0.01])


@pytest.mark.parametrize("series", [{}, {"adaptive": []}])
def test_a_picture_of_no_level_is_refused(series: dict[str, list[Level]]) -> None:
    with pytest.raises(InvalidInputError, match="picture of levels needs a level, got none: pass"):
        plot_levels(series)


def plane(count: int) -> Scene:
    meshes = {
        name: rectangle((0.0, low), (2.0, low + 1.0), (count, count), "triangle")
        for name, low in (("lower", 0.0), ("upper", 1.2))
    }
    return Scene({name: Body(mesh, PlaneStrain(1.0, 0.3)) for name, mesh in meshes.items()})


def test_meshes_of_a_plane_are_drawn_beside_each_other(figures: list[Figure]) -> None:
    scenes = {"start": plane(1), "end": plane(3)}
    image = pixels(plot_meshes(scenes, width=640, title="Two"))
    assert painted(image) > 0.2
    left, right = figures[0].axes
    assert [axes.get_title() for axes in (left, right)] == ["start: 4 cells", "end: 36 cells"]
    assert [sum(len(each.get_paths()) for each in axes.collections) for axes in (left, right)] == [4, 36]
    assert left.get_xlim() == right.get_xlim()
    plot_meshes(scenes, bodies=["upper"], around=(0.0, 1.2), reach=0.5, width=640)
    left, right = figures[1].axes
    assert right.get_title() == "end: 18 cells"
    assert left.get_xlim() == (-0.5, 0.5)
    assert left.get_ylim() == pytest.approx((0.7, 1.7))


def test_meshes_in_space_show_their_edges() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1), cell="tetrahedron")
    fine = quadratic(refined(mesh, np.arange(mesh.n_cells)).mesh)
    steel = IsotropicElasticity(1.0, 0.3)
    scenes = [Scene({"block": Body(each, steel)}) for each in (mesh, fine)]
    coarse, dense = (pixels(plot_meshes({"mesh": scene}, width=320)) for scene in scenes)
    dark = [np.mean(image[..., :3].max(axis=2) < 0.5) for image in (coarse, dense)]
    assert 0.0 < dark[0] < 0.7 * dark[1]


def test_meshes_that_cannot_be_compared_are_refused() -> None:
    cube = Scene({"block": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), IsotropicElasticity(1.0, 0.3))})
    with pytest.raises(InvalidInputError, match=r"scenes must have one dimension, got \[2, 3\]"):
        plot_meshes({"a": plane(1), "b": cube})
    with pytest.raises(InvalidInputError, match=r"scenes must have one dimension, got \[\]"):
        plot_meshes({})
    with pytest.raises(
        InvalidInputError, match=r"bodies must be some of \['lower', 'upper'\], got \['low'\]"
    ):
        plot_meshes({"a": plane(1)}, bodies=["low"])
