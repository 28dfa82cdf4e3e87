"""Mortar coupling: surfaces with non-matching meshes, coupled in weighted means by dual multipliers."""
