"""Decks that are solved, with displacements and places of nodes by their numbers."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from fenics_contact.decks import read_deck
from tests.decks.texts import deck


def solved(folder: Path, text: str, tolerance: float = 1e-11):
    """The deck, its last state, and displacements and places of nodes by their numbers."""
    found = read_deck(deck(folder, text))
    state = found.solve(MPI.COMM_SELF, tolerance=tolerance)[-1]
    moved, places = {}, {}
    for body, numbers in found.node_numbers.items():
        moved |= dict(zip(numbers.tolist(), state.gather_displacement(body), strict=True))
        places |= dict(zip(numbers.tolist(), found.scene.bodies[body].mesh.points, strict=True))
    return found, state, moved, places
