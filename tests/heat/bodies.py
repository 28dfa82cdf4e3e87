"""Bodies cut into equal boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import box_partition
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import ConductingBody, Conductor, HeatScene, HeatSource, HeldTemperature

Cut = tuple[HeatScene, dict[str, np.ndarray]]


def waves(x: np.ndarray) -> np.ndarray:
    """Return a source that varies within subdomains and between them."""
    return 1.0 + np.sin(1.3 * x[:, 0]) + np.cos(2.0 * x[:, 1])


def boxes(*counts: int, cells: int = 3, other: Conductor | None = None, held: bool = False) -> Cut:
    """Return a body of unit subdomains, of two materials like a chessboard where another one is given."""
    make = block if len(counts) == 3 else rectangle
    mesh = make((0.0,) * len(counts), tuple(map(float, counts)), tuple(cells * n for n in counts))
    part = box_partition(mesh, counts)
    dark = np.floor(mesh.points[mesh.cells].mean(axis=1)).sum(axis=1) % 2 == 1
    mesh = replace(mesh, regions={"light": np.flatnonzero(~dark), "dark": np.flatnonzero(dark)})
    plain = Conductor(1.0, 1.0)
    body = ConductingBody(mesh, {"light": plain, "dark": other or plain})
    fixed = [HeldTemperature("body", "x0", 0.0)] if held else []
    return HeatScene({"body": body}, fixed, [HeatSource("body", waves)]), {"body": part}
