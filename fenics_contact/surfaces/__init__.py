"""Surfaces of meshes: facets, the true surfaces that they approximate, and projections on them."""

from fenics_contact.surfaces.facet_areas import (
    GaussPoint,
    SurfaceMoments,
    gauss_points,
    nodal_areas,
    quadrature_areas,
    surface_moments,
)
from fenics_contact.surfaces.facets import (
    FacetedSurface,
    Relief,
    corner_places,
    corner_products,
    edge_distance,
    facet_shape_values,
    faceted_surface,
    outside,
    shape_functions,
)
from fenics_contact.surfaces.midpoints import (
    bearing_areas,
    bearing_pulled_back,
    filled_at_corners,
    has_midside_pressure,
    share_areas,
)
from fenics_contact.surfaces.projection import (
    Projection,
    best_projections,
    facets_in_reach,
    interpolated_normal,
    join,
    nearest_facets,
    newton_matrix,
    node_weights,
    project,
)
from fenics_contact.surfaces.quadratic_facets import shape_weight_gradients, shape_weights
from fenics_contact.surfaces.relief import corner_normals, edges_at_corners, height_functions, heights, slopes
from fenics_contact.surfaces.tangents import SurfaceTangents, surface_tangents
from fenics_contact.surfaces.true_surface import Geometry, height_over, true_surface

__all__ = [
    "FacetedSurface",
    "GaussPoint",
    "Geometry",
    "Projection",
    "Relief",
    "SurfaceMoments",
    "SurfaceTangents",
    "bearing_areas",
    "bearing_pulled_back",
    "best_projections",
    "corner_normals",
    "corner_places",
    "corner_products",
    "edge_distance",
    "edges_at_corners",
    "facet_shape_values",
    "faceted_surface",
    "facets_in_reach",
    "filled_at_corners",
    "gauss_points",
    "has_midside_pressure",
    "height_functions",
    "height_over",
    "heights",
    "interpolated_normal",
    "join",
    "nearest_facets",
    "newton_matrix",
    "nodal_areas",
    "node_weights",
    "outside",
    "project",
    "quadrature_areas",
    "shape_functions",
    "shape_weight_gradients",
    "shape_weights",
    "share_areas",
    "slopes",
    "surface_moments",
    "surface_tangents",
    "true_surface",
]
