"""Cutting bodies into subdomains."""

from __future__ import annotations

from fenics_contact.partition.bisection import bisection_partition
from fenics_contact.partition.cutting import (
    box_partition,
    check_face_connected,
    check_one_piece,
    combine,
    merge_pieces,
    torn_node_counts,
)
from fenics_contact.partition.default_partition import default_partition, target_parts
from fenics_contact.partition.graph_partition import graph_partition

__all__ = [
    "bisection_partition",
    "box_partition",
    "check_face_connected",
    "check_one_piece",
    "combine",
    "default_partition",
    "graph_partition",
    "merge_pieces",
    "target_parts",
    "torn_node_counts",
]
