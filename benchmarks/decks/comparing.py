"""How far a deck's states are from CalculiX's results: displacement, force and stress."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.decks.calculix import Block
from fenics_contact._scene.loads import PointForce, ThermalStrain
from fenics_contact._scene.supports import Support
from fenics_contact.decks import Deck
from fenics_contact.feti.constraints import ConstraintRows
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_values
from fenics_contact.mesh.quality import jacobians
from fenics_contact.results.state import State

#: Order of components of the stress in .dat files.
PRINTED_STRESS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
#: CalculiX replaces a body of revolution by a sector of two degrees, whose forces .dat files have; those in
#: .frd files are of the whole revolution.
SECTORS = 180.0


@dataclass(frozen=True)
class Agreement:
    """Largest differences relative to the largest value of CalculiX, over all steps; None: not compared."""

    displacement: float | None = None
    force: float | None = None
    stress: float | None = None

    @property
    def worst(self) -> float | None:
        """The larger one of displacement and force, that of the stress without both."""
        known = [value for value in (self.displacement, self.force) if value is not None]
        return max(known) if known else self.stress


def agreement(deck: Deck, states: Sequence[State], blocks: Sequence[Block]) -> Agreement:
    """Return the agreement at the ends of the steps."""
    ends = {number: step.time or 0.0 for number, step in zip(deck.step_of, deck.steps, strict=True)}
    found: dict[str, list[float]] = {"U": [], "RF": [], "S": []}
    for number, state in enumerate(states):
        time = ends[number]
        known = [block for block in blocks if abs(block.time - time) <= 1e-6 * max(time, 1e-3)]
        for quantity, differences in (("U", _moved), ("RF", _held), ("S", _stressed)):
            pairs = differences(deck, state, [block for block in known if block.quantity == quantity])
            size = max((float(np.abs(theirs).max(initial=0.0)) for _, theirs in pairs), default=0.0)
            if quantity == "RF":  # forces that balance within a node are rounding
                size = size if size > 1e-6 * _largest_force(deck, state) else 0.0
            if size > 0.0:
                most = max(float(np.abs(own - theirs).max(initial=0.0)) for own, theirs in pairs)
                found[quantity].append(most / size)
    return Agreement(*(max(values) if values else None for values in found.values()))


Pairs = list[tuple[np.ndarray, np.ndarray]]


def _places(deck: Deck, body: str, block: Block, every: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which rows of a block are nodes of a body, and their numbers in it.

    ``every``: numbers of all nodes of the deck. Those of shells are left out, and nodes across them.
    """
    known = every[~deck.are_of_shells(every)]
    numbers = np.where(np.isin(deck.node_numbers[body], known), deck.node_numbers[body], 0)
    order = np.argsort(numbers, kind="stable")
    place = np.minimum(np.searchsorted(numbers[order], block.labels[:, 0]), len(numbers) - 1)
    rows = np.flatnonzero(numbers[order][place] == block.labels[:, 0])
    return rows, order[place[rows]]


def _moved(deck: Deck, state: State, blocks: Sequence[Block]) -> Pairs:
    """Return displacements, own and CalculiX's."""
    pairs, every = [], deck.of_nodes("", state, "U")
    shells = every[deck.are_of_shells(every[:, 0])]
    for body in deck.node_numbers:
        own = state.gather_displacement(body)
        for block in blocks:
            rows, nodes = _places(deck, body, block, every[:, 0])
            # Nodes of a section are there twice, and either program may keep the number on another side.
            cuts = state.scene.bodies[body].mesh.cuts.values()
            whole = (
                ~np.isin(nodes, np.concatenate([cut.pairs.ravel() for cut in cuts])) if cuts else slice(None)
            )
            pairs.append((own[nodes][whole], block.values[rows][:, : own.shape[1]][whole]))
    for block in blocks:  # bodies have the nodes across their thickness instead
        _, own_rows, rows = np.intersect1d(shells[:, 0], block.labels[:, 0], return_indices=True)
        pairs.append((shells[own_rows, 1:], block.values[rows][:, : shells.shape[1] - 1]))
    return pairs


