"""The solution of a linear system of heat: its refinement, and the state with what passes and its balance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.dual import DualSystem
from fenics_contact.heat.assembly import Heated
from fenics_contact.heat.joints import Joints
from fenics_contact.heat.scene import HeatScene
from fenics_contact.heat.state import HeatBalance, HeatState, HeatThroughContact
from fenics_contact.qp.face_newton import ProjectedCG
from fenics_contact.qp.solution import DualSolution
from fenics_contact.results.dual_solve import solve_dual


def refined(
    system: DualSystem,
    solution: DualSolution,
    field: np.ndarray,
    heated: Sequence[Heated],
    rough: float,
    most: int = 4,
) -> tuple[DualSolution, np.ndarray, int]:
    """Return a solution without what rounding leaves in means of subdomains, and products. Collective.

    Heat and jumps that are missing drive ``most`` corrections, with residuals of ``rough``; each leaves a
    thousandth of an error or less.
    """
    torn, products = system.torn, 0
    for _ in range(most):
        passing, parts = system.force(solution.multiplier), torn.decomposition.parts
        subdomains = tuple(
            replace(each.subdomain, load=each.residual(field[part]) - passing[part])
            for each, part in zip(heated, parts, strict=True)
        )
        right = torn.right - torn.compliance.added(system.jump(field), -solution.multiplier)
        following = DualSystem(replace(torn, subdomains=subdomains, right=right), previous=system)
        step = solve_dual(following, ProjectedCG(tolerance=rough))
        change = following.displacement(step.multiplier, step.alpha)
        field, products = field + change, products + following.products
        multiplier, alpha = solution.multiplier + step.multiplier, solution.alpha + step.alpha
        solution = replace(solution, multiplier=multiplier, alpha=alpha)
        sizes = np.array([np.abs(each).max(initial=0.0) for each in (change, field)])
        changed, size = np.max(torn.numbering.comm.allgather(sizes), axis=0)
        if rough * changed <= 1e-13 * size:
            break
    return solution, field, products


@dataclass(frozen=True, eq=False)
class Solved:
    """A solution, with what its system was made of.

    `heated`: subdomains; `field`: torn temperatures; `conductance`: h at the points of contacts, (n,);
    `friction`: heat that enters slave and master there, (2, n).
    """

    scene: HeatScene
    joints: Joints
    heated: tuple[Heated, ...]
    system: DualSystem
    solution: DualSolution
    field: np.ndarray
    conductance: np.ndarray
    friction: np.ndarray

    @property
    def decomposition(self) -> Decomposition:
        """The subdomains."""
        return self.system.torn.decomposition

    def state(self, systems: int, products: int, seconds: Mapping[str, float]) -> HeatState:
        """Return the state, after a number of systems and products. Collective."""
        torn, tearing = self.system.torn, self.decomposition.tearing
        values = nodal_mean_at(self.decomposition, self.field, np.arange(tearing.n_nodes))[:, 0]
        tied, passing = (torn.gathered(self.solution.multiplier, group) for group in torn.groups.joints)
        heat = np.zeros(self.joints.points.count)
        heat[self.conductance * self.joints.area > 0.0] = passing
        return HeatState(
            self.scene, torn, self.heated, self.system, self.solution, self.joints, values,
            self._contacts(values, heat), tied, self._balance(heat, tied), self._stored, systems, products,
            dict(seconds),
        )  # fmt: skip

    @property
    def _inside(self) -> Iterator[tuple[Heated, np.ndarray]]:
        """Subdomains with their temperatures."""
        for each, part in zip(self.heated, self.decomposition.parts, strict=True):
            yield each, self.field[part]

    @cached_property
    def _stored(self) -> tuple[np.ndarray, ...]:
        """Heat that the nodes of each subdomain take up, (n,) each."""
        return tuple(-each.stored.at_nodes(own) for each, own in self._inside)

    def _contacts(self, values: np.ndarray, heat: np.ndarray) -> tuple[HeatThroughContact, ...]:
        joints, found, friction = self.joints, [], self.friction.sum(axis=0)
        slave, master = joints.sides(values)
        for number, contact in enumerate(self.scene.geometry.contacts):
            mine = np.flatnonzero(joints.points.pair == number)
            first = self.decomposition.tearing.first_of(contact.slave.body)
            found.append(
                HeatThroughContact(
                    joints.points.slave[mine] - first, joints.places[mine], slave[mine], master[mine],
                    self.conductance[mine], heat[mine], heat[mine] / joints.area[mine], friction[mine],
                )
            )  # fmt: skip
        return tuple(found)

    def _balance(self, heat: np.ndarray, tied: np.ndarray) -> HeatBalance:
        """Return where heat comes from. Collective."""
        scene, entering = self.scene, self._entering(heat, tied)
        parts: dict[str, float] = {}
        for acting, given in zip((*scene.held, *scene.loads), entering, strict=False):
            name = f"{type(acting).__name__} {acting.place}"
            parts[name] = parts.get(name, 0.0) + float(given)
        for number, contact in enumerate(scene.contacts):
            mine = (self.joints.points.pair == number) & self.joints.on_obstacle
            if mine.any():
                parts[f"ThermalContact {contact.place}"] = -float(heat[mine].sum())
            if contact.friction.part > 0.0:
                slave, master = self.friction[:, self.joints.points.pair == number].sum(axis=1)
                entering_master = float(master) * contact.pair.between_bodies
                parts[f"FrictionHeat {contact.place}"] = float(slave) + entering_master
        return HeatBalance(parts, *map(float, entering[-2:]))

    def _entering(self, heat: np.ndarray, tied: np.ndarray) -> np.ndarray:
        """Return the heat of each held temperature and load, what is stored, and its size. Collective."""
        scene, first = self.scene, self._first_held
        entering = np.zeros(len(scene.held) + len(scene.loads) + 2)
        for each, own in self._inside:
            for number, exchange in each.exchanges.items():
                entering[len(scene.held) + number] += exchange.heat(own)
        for stored in self._stored:
            entering[-2:] += stored.sum(), np.abs(stored).sum()
        self._add_held(entering, first)
        entering = np.asarray(self.decomposition.comm.allreduce(entering))
        # Rows of contacts and ties have no entries at nodes that are held.
        through = np.zeros(len(first))
        for points, passing in ((self.joints.points, heat), (self.joints.tied, tied)):
            through += points.jump.T @ passing
        np.add.at(entering, first[first >= 0], through[first >= 0])
        return entering

    @property
    def _first_held(self) -> np.ndarray:
        """The first of the held temperatures at each node, −1 where there is none, (n_nodes,)."""
        tearing = self.decomposition.tearing
        first = np.full(tearing.n_nodes, -1)
        for number, held in reversed([*enumerate(self.scene.held)]):
            mesh = self.scene.bodies[held.body].mesh
            first[tearing.global_nodes(held.body, mesh.nodes_to_hold(held.surface))] = number
        return first

    def _add_held(self, entering: np.ndarray, first: np.ndarray) -> None:
        """Add the heat that enters this rank's rows of held temperatures, that of each node for its first."""
        torn, gluing = self.system.torn, self.decomposition.gluing
        owned = np.flatnonzero(torn.numbering.owned < torn.n_gluing)
        dof = gluing.dof[torn.numbering.owned[owned]]
        fixed = gluing.fixed.ravel()[dof]
        np.subtract.at(entering, first[dof[fixed]], self.solution.multiplier[owned[fixed]])
