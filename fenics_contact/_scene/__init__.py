"""Scenes: bodies, materials, supports, loads and contact pairs."""

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
