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
from fenics_contact.feti.ties import matched, same_points
from fenics_contact.qp.solution import SolverStep


@dataclass(frozen=True, eq=False)
class FluidNodes:
    """Nodes of fluids, or contact points of pairs with a fluid: its number, −1 for none, and the node."""

    pair: np.ndarray
    slave: np.ndarray


@dataclass(frozen=True, eq=False)
class Front:
    """The nodes of slaves that fluids may reach, and from where; replicated.

    A fluid passes from pair to pair where their slaves share facets, and not where any pair is closed.

    `nodes`: fluid and number of each node, shape (n,); `names`: of the fluids; `fluids`: that of each contact
    pair, −1 for none; `neighbours`: nodes that share a facet of the slave; `inlet`: nodes where fluid enters;
    `critical`: contact pressures of each pair up to which its points count as open, NaN where it is the
    pressure of the fluid.
    """

    nodes: FluidNodes
    names: tuple[str, ...]
    fluids: np.ndarray
    neighbours: sp.csr_matrix
    inlet: np.ndarray
    critical: np.ndarray

    @classmethod
    def of(cls, scene: Scene, tearing: Tearing, comm: MPI.Comm, nodes: Sequence[np.ndarray]) -> Front:
        """Prepare the graph of the slave nodes of pairs with a fluid, given by pair. Collective."""
        names = tuple(dict.fromkeys(each.name for pair in scene.contacts for each in pair.fluids))
        fluids, critical = np.full(len(scene.contacts), -1), np.zeros(len(scene.contacts))
        for number, pair in enumerate(scene.contacts):
            for fluid in pair.fluids:
                fluids[number] = names.index(fluid.name)
                critical[number] = np.nan if fluid.critical == "pressure" else fluid.critical
        with together(comm):
            parts = [_part(scene, tearing, nodes, np.flatnonzero(fluids == k)) for k in range(len(names))]
        slave, inlet, neighbours = zip(*parts, strict=True)
        number_of = np.repeat(np.arange(len(names)), [len(each) for each in slave])
        known = FluidNodes(number_of, np.concatenate(slave))
        graph = sp.block_diag(neighbours, "csr")
        return cls(known, names, fluids, graph, np.concatenate(inlet), critical)

    def pressures(self, by_name: Mapping[str, float]) -> np.ndarray:
        """Return the pressure of the fluid at each node, given by its name, shape (n,)."""
        return np.array([by_name.get(name, 0.0) for name in self.names])[self.nodes.pair]

    def at_points(self, values: np.ndarray, points: ContactPoints) -> np.ndarray:
        """Return values of nodes at contact points, zero at those of other pairs, shape (n_points,)."""
        return matched(values, same_points(self.nodes, self._fluid_at(points)))

    def at_nodes(self, values: np.ndarray, points: ContactPoints) -> np.ndarray:
        """Return values of contact points at nodes, zero where there is none, shape (n,)."""
        return matched(values, same_points(self._fluid_at(points), self.nodes))

    def reached(self, points: ContactPoints, pressed: np.ndarray, by_name: Mapping[str, float]) -> np.ndarray:
        """Return the open nodes connected with an inlet, shape (n,); those without a point are open.

        `pressed`: contact pressures of the points, shape (n_points,); `by_name`: pressures of the fluids.
        """
        fluid = np.array([*(by_name.get(name, 0.0) for name in self.names), 0.0])[self.fluids]
        critical = np.where(np.isnan(self.critical), fluid, self.critical)
        open_ = ~np.isin(self.nodes.slave, points.slave[pressed > critical[points.pair]])
        kept = sp.diags(open_.astype(float))
        _, part = connected_components(kept @ self.neighbours @ kept, directed=False)
        return open_ & np.isin(part, part[open_ & self.inlet])

    def _fluid_at(self, points: ContactPoints) -> FluidNodes:
        return FluidNodes(self.fluids[points.pair], points.slave)


def returning(passes: str, wet: int, history: Sequence[SolverStep]) -> ConvergenceError:
    """Return the error of a front that comes back to where as many points were wet."""
    return ConvergenceError(
        f"the front of a fluid must come to rest, but after {passes} it returns to "
        f"{counted(wet, 'wet point')} where it was before: take smaller load steps, refine the contact, or "
        "give the fluid a critical pressure",
        history,
    )


def _part(
    scene: Scene, tearing: Tearing, nodes: Sequence[np.ndarray], pairs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
    """Return the nodes of one fluid, where it enters, and which of them are neighbours."""
    slave = np.unique(np.concatenate([nodes[number] for number in pairs]))
    inlet, rows, columns = np.zeros(len(slave), dtype=bool), [], []
    for number in pairs:
        pair = scene.contacts[number]
        (fluid,), body = pair.fluids, scene.bodies[pair.slave.body].mesh
        own = nodes[number] - tearing.first_of(pair.slave.body)
        named = fluid.enters if isinstance(fluid.enters, str) else pair.slave.name
        enters = fluid.inlet(body.points[own], np.isin(own, body.surfaces[named]))
        inlet[np.searchsorted(slave, nodes[number][enters])] = True
        place = np.full(body.n_nodes, -1)
        place[own] = np.searchsorted(slave, nodes[number])
        facets = place[body.surfaces[pair.slave.name]]
        one, other = (np.broadcast_arrays(facets[:, :, None], facets[:, None, :])[k].ravel() for k in (0, 1))
        both = (one >= 0) & (other >= 0)
        rows.append(one[both])
        columns.append(other[both])
    row, column = np.concatenate(rows), np.concatenate(columns)
    return slave, inlet, Csr((np.ones(len(row)), (row, column)), shape=(len(slave),) * 2)
