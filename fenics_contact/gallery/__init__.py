"""Parametric bodies: blocks, links, rings, Hertz bodies, bolted joints."""

from __future__ import annotations

from fenics_contact.gallery.block import block, box_lattice, box_sides
from fenics_contact.gallery.bolted import bolt, drilled_plate
from fenics_contact.gallery.chain import Chain, chain
from fenics_contact.gallery.extrusion import extrude
from fenics_contact.gallery.half_disc import half_disc
from fenics_contact.gallery.hemisphere import half_cylinder, hemisphere
from fenics_contact.gallery.link import DesignSurface, Link, chain_link
from fenics_contact.gallery.rectangle import rectangle, rectangle_lattice, split_quadrilaterals
from fenics_contact.gallery.ring import LinkShape
from fenics_contact.gallery.side import side_of
from fenics_contact.gallery.structured import split_hexahedra
from fenics_contact.gallery.ticks import growing_ticks
from fenics_contact.gallery.touch import PULL_AXIS, TwoLinks, two_links

__all__ = [
    "PULL_AXIS",
    "Chain",
    "DesignSurface",
    "Link",
    "LinkShape",
    "TwoLinks",
    "block",
    "bolt",
    "box_lattice",
    "box_sides",
    "chain",
    "chain_link",
    "drilled_plate",
    "extrude",
    "growing_ticks",
    "half_cylinder",
    "half_disc",
    "hemisphere",
    "rectangle",
    "rectangle_lattice",
    "side_of",
    "split_hexahedra",
    "split_quadrilaterals",
    "two_links",
]
