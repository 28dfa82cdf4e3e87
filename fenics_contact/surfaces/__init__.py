"""Surfaces of meshes: facets, the true surfaces that they stand for, and where points project on them."""

from fenics_contact.surfaces.facet_areas import nodal_areas, quadrature_areas
from fenics_contact.surfaces.facets import FacetedSurface, Relief, faceted_surface
from fenics_contact.surfaces.relief import heights
from fenics_contact.surfaces.true_surface import Geometry, true_surface

__all__ = [
    "FacetedSurface",
    "Geometry",
    "Relief",
    "faceted_surface",
    "heights",
    "nodal_areas",
    "quadrature_areas",
    "true_surface",
]
