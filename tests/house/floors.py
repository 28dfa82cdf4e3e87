"""The floors of the house, from the ground up."""

from __future__ import annotations

#: From the ground up; rooms on one floor do not know each other.
FLOORS = [
    {"errors"},
    {"_base", "theory"},
    {"_dolfinx", "_optimize", "qp", "shapes"},
    {"materials", "mesh"},
    {"_kinematics"},
    {"_surfaces", "readers"},
    {"_scene", "gallery"},
    {"_fem", "_pairing"},
    {"feti"},
    {"_accuracy", "_large_deformations"},
    {"results"},
    {"_equilibrium"},
    {"design"},
    {"_adaptive", "_wear", "fatigue"},
    {"heat"},
    {"_scene_file", "output", "pictures", "_responses"},
    {"_page", "decks", "study"},
    {"_cli"},
    {"__main__"},
]