def _held(deck: Deck, state: State, blocks: Sequence[Block]) -> Pairs:
    """Return forces on nodes along the components that supports hold, own and CalculiX's."""
    scene, forces, every = state.scene, state._nodal_forces, deck.of_nodes("", state, "U")[:, 0]
    heated = any(isinstance(load, ThermalStrain) for load in scene.loads)
    tearing = state.torn.decomposition.tearing
    pairs = []
    for body in deck.node_numbers:
        number = tearing.body_names.index(body)
        part = slice(int(tearing.node_offset[number]), int(tearing.node_offset[number + 1]))
        own = forces.reaction[part] + (0.0 if heated else forces.load[part])
        for equations in state.torn.groups.of(ConstraintRows):
            own = own + equations.on_nodes(forces.joints[equations])[part]
        for load in scene.loads if heated else ():
            if isinstance(load, PointForce) and load.body == body:
                nodes = scene.bodies[body].mesh.nodes_of(load.nodes)
                own[nodes] += load.at(scene.bodies[body].mesh.points[nodes], own.shape[1])
        held = np.zeros(own.shape, dtype=bool)
        for support in scene.supports:
            if isinstance(support, Support) and support.body == body:
                nodes = scene.bodies[body].mesh.nodes_of(support.surface)
                held[nodes] |= np.array([value is not None for value in support.value])[: own.shape[1]]
        # Along the radius the forces around a ring of no radius balance: they mean nothing.
        held[scene.bodies[body].on_axis, 0] = False
        for block in blocks:
            if block.labels.shape[1] == 1:
                rows, nodes = _places(deck, body, block, every)
                chosen = held[nodes]
                theirs = block.values[rows][:, : own.shape[1]]
                factor = 1.0 / SECTORS if scene.axisymmetric and block.place else deck.thickness
                pairs.append((factor * own[nodes][chosen], theirs[chosen]))
    return pairs


def _largest_force(deck: Deck, state: State) -> float:
    forces = state._nodal_forces
    every = forces.load, forces.reaction, forces.contact, *forces.joints.values()
    return deck.thickness * max(float(np.abs(each).max(initial=0.0)) for each in every)


def _stressed(deck: Deck, state: State, blocks: Sequence[Block]) -> Pairs:
    """Return means of the stress over cells, own and CalculiX's."""
    pairs: Pairs = []
    for body, numbers in deck.element_numbers.items():
        printed = [
            block
            for block in blocks
            if block.labels.shape[1] == 2 and np.isin(block.labels[:, 0], numbers).any()
            if block.values.shape[1] == 6  # else the name of local axes is behind them, as of shells
        ]
        if not printed:
            continue
        tensor = state.gather_stress(body)
        own = np.stack([tensor[:, i, j] for i, j in PRINTED_STRESS], axis=1)
        place = {int(number): cell for cell, number in enumerate(numbers)}
        for block in printed:
            elements, first, count = np.unique(block.labels[:, 0], return_index=True, return_counts=True)
            mine = [k for k, element in enumerate(elements.tolist()) if element in place]
            cells = np.array([place[int(elements[k])] for k in mine])
            means = [
                _mean(deck, body, int(cell), block.values[first[k] : first[k] + count[k]])
                for k, cell in zip(mine, cells, strict=True)
            ]
            pairs.append((own[cells], np.array(means)))
    return pairs


def _mean(deck: Deck, body: str, cell: int, values: np.ndarray) -> np.ndarray:
    """Return the mean over a cell of values at CalculiX's points, the first coordinate fastest."""
    mesh, revolved = deck.scene.bodies[body].mesh, deck.scene.axisymmetric
    count = {8: 2, 27: 3}.get(len(values))
    kind = CELL_TYPES[mesh.cell_type]
    if kind.is_simplex and len(values) == 9:  # of a wedge, three layers of three points
        positions, weight = np.array([[1, 1], [4, 1], [1, 4]]) / 6.0, np.ones(3)
    elif count is None or kind.is_simplex:
        return np.asarray(values.mean(axis=0))
    else:
        positions, weight = _tensor_rule(count, mesh.dim)
    weight = weight * jacobians(mesh.points, mesh.cells[cell : cell + 1], positions)[0]
    if revolved:
        weight = weight * (shape_values(kind, positions) @ mesh.points[mesh.cells[cell], 0])
    layer = values[: len(weight)]
    return np.asarray(weight @ layer / weight.sum())


def _tensor_rule(count: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and weights of a Gauss rule on the unit square or cube, the first coordinate fastest."""
    points, weights = np.polynomial.legendre.leggauss(count)
    places = np.meshgrid(*[0.5 * (1.0 + points)] * dim, indexing="ij")
    sizes = np.meshgrid(*[weights] * dim, indexing="ij")
    positions = np.stack([each.ravel(order="F") for each in places], axis=1)
    return positions, np.prod([each.ravel(order="F") for each in sizes], axis=0)
