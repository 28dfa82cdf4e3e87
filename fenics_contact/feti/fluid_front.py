"""The slave nodes that fluid may reach, and how far it gets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.csr import Csr
from fenics_contact._base.display import counted
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import ConvergenceError, together
from fenics_contact.feti.decomposition import Tearing
from fenics_contact.feti.ties import PairedNodes, matched, same_points
from fenics_contact.qp.solution import SolverStep


@dataclass(frozen=True, eq=False)
class Front:
    """The nodes of slaves that fluid may reach, and from where; replicated.

    `pair`, `slave`: contact pair and number of each node, shape (n,); `neighbours`: nodes that share a facet
    of the slave; `inlet`: nodes where fluid enters; `critical`: contact pressures up to which nodes count as
    open, NaN where it is the pressure of the fluid.
    """

    pair: np.ndarray
    slave: np.ndarray
    neighbours: sp.csr_matrix
    inlet: np.ndarray
    critical: np.ndarray

    @classmethod
    def of(cls, scene: Scene, tearing: Tearing, comm: MPI.Comm, nodes: Sequence[np.ndarray]) -> Front:
        """Prepare the graph of the slave nodes of pairs with a fluid, given by pair. Collective."""
        with together(comm):
            parts = [
                _part(scene, tearing, number, nodes[number])
                for number, pair in enumerate(scene.contacts)
                if pair.fluids
            ]
        number, slave, inlet, critical = (np.concatenate([part[k] for part in parts]) for k in range(4))
        return cls(number, slave, sp.block_diag([part[4] for part in parts], "csr"), inlet, critical)

    def pressures(self, scene: Scene, by_name: Mapping[str, float]) -> np.ndarray:
        """Return the pressure of the fluid at each node, given by its name, shape (n,)."""
        found = [sum(by_name.get(each.name, 0.0) for each in pair.fluids) for pair in scene.contacts]
        return np.asarray(found)[self.pair]

    def at_points(self, values: np.ndarray, points: ContactPoints) -> np.ndarray:
        """Return values of nodes at contact points, zero at those of other pairs, shape (n_points,)."""
        return matched(values, same_points(self, points))

    def wet_before(self, points: PairedNodes, wet: np.ndarray) -> np.ndarray:
        """Return which nodes were wet, given by points, shape (n_points,); shape (n,)."""
        return np.asarray(matched(wet, same_points(points, self)) > 0.0)

    def reached(self, points: ContactPoints, pressed: np.ndarray, fluid: np.ndarray) -> np.ndarray:
        """Return the open nodes connected with the inlet, shape (n,); those without a point are open.

        `pressed`: contact pressures of the points, shape (n_points,); `fluid`: that of the fluid at the
        nodes.
        """
        match = same_points(points, self)
        critical = np.where(np.isnan(self.critical), fluid, self.critical)
        open_ = (match < 0) | (matched(pressed, match) <= critical)
        kept = sp.diags(open_.astype(float))
        _, part = connected_components(kept @ self.neighbours @ kept, directed=False)
        return open_ & np.isin(part, part[open_ & self.inlet])


def returning(passes: str, wet: int, history: Sequence[SolverStep]) -> ConvergenceError:
    """Return the error of a front that comes back to where as many points were wet."""
    return ConvergenceError(
        f"the front of a fluid must come to rest, but after {passes} it returns to "
        f"{counted(wet, 'wet point')} where it was before: take smaller load steps, refine the contact, or "
        "give the fluid a critical pressure",
        history,
    )


def _part(scene: Scene, tearing: Tearing, number: int, slave: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return pair, slave, inlet, critical pressure and neighbours of the nodes of one pair."""
    pair = scene.contacts[number]
    (fluid,), body = pair.fluids, scene.bodies[pair.slave.body].mesh
    nodes = slave - tearing.first_of(pair.slave.body)
    named = fluid.enters if isinstance(fluid.enters, str) else pair.slave.name
    inlet = fluid.inlet(body.points[nodes], np.isin(nodes, body.surfaces[named]))
    number_of = np.full(body.n_nodes, -1)
    number_of[nodes] = np.arange(len(nodes))
    facets = number_of[body.surfaces[pair.slave.name]]
    one, other = (np.broadcast_arrays(facets[:, :, None], facets[:, None, :])[k].ravel() for k in (0, 1))
    both = (one >= 0) & (other >= 0)
    neighbours = Csr((np.ones(np.count_nonzero(both)), (one[both], other[both])), shape=(len(nodes),) * 2)
    critical = np.nan if fluid.critical == "pressure" else fluid.critical
    return np.full(len(nodes), number), slave, inlet, np.full(len(nodes), critical), neighbours
