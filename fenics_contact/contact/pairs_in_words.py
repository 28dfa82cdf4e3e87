"""Contact pairs of a state in words."""

from __future__ import annotations

import numpy as np

from fenics_contact.contact.result import ContactResult, Status
from fenics_contact.scene import ContactPair, Scene


def pairs_in_words(scene: Scene, contact: ContactResult, force: str = "", stress: str = "") -> list[str]:
    """Return a summary of each contact pair.

    Args:
        scene: The scene.
        contact: The result on its contact surfaces.
        force: Name of the unit of force.
        stress: Name of the unit of stress.
    """
    rows = []
    for number, pair in enumerate(scene.contacts):
        mine = contact.on_pair(number)
        resultant = f"{np.linalg.norm(contact.force[mine].sum(axis=0)):.6g} {force}".rstrip()
        pressure = f"{contact.pressure[mine].max(initial=0.0):.5g} {stress}".rstrip()
        rows.append(
            f"{pair.place}: {len(mine)} points, {_kinds(pair, contact.status[mine])}; "
            f"force {resultant}, pressure up to {pressure}"
        )
    return rows


def _kinds(pair: ContactPair, status: np.ndarray) -> str:
    """Return the numbers of points by status; without friction open or closed."""
    counts = {kind.name.lower(): int(np.count_nonzero(status == kind)) for kind in Status}
    if not pair.has_friction:
        counts = {"open": counts["open"], "closed": len(status) - counts["open"]}
    return ", ".join(f"{count} {name}" for name, count in counts.items())
