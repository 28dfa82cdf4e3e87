"""Draw the house: `python scripts/draw_architecture.py` writes docs/pictures/architecture.svg.

The rooms of the package stand on the floors of tests/house/floors.py; tests compare both.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

TARGET = Path(__file__).resolve().parents[1] / "docs" / "pictures" / "architecture.svg"


@dataclass(frozen=True)
class Room:
    """One room: its name, what it does, its colour, and the number of the data that it hands on."""

    name: str
    purpose: str
    kind: str
    badge: str = ""


#: From the ground up, as in the test of imports.
FLOORS = [
    [Room("errors", "what is needed, given, to do; on all ranks", "ground")],
    [
        Room("_base", "progress, files, arguments", "ground"),
        Room("theory", "contacts known by formula", "numbers"),
    ],
    [
        Room("_dolfinx", "versions of dolfinx", "ground"),
        Room("_optimize", "bundle method", "numbers", "6"),
        Room("qp", "dual solvers", "numbers", "3"),
        Room("shapes", "spheres, tori", "model"),
    ],
    [
        Room("materials", "elastic, rubber, metal", "model"),
        Room("mesh", "cells, faces, subdomains", "model"),
    ],
    [Room("_kinematics", "in space, in the plane, around an axis, with torsion; finite elements", "model")],
    [
        Room("_surfaces", "facets, true surfaces", "model"),
        Room("readers", "gmsh, CAD, dolfinx, meshio", "model"),
    ],
    [
        Room("_scene", "bodies, supports, loads, pairs", "model", "1"),
        Room("gallery", "blocks, links, Hertz bodies", "model"),
    ],
    [
        Room("_fem", "forms of elasticity and loads", "model"),
        Room("_pairing", "which node touches what and where", "model"),
    ],
    [Room("feti", "subdomains, gluing, contact rows, coarse space, dual operator", "model", "2")],
    [
        Room("_accuracy", "estimates and certificates", "model"),
        Room("_large_deformations", "Newton, load steps", "model"),
    ],
    [Room("results", "states, forces, stresses, energies", "model", "4")],
    [Room("_equilibrium", "scene → state: solution, load steps, warnings", "model")],
    [Room("design", "design → mesh → adjoint → subgradient", "model", "5")],
    [
        Room("_adaptive", "a quantity to an accuracy", "model"),
        Room("_wear", "wear over cycles", "numbers"),
        Room("fatigue", "critical planes of cycles", "model"),
    ],
    [Room("heat", "through bodies and contacts, from friction, and what it does to contact", "model")],
    [
        Room("_responses", "functions", "beside"),
        Room("_scene_file", "TOML", "beside"),
        Room("output", "files", "beside"),
        Room("pictures", "PNG", "beside"),
    ],
    [
        Room("_page", "web pages", "top"),
        Room("decks", "CalculiX, Abaqus", "top"),
        Room("study", "what accuracy costs in time", "top"),
    ],
    [Room("_cli", "the command fenics-contact", "top")],
]
FLOW = [
    ("1", "Scene", "what there is; nothing numerical"),
    ("2", "TornSystem", "subdomains on every rank: K, f, R, rows of B"),
    ("3", "DualProblem", "F, d, G, e → multipliers λ"),
    ("4", "State", "u, forces, status, energies, errors"),
    ("5", "DesignPoint", "J and a subgradient"),
    ("6", "Result", "the best design, its history"),
]

FILL = {
    "ground": ("#eceff1", "#607d8b"),
    "model": ("#dcecf9", "#2a6fa8"),
    "numbers": ("#fdf0d3", "#b07500"),
    "beside": ("#e3f1e4", "#3b7d43"),
    "top": ("#f6e3ec", "#a8466f"),
}
LEGEND = [
    ("model", "models and discretisation"),
    ("numbers", "no finite elements at all"),
    ("ground", "ground: everybody stands on it"),
    ("beside", "scenes, files and pictures for users"),
    ("top", "programs for users"),
]
FONT = "'DejaVu Sans', Verdana, Arial, sans-serif"
LEFT, WIDTH, HEIGHT, STEP, GAP = 40, 560, 44, 54, 12
ASIDE, ASIDE_WIDTH = 652, 268
TOP_EDGE = 70


def text(x: float, y: float, words: str, size: float = 13, **more: str) -> str:
    """Return a line of text."""
    attributes = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in more.items())
    return f'<text x="{x:g}" y="{y:g}" font-size="{size:g}"{attributes}>{escape(words)}</text>'


def badge(x: float, y: float, number: str) -> str:
    """Return a number in a disc."""
    disc = f'<circle cx="{x:g}" cy="{y:g}" r="11" fill="#37474f"/>'
    return disc + text(x, y + 4.5, number, 12.5, fill="white", text_anchor="middle", font_weight="bold")


def box(room: Room, x: float, y: float, width: float, height: float = HEIGHT) -> str:
    """Return a room."""
    fill, line = FILL[room.kind]
    parts = [
        f'<g data-room="{room.name}" data-y="{y:g}">',
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="{fill}" '
        f'stroke="{line}" stroke-width="1.4"/>',
        text(x + 14, y + 19, room.name, 14.5, font_weight="bold", fill="#1c262b"),
        text(x + 14, y + 35.5, room.purpose, 11.5, fill="#455a64"),
    ]
    if room.badge:
        parts.append(badge(x + width - 20, y + height / 2, room.badge))
    return "".join([*parts, "</g>"])


def row(rooms: list[Room], x: float, y: float, width: float) -> list[str]:
    """Return rooms side by side on one floor."""
    each = (width - GAP * (len(rooms) - 1)) / len(rooms)
    return [box(room, x + index * (each + GAP), y, each) for index, room in enumerate(rooms)]


def picture() -> str:
    """Return the SVG."""
    first = TOP_EDGE
    bottom = first + STEP * (len(FLOORS) - 1)
    total, height = ASIDE + ASIDE_WIDTH + LEFT, bottom + HEIGHT + 36
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total} {height}" font-family="{FONT}">',
        "<title>The rooms of fenics_contact</title>",
        f'<rect width="{total}" height="{height}" fill="white"/>',
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="7" markerHeight="7" '
        'orient="auto-start-reverse"><path d="M0 0 10 5 0 10z" fill="#78909c"/></marker></defs>',
        text(LEFT, 32, "fenics_contact", 20, font_weight="bold", fill="#1c262b"),
        text(
            LEFT,
            52,
            "Imports point down. Rooms without an underscore are public.",
            12.5,
            fill="#455a64",
        ),
    ]
    for level, rooms in enumerate(reversed(FLOORS)):
        parts += row(rooms, LEFT, first + level * STEP, WIDTH)
    parts.append(
        f'<line x1="{LEFT - 16}" y1="{first + 4}" x2="{LEFT - 16}" y2="{bottom + HEIGHT - 4}" '
        'stroke="#78909c" stroke-width="1.6" marker-end="url(#tip)"/>'
    )
    parts += flow(first + STEP)
    parts += legend(bottom + HEIGHT - 18 * len(LEGEND) + 6)
    return "\n".join([*parts, "</svg>", ""])


def flow(y: float) -> list[str]:
    """Return the list of what is handed from room to room."""
    parts = [text(ASIDE, y, "Data, in the order it flows", 13.5, font_weight="bold", fill="#1c262b")]
    for index, (number, name, what) in enumerate(FLOW):
        place = y + 27 + 40 * index
        parts += [
            badge(ASIDE + 11, place, number),
            text(ASIDE + 32, place - 1, name, 13, font_weight="bold", fill="#1c262b"),
            text(ASIDE + 32, place + 14, what, 10.5, fill="#455a64"),
        ]
    return parts


def legend(y: float) -> list[str]:
    """Return what the colours mean."""
    parts = []
    for index, (kind, words) in enumerate(LEGEND):
        fill, line = FILL[kind]
        place = y + 18 * index
        parts.append(
            f'<rect x="{ASIDE}" y="{place - 10:g}" width="16" height="12" rx="3" fill="{fill}" '
            f'stroke="{line}"/>'
        )
        parts.append(text(ASIDE + 26, place, words, 11, fill="#455a64"))
    return parts


if __name__ == "__main__":
    TARGET.write_text(picture(), encoding="utf-8")
