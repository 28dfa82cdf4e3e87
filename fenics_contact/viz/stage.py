"""Rendering of meshes to an image array with pyvista, off screen, on white, in parallel projection."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyvista as pv

from fenics_contact.viz.colours import INK
from fenics_contact.viz.renderer import rendering
from fenics_contact.viz.view import Frame, View

#: Images are rendered at this multiple of the resolution: matplotlib then smooths edges alike on all
#: machines.
SUPERSAMPLING = 2
#: Side of the corner with the directions of the axes, relative to the smaller side of an image.
AXES = 0.3


@dataclass(frozen=True)
class Layer:
    """A mesh and how to draw it."""

    mesh: pv.DataSet
    options: Mapping[str, Any] = field(default_factory=dict)


def balls(points: np.ndarray, radius: float) -> pv.PolyData:
    """Return points (n, 3) as spheres."""
    return pv.PolyData(np.asarray(points)).glyph(geom=pv.Sphere(radius=radius), scale=False, orient=False)


def render(
    layers: Iterable[Layer], view: View, frame: Frame, width: int, *, axes: bool = False
) -> np.ndarray:
    """Render one image of ``width`` pixels, with the directions of the axes in its corner if requested.

    The proportions of the frame are those of the image.

    Returns:
        Image, (height, width, 3) uint8, at `SUPERSAMPLING` times the resolution.

    Raises:
        MissingRequirementError: If this machine cannot render.
    """
    size = [SUPERSAMPLING * width, max(2, round(SUPERSAMPLING * width / frame.proportion))]
    with rendering():
        theme = pv.themes.DocumentTheme()
        plotter = pv.Plotter(off_screen=True, window_size=size, theme=theme, lighting="none")
        try:
            plotter.background_color = "white"
            # One lamp above the viewer's left shoulder: colours keep their brightness on all visible faces.
            plotter.add_light(pv.Light(position=(-0.3, 0.35, 1.0), light_type="camera light"))
            middle = np.zeros(3)
            for layer in layers:
                plotter.add_mesh(
                    layer.mesh, **{"show_scalar_bar": False, "reset_camera": False, **layer.options}
                )
                middle = np.asarray(layer.mesh.center)
            _aim(plotter, view, frame, middle)
            if axes:
                side = AXES * min(size) / np.array(size)
                ink = dict.fromkeys(("x_color", "y_color", "z_color", "color"), INK)
                names = {"xlabel": "x", "ylabel": "y", "zlabel": "z", "label_size": (0.35, 0.14)}
                plotter.add_axes(viewport=(0.0, 0.0, *side), line_width=3 * SUPERSAMPLING, **ink, **names)
            return np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
        finally:
            plotter.close()


def _aim(plotter: pv.Plotter, view: View, frame: Frame, middle: np.ndarray) -> None:
    target = frame.centre[0] * view.right + frame.centre[1] * view.up + (middle @ view.towards) * view.towards
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = target
    camera.position = target + float(np.max(frame.size)) * view.towards
    camera.up = view.up
    camera.parallel_scale = float(frame.size[1]) / 2
    plotter.reset_camera_clipping_range()
