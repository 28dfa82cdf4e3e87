"""Parametric bodies: blocks, links, round bodies, whole or half, bolted joints."""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.gallery.blocks import block, box_lattice, growing_ticks, rectangle, rectangle_lattice
    from fenics_contact.gallery.bolted import bolt, drilled_plate
    from fenics_contact.gallery.hertz import half_cylinder, half_disc, hemisphere
    from fenics_contact.gallery.links import (
        Chain,
        DesignSurface,
        Link,
        TwoLinks,
        chain,
        chain_link,
        two_links,
    )
    from fenics_contact.gallery.ring import LinkShape
    from fenics_contact.gallery.round import ball, cylinder, disc
    from fenics_contact.gallery.side import side_of

__all__ = [
    "Chain",
    "DesignSurface",
    "Link",
    "LinkShape",
    "TwoLinks",
    "ball",
    "block",
    "bolt",
    "box_lattice",
    "chain",
    "chain_link",
    "cylinder",
    "disc",
    "drilled_plate",
    "growing_ticks",
    "half_cylinder",
    "half_disc",
    "hemisphere",
    "rectangle",
    "rectangle_lattice",
    "side_of",
    "two_links",
]

__getattr__, __dir__ = late_names(__name__)
