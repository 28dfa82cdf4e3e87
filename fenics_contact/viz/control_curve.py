"""Picture of a design curve of a plane body and its control points, before and after."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from fenics_contact.viz.colours import GREY, INK, ORANGE, SIGNED_MAP
from fenics_contact.viz.sheet import add_colour_bar, sheet


def draw_control_curve(
    curves: tuple[np.ndarray, np.ndarray],
    nets: tuple[np.ndarray, np.ndarray],
    outward: np.ndarray,
    clim: tuple[float, float],
    words: tuple[str, str, str],
    width: int,
    paper: BinaryIO,
) -> None:
    """Draw a curve and its control points before, in grey, and after, coloured by the outward movement.

    Args:
        curves: Nodes in their order, before and after, (n, 2) each, [length].
        nets: Control points before and after, (n_s, 2) each, [length].
        outward: Outward movement of the nodes, (n,), [length].
        clim: Range of the colours, [length].
        words: Title, what is drawn, unit of length.
        width: Width of the picture in pixels.
        paper: A file opened for bytes.
    """
    title, drawn, unit = words
    every = np.concatenate([*curves, *nets])
    size = np.ptp(every, axis=0)
    height = width * float(np.clip(0.9 * size[1] / max(size[0], 1e-300), 0.2, 0.9))
    with sheet(paper, (width, round(height + 0.1 * width)), title) as figure:
        axes = figure.subplots()
        axes.plot(*curves[0].T, color=GREY, linewidth=1.5)
        axes.plot(*nets[0].T, "o", color=GREY, markersize=6)
        pieces = np.stack([curves[1][:-1], curves[1][1:]], axis=1)
        look = {"cmap": SIGNED_MAP, "norm": Normalize(*clim), "linewidths": 4.0, "capstyle": "round"}
        axes.add_collection(LineCollection(pieces, colors=INK, linewidths=5.0, capstyle="round"))
        axes.add_collection(LineCollection(pieces, array=(outward[1:] + outward[:-1]) / 2, **look))
        axes.plot(*nets[1].T, "o--", color=ORANGE, markersize=10, linewidth=1.0)
        axes.set(title=drawn, xlabel=f"x ({unit})", ylabel=f"y ({unit})")
        axes.set_aspect("equal", adjustable="datalim")
        add_colour_bar(figure, [axes], ScalarMappable(look["norm"], SIGNED_MAP), f"outward movement ({unit})")
