"""The torn system of one geometry: subdomain matrices, contact points and this rank's part of B."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import together
from fenics_contact.feti.contact_rows import contact_rows
from fenics_contact.feti.contact_search import (
    ContactPoints,
    check_no_penetration,
    find_contact_points,
    friction_data,
    no_contact_points,
)
from fenics_contact.feti.decomposition import Decomposition
from fenics_contact.feti.forms import as_tractions
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.feti.rows import Rows, stack
from fenics_contact.feti.subdomain import Subdomain, assemble
from fenics_contact.scene import Scene


@dataclass(frozen=True)
class TornSystem:
    """min ½ uᵀK u − fᵀu + Σ Ψ_i ‖T_i u‖ subject to B_E u = c_E, B_N u ≤ c_N, distributed over ranks.

    Rows of B are numbered: gluing and Dirichlet rows, normal rows (one a contact point), tangential rows
    (two a frictional point).

    Attributes:
        scene: The scene with the geometry of this system.
        decomposition: What survives a change of geometry.
        subdomains: This rank's subdomains with their matrices.
        points: Contact points, replicated.
        frictional: Numbers of the contact points with friction, replicated, shape (n_friction,).
        friction_coefficient: μ of each frictional point (zero under Tresca), replicated, shape (n_friction,).
        tresca_bound: Fixed slip bound of each frictional point, replicated, shape (n_friction,), [force].
        numbering: Owners and exchange of multipliers.
        B: This rank's part of B, shape (n_local_rows, torn_size).
        right: c of the owned rows, shape (n_owned,), [length].
    """

    scene: Scene
    decomposition: Decomposition
    subdomains: tuple[Subdomain, ...]
    points: ContactPoints
    frictional: np.ndarray
    friction_coefficient: np.ndarray
    tresca_bound: np.ndarray
    numbering: DualNumbering
    B: sp.csr_matrix
    right: np.ndarray

    @property
    def n_equality(self) -> int:
        """Number of gluing and Dirichlet rows of all ranks."""
        return self.decomposition.gluing.count

    @property
    def normal_rows(self) -> np.ndarray:
        """Row number of every contact point's normal multiplier, shape (n_contact,)."""
        return self.n_equality + np.arange(self.points.count)

    @property
    def tangential_rows(self) -> np.ndarray:
        """Row numbers of every frictional point's two tangential multipliers, shape (n_friction, 2)."""
        start = self.n_equality + self.points.count
        return start + np.arange(2 * len(self.frictional)).reshape(-1, 2)

    @property
    def load(self) -> np.ndarray:
        """This rank's torn load f, shape (torn_size,), [force]."""
        return np.concatenate([subdomain.load for subdomain in self.subdomains])


def build_torn_system(
    scene: Scene,
    decomposition: Decomposition,
    *,
    start_geometry: bool = True,
    previous: TornSystem | None = None,
) -> TornSystem:
    """Assemble all numbers of the torn system for the scene's present coordinates. Collective.

    Args:
        scene: The scene whose decomposition is given, possibly moved.
        decomposition: Meshes and numbering.
        start_geometry: Refuse bodies that overlap. A shape being optimised may overlap its partner: the gap
            is then negative and the state presses the bodies apart.
        previous: System of another geometry or load; subdomains for which nothing changed are taken over.

    Raises:
        InvalidInputError: If the bodies overlap at the start, or matrices are not finite.
    """
    comm = decomposition.comm
    loads = as_tractions(scene)
    with together(comm):
        known = (None,) * len(decomposition.meshes) if previous is None else previous.subdomains
        subdomains = tuple(
            assemble(mesh, scene.bodies[mesh.body], loads, decomposition.forms, earlier)
            for mesh, earlier in zip(decomposition.meshes, known, strict=True)
        )
    points = no_contact_points()
    if scene.contacts:
        points = find_contact_points(scene, decomposition.tearing, decomposition.fixed, comm)
        if start_geometry:
            check_no_penetration(scene, points)
    has_friction, coefficient, tresca = friction_data(scene.contacts, points)
    frictional = np.flatnonzero(has_friction)
    rows = stack([decomposition.gluing, contact_rows(points, decomposition.tearing, frictional)])
    numbering, B = _own_part(rows, decomposition, None if previous is None else previous.numbering)
    return TornSystem(
        scene, decomposition, subdomains, points, frictional, coefficient[frictional], tresca[frictional],
        numbering, B, rows.right[numbering.owned],
    )  # fmt: skip


def _own_part(
    rows: Rows, decomposition: Decomposition, known: DualNumbering | None
) -> tuple[DualNumbering, sp.csr_matrix]:
    """Number the multipliers and pick the entries of B that act on this rank's subdomains. Collective."""
    block = decomposition.copy_block[rows.copy]
    here = block >= 0
    row, column = rows.row[here], 3 * block[here] + rows.component[here]
    touched, comm = np.unique(row), decomposition.comm
    # The pattern of communication stays as long as no rank's share of the rows changes.
    stays = known is not None and known.serves(rows.owner, touched)
    if comm.allreduce(int(not stays)) or known is None:
        known = DualNumbering(comm, rows.owner, touched)
    shape = (len(known.local_rows), decomposition.torn_size)
    return known, sp.csr_matrix((rows.value[here], (known.local_index(row), column)), shape=shape)
