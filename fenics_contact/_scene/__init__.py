"""Scenes: bodies, materials, supports, loads and contact pairs."""
