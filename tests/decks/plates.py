"""Decks of plates of shells for tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact.decks import Deck, read_deck
from tests.fem.surfaces import grid, node_at

PLATE = grid(4, 2, lambda w: w @ np.array([[40.0, 0, 0], [0, 20.0, 0]]))
FIXED, FREE = [np.flatnonzero(PLATE[2][:, 0] == end) for end in (0.0, 1.0)]
TIP, BESIDE, MIDDLE = (node_at(PLATE[2], *at) for at in ((1, 0.5), (1, 0.25), (0.5, 0.5)))
CLAMPED = [(FIXED, "1, 6")]
HINGED = [(FIXED, "1, 3"), (FREE, "3, 3")]


def text_of(
    points: np.ndarray,
    facets: Mapping[str, np.ndarray],
    held: Sequence[tuple[np.ndarray, str]],
    loads: str,
    section: str = "",
    *,
    thick: float = 4.0,
    law: str = "200000., 0.3",
    model: str = "",
    step: str = "*STEP\n*STATIC",
) -> str:
    """Return a deck of shells: nodes that facets have, numbered from 1, in the set NALL."""
    used = np.unique(np.concatenate([each.ravel() for each in facets.values()]))
    lines = ["*NODE, NSET=NALL", *(f"{k + 1}, {', '.join(map(repr, points[k].tolist()))}" for k in used)]
    number = 0
    for kind, rows in facets.items():
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET=ALL")
        for row in rows.tolist():
            number += 1
            lines.append(", ".join(map(str, [number, *(k + 1 for k in row)])))
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", law, "*DENSITY", "1."]
    lines += [f"*SHELL SECTION, ELSET=ALL, MATERIAL=M{section}", str(thick), model, "*BOUNDARY"]
    lines += [f"{k + 1}, {what}" for nodes, what in held for k in nodes if k in used]
    lines += [step, loads, "*NODE PRINT, NSET=NALL", "U", "*NODE PRINT, NSET=NALL, TOTALS=ONLY", "RF"]
    return "\n".join(line for line in [*lines, "*END STEP"] if line) + "\n"


def solved(folder: Path, text: str) -> tuple[Deck, dict[int, np.ndarray], np.ndarray]:
    """Return the deck, displacements by nodes from zero, and the sum of reactions."""
    path = folder / "shell.inp"
    path.write_text(text)
    deck = read_deck(path)
    state = deck.solve(MPI.COMM_WORLD, tolerance=1e-9)[-1]
    moved, reaction = deck.tables(state)
    return deck, {int(row[0]) - 1: row[1:] for row in moved.rows}, reaction.rows[-1, 1:]


def triangles(facets: np.ndarray, corners: int) -> np.ndarray:
    """Two triangles of 3 or 6 nodes for each quadrilateral, whose centre is the node behind its fifth."""
    centre = facets[:, 4] + 1
    first = [facets[:, [0, 1, 2, 4, 5]], centre[:, None]]
    second = [facets[:, [0, 2, 3]], centre[:, None], facets[:, [6, 7]]]
    return np.concatenate([np.hstack(first), np.hstack(second)])[:, :corners]


def two_planes(beyond: float) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """A wall, 100 high, with a flange on top from -beyond to 100; points, facets, points of the flange."""
    wall = grid(10, 4, lambda w: w @ np.array([[0, 0, 100.0], [0, 40.0, 0]]))
    ahead = 15 if beyond else 10
    flange = grid(
        ahead, 4, lambda w: w @ np.array([[100.0 + beyond, 0, 0], [0, 40.0, 0]]) - [beyond, 0, -100]
    )
    points, facets = np.vstack([wall[0], flange[0]]), np.vstack([wall[1], flange[1] + len(wall[0])])
    _, first, number = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    return points, {"S8R": first[number.ravel()][facets]}, np.flatnonzero(np.isclose(points[:, 2], 100))
