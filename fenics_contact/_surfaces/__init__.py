"""Surfaces of meshes: facets, the true surfaces that they approximate, and projections on them."""
