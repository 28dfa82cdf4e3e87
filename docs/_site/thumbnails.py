"""Thumbnails of cards: one clear piece of a picture, without its small print."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

#: Where they are written, below docs/; they are made anew with the pages and not kept.
FOLDER = "_thumbnails"
#: Width in pixels, and width by height.
WIDTH, PROPORTION = 600, 1.5
#: Left, top, right and bottom of the piece of a picture, as fractions of it.
PIECES = {
    "hertz_sphere_stress": (0.10, 0.03, 0.78, 0.56),
    "punch_2d_stress": (0.09, 0.18, 0.46, 0.86),
    "cattaneo_mindlin_traction": (0.08, 0.06, 0.97, 0.80),
    "patch_test_node": (0.08, 0.13, 0.47, 0.83),
    "sheared_block_status": (0.38, 0.15, 0.65, 0.405),
    "shrink_fit_stress": (0.07, 0.09, 0.86, 0.925),
    "press_fit_edge_pressure": (0.05, 0.06, 0.97, 0.84),
    "bolted_joint_stress": (0.057, 0.46, 0.59, 0.90),
    "five_links_stress": (0.10, 0.09, 0.50, 0.34),
    "orthotropic_stress": (0.13, 0.05, 0.86, 0.72),
    "tooth_flank_stress": (0.49, 0.16, 0.89, 0.89),
    "chain_links_stress": (0.09, 0.09, 0.87, 0.47),
    "uncertain_friction_samples": (0.09, 0.06, 0.97, 0.79),
    "01_first_contact": (0.17, 0.04, 0.75, 0.52),
    "02_chain_links_and_friction": (0.01, 0.07, 0.88, 0.53),
    "03_your_own_ufl_model": (0.09, 0.07, 0.97, 0.79),
    "04_shape_optimisation": (0.00, 0.20, 0.88, 0.92),
    "05_what_accuracy_costs": (0.40, 0.14, 0.63, 0.74),
    "06_inside_tfeti": (0.06, 0.07, 0.97, 0.80),
    "07_large_deformations": (0.05, 0.10, 0.90, 0.92),
}
#: The piece of others: below the title and left of the bar.
REST = (0.02, 0.06, 0.86, 0.98)


def piece_of(picture: Path) -> np.ndarray:
    """Return the piece of a picture that its thumbnail shows, (height, width, 3)."""
    image = imread(picture)[..., :3]
    height, width = image.shape[:2]
    left, top, right, bottom = PIECES.get(picture.stem, REST)
    return image[round(top * height) : round(bottom * height), round(left * width) : round(right * width)]


def write_thumbnail(picture: Path, docs: Path) -> Path:
    """Write the thumbnail of a picture, white beside its piece, unless the same is there; return its path."""
    piece = piece_of(picture)
    height, width = piece.shape[:2]
    figure = Figure(figsize=(WIDTH / 100, WIDTH / PROPORTION / 100), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    share = width / height / PROPORTION
    wide, high = min(1.0, share), min(1.0, 1.0 / share)
    axes = figure.add_axes(((1 - wide) / 2, (1 - high) / 2, wide, high))
    axes.imshow(piece, aspect="auto", interpolation="antialiased")
    axes.set_axis_off()
    paper, target = BytesIO(), docs / FOLDER / picture.name
    figure.savefig(paper, format="png")
    target.parent.mkdir(exist_ok=True)
    if not target.exists() or target.read_bytes() != paper.getvalue():
        target.write_bytes(paper.getvalue())
    return target
