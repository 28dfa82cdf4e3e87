"""Meshes that every rank has made: the ranks of a machine hold their large arrays together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fenics_contact._base.libraries import MPI
from fenics_contact._base.shared import is_shared, once_a_machine
from fenics_contact.mesh.body_mesh import BodyMesh

_LARGE = ("points", "cells", "grid", "regions", "hanging", "centres")


def hold_once_a_machine(comm: MPI.Comm, meshes: Sequence[BodyMesh], searched: Sequence[BodyMesh]) -> None:
    """Replace the arrays of nodes and cells of meshes by equal ones that a machine holds once. Collective.

    Nothing is done where they are shared already, nor on one rank.

    Args:
        comm: Communicator.
        meshes: The same on all ranks.
        searched: Those of them that are searched for contact, which needs their `linear` cells.
    """
    if comm.size == 1:
        return
    asked = [array for mesh in meshes for array in (mesh.points, mesh.cells)]
    asked += [vars(mesh).get("linear", mesh).cells for mesh in searched]
    if comm.allreduce(all(map(is_shared, asked)), MPI.LAND):
        return
    arrays, pieces = once_a_machine(
        comm, lambda: ([_large(mesh) for mesh in meshes], [mesh.linear_pieces() for mesh in searched])
    )
    for mesh, large in zip(meshes, arrays, strict=True):
        vars(mesh).pop("linear", None)  # its coordinates are those of before
        mesh._set(**large)
    for mesh, linear in zip(searched, pieces, strict=True):
        if linear:
            vars(mesh)["linear"] = mesh.with_linear_pieces(linear)


def _large(mesh: BodyMesh) -> dict[str, Any]:
    return {name: getattr(mesh, name) for name in _LARGE}
