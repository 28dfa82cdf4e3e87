"""Where contact points are: their slave nodes in space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact.contact import State


def contact_places(state: State, points: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the place of each contact point's slave node, (n, 3), [length].

    Args:
        state: Gives the contact points and the numbering of nodes over all bodies.
        points: Body name -> coordinates of its nodes, (n_nodes, 3), deformed or not.
    """
    names = state.torn.decomposition.tearing.body_names
    stacked = np.concatenate([points[name] for name in names])
    return np.asarray(stacked[state.contact.points.slave])
