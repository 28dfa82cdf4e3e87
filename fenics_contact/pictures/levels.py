"""The way to an accuracy: errors against unknowns and seconds, and meshes beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from fenics_contact._base.checks import naming_arguments
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import (
    GREY,
    IN_PLANE,
    INK,
    PALE,
    Frame,
    Layer,
    Picture,
    draw_picture,
    frame_around,
    oblique_view,
    png_path,
    render,
    sheet,
    show_view,
    written,
)
from fenics_contact.pictures.curves import LOOKS
from fenics_contact.pictures.section import cells_of, chosen_bodies, is_plane, points_of
from fenics_contact.results.fields import in_space
from fenics_contact.results.multi_block import body_grid

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact._adaptive.levels import Level


@naming_arguments
def plot_levels(
    series: Mapping[str, Sequence[Level]],
    path: str | Path | None = None,
    *,
    exact: float | None = None,
    wanted: float | None = None,
    title: str = "",
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw relative errors of meshes against their unknowns, and against the seconds up to each.

    Args:
        series: Name -> levels of `solve_to`, such as adaptive beside uniform refinement.
        exact: The quantity, if it is known: its true errors are drawn with symbols, estimates as dashed
            lines; else estimates with symbols. Unknown errors leave a gap.
        wanted: Relative error that was asked for, a dotted line.

    Raises:
        InvalidInputError: If there is no level to draw.

    Example:
        >>> accurate = solve_to(scene, "peak_pressure", 0.01, comm)  # doctest: +SKIP
        >>> plot_levels({"adaptive": accurate.levels}, "levels.png", wanted=0.01)  # doctest: +SKIP
    """
    target = png_path(path)
    if not series or not all(len(levels) for levels in series.values()):
        raise InvalidInputError(
            "a picture of levels needs a level, got none: pass {'adaptive': result.levels}"
        )

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(0.5 * width)), title) as figure:
            panels = figure.subplots(1, 2, sharey=True)
            for (name, levels), (colour, symbol) in zip(series.items(), cycle(LOOKS)):
                best, *others = _errors(levels, exact)
                look = {"color": colour, "lw": 2.0}
                marked = {**look, "marker": symbol, "ms": 7, "markeredgecolor": "white", "label": name}
                for axes, x in zip(panels, _costs(levels), strict=True):
                    axes.plot(x, best, **marked)
                    for estimated in others:
                        axes.plot(x, estimated, "--", **{**look, "lw": 1.2})
            for axes, words in zip(panels, ("unknowns", "seconds of all meshes so far"), strict=True):
                axes.set(xscale="log", yscale="log", xlabel=words)
                axes.grid(color=GREY, alpha=0.3)
                if wanted is not None:
                    axes.axhline(wanted, color=INK, ls=":", lw=1.2)
            panels[0].set_ylabel("relative error" if exact is None else "relative error, dashed: estimate")
            figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)

    return draw_picture(comm, target, draw)


def _costs(levels: Sequence[Level]) -> tuple[list[int], np.ndarray]:
    return [level.unknowns for level in levels], np.cumsum([level.seconds for level in levels])


def _errors(levels: Sequence[Level], exact: float | None) -> list[np.ndarray]:
    """Return true relative errors, where they are known, and estimated ones; NaN where unknown or zero."""
    if exact is None:
        return [_positive(np.array([level.relative_error for level in levels]))]
    value, error = (np.array([getattr(level, name) for level in levels]) for name in ("value", "error"))
    return [_positive(np.abs(value - exact) / abs(exact)), _positive(error / abs(exact))]


def _positive(errors: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(errors) & (errors > 0.0), errors, np.nan)


@naming_arguments
def plot_meshes(
    scenes: Mapping[str, Scene],
    path: str | Path | None = None,
    *,
    bodies: Sequence[str] = (),
    around: Sequence[float] | None = None,
    reach: float | None = None,
    title: str = "",
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the meshes of scenes beside each other, undeformed, all in the same frame.

    Args:
        scenes: Text under which each is shown -> scene, such as the first and the last of `solve_to`.
        bodies: Names of those that are drawn, so that none hides a contact; all unless given.
        around: Middle of what is shown, shape (dim,), [length]; that of the bodies unless given.
        reach: How far the picture reaches from there to each side, [length]; all bodies unless given.

    Raises:
        InvalidInputError: If there is no scene, they have different dimensions, or not all the bodies.

    Example:
        >>> end = solve_to(scene, "peak_pressure", 0.01, comm).state.scene  # doctest: +SKIP
        >>> plot_meshes({"start": scene, "end": end}, "meshes.png", reach=0.5)  # doctest: +SKIP
    """
    target = png_path(path)
    dims = {scene.dim for scene in scenes.values()}
    if len(dims) != 1:
        raise InvalidInputError(f"scenes must have one dimension, got {sorted(dims)}: draw them apart")
    shown = {words: _grids(scene, bodies) for words, scene in scenes.items()}
    every = np.concatenate([points_of(grids) for grids in shown.values()])
    plane = all(is_plane(grid) for grids in shown.values() for grid in grids.values())
    view = IN_PLANE if plane else oblique_view(every)
    frame = frame_around(view, every, 0.04)
    if reach is not None:
        middle = every.mean(axis=0) if around is None else in_space(np.array([around], dtype=float))[0]
        centre = np.array([middle @ view.right, middle @ view.up])
        frame = Frame(centre - reach, centre + reach)

    def draw(paper: BinaryIO) -> None:
        wide = width / len(shown)
        size = width, round(wide / frame.proportion + 0.08 * width)
        with sheet(paper, size, title) as figure:
            every = np.ravel(figure.subplots(1, len(shown)))
            for axes, (words, grids) in zip(every, shown.items(), strict=True):
                if plane:
                    _draw_plane(axes, grids)
                else:
                    layers = [Layer(grid.extract_surface(algorithm=None), _LOOK) for grid in grids.values()]
                    show_view(axes, render(layers, view, frame, round(wide)), frame)
                frame.fit(axes)
                axes.set_axis_off()
                count = sum(scenes[words].bodies[name].mesh.n_cells for name in grids)
                axes.set_title(f"{words}: {written(count)} cells")

    return draw_picture(comm, target, draw)


_LOOK = {
    "color": PALE, "show_edges": True, "edge_color": INK, "line_width": 1, "ambient": 0.75, "diffuse": 0.28
}  # fmt: skip


def _grids(scene: Scene, bodies: Sequence[str]) -> dict[str, pv.UnstructuredGrid]:
    """Return the meshes of the chosen bodies; quadratic cells are cut into linear ones."""
    chosen = chosen_bodies(scene.deforming, bodies or list(scene.deforming))
    meshes = {name: body.mesh for name, body in chosen.items()}
    return {name: body_grid(mesh.linear, in_space(mesh.points)) for name, mesh in meshes.items()}


def _draw_plane(axes: Axes, grids: Mapping[str, pv.UnstructuredGrid]) -> None:
    look = {"facecolors": PALE, "edgecolors": INK, "linewidths": 0.5}
    for grid in grids.values():
        corners = np.asarray(grid.points)[cells_of(grid)][..., :2]
        axes.add_collection(PolyCollection(corners, **look))
