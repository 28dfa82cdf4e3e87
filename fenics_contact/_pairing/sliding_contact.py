"""Contact in the current configuration, loaded where bodies move far."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.scene import Scene

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.contact import SlidingContact


def sliding_contact(
    scene: Scene, fixed: np.ndarray, comm: MPI.Comm | None = None, *, reach: float = np.inf
) -> SlidingContact:
    """Return the contact pairs of a scene whose bodies may move far. Collective."""
    from fenics_contact._pairing.sliding.contact import SlidingContact

    return SlidingContact.of(scene, fixed, comm, reach=reach)
