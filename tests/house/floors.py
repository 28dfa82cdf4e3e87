"""The floors of the house, from the ground up."""

from __future__ import annotations

#: From the ground up; rooms on one floor do not know each other.
FLOORS = [
    {"errors"},
    {"progress", "fingerprint", "checks", "display"},
    {"_requirements", "launching", "timing", "checkpoint"},
    {"_libraries"},
    {"_dolfinx"},
    {"surface_shapes", "linalg", "theory"},
    {"mesh"},
    {"mesh_io", "partition", "surfaces"},
    {"gallery"},
    {"scene", "qp"},
    {"fem"},
    {"pairing"},
    {"feti"},
    {"accuracy", "nonlinear"},
    {"contact"},
    {"shape"},
    {"optimize", "outer"},
]
