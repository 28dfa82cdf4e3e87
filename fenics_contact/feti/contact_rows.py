"""Rows of B at contact points: apart along the normal, slip along the tangents, all components where tied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.feti.contact_points import ContactPoints
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.rows import Rows
from fenics_contact.scene import Tie

#: A row with no larger share of free components is determined by supports. On a plane of symmetry averaged
#: normals are tilted a little: slip across the plane would look free, and be redundant.
HELD = 0.02


@dataclass(frozen=True)
class Relations:
    """What each of some rows measures: d·(u_slave − Σ w_j u_master,j).

    Attributes:
        points: Contact or tied points.
        which: Point of each row, shape (n_rows,).
        directions: d of each row, shape (n_rows, dim).
    """

    points: ContactPoints
    which: np.ndarray
    directions: np.ndarray

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.which)

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return what prescribed displacements contribute to each row, shape (n_rows,), [length].

        Args:
            prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim).
        """
        moved = self.points.jump @ np.nan_to_num(prescribed)
        return np.asarray(np.einsum("rd,rd->r", self.directions, moved[self.which]))

    def held(self, fixed: np.ndarray) -> np.ndarray:
        """Return which rows supports determine alone, or but for a slight tilt, shape (n_rows,).

        Args:
            fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        """
        squares = self.points.jump.multiply(self.points.jump).tocsr()
        free = (squares @ (~fixed).astype(float))[self.which]
        every = (squares @ np.ones(fixed.shape))[self.which]
        directions = self.directions**2
        moving, whole = (np.einsum("rd,rd->r", directions, part) for part in (free, every))
        return np.asarray(moving <= HELD**2 * whole)

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return the part of these rows of B that acts on free components, with an empty right side.

        The displacement of a node is the mean of its copies, weighted as the gluing rows are: that makes
        these rows orthogonal to them. Prescribed components are known: left in, they would couple these rows
        to those of the supports, and make them redundant where supports hold both surfaces.

        Args:
            tearing: Node numbering and copies.
            fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        """
        jump = self.points.jump[self.which].tocoo()
        # Ascending by row: every rank builds the same rows, and the owner's copy is that of the slave node.
        order = np.lexsort((jump.col, jump.row))
        row, node, weight = jump.row[order], jump.col[order], jump.data[order]
        copies = tearing.multiplicity[node]
        within = np.arange(copies.sum()) - np.repeat(np.cumsum(copies) - copies, copies)
        copy = np.repeat(tearing.first_copy[node], copies) + within
        row, node = np.repeat(row, copies), np.repeat(node, copies)
        value = (np.repeat(weight, copies) * tearing.copy_share[copy])[:, None] * self.directions[row]
        # Directions along an axis leave the other components alone: the preconditioner asks what is touched.
        out = fixed[node] | self.held(fixed)[row][:, None]
        entry, component = np.nonzero(np.where(out, 0.0, value))
        slave = tearing.first_copy[self.points.slave[self.which]]
        owner = tearing.subdomain_rank[tearing.copy_subdomain[slave]]
        right = np.zeros(self.count)
        return Rows(row[entry], copy[entry], component, value[entry, component], right, owner)


def normal_relations(points: ContactPoints) -> Relations:
    """Return −n·(u_slave − u_master) ≤ gap, one row for each contact point."""
    return Relations(points, np.arange(points.count), -points.normal)


def tangential_relations(points: ContactPoints, frictional: np.ndarray) -> Relations:
    """Return the slip t_a·(u_slave − u_master): dim − 1 consecutive rows for each frictional point.

    Args:
        points: All contact points.
        frictional: Numbers of the points that have friction.
    """
    dim = points.normal.shape[1]
    return Relations(points, np.repeat(frictional, dim - 1), points.tangents[frictional].reshape(-1, dim))


def tied_relations(points: ContactPoints, ties: Sequence[Tie], fixed: np.ndarray) -> Relations:
    """Return u_slave − u_master = 0 at tied points, along the normal alone where the tie may slide.

    A component that a support prescribes on the slave node is left to the support.

    Args:
        points: Points of the ties, see `find_tied_points`.
        ties: The ties.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
    """
    dim = points.normal.shape[1]
    sliding = np.array([tie.sliding for tie in ties], dtype=bool)[points.pair]
    bonded, component = np.nonzero(~sliding[:, None] & ~fixed[points.slave])
    gliding = np.flatnonzero(sliding)
    which = np.concatenate([bonded, gliding])
    return Relations(points, which, np.concatenate([np.eye(dim)[component], -points.normal[gliding]]))
