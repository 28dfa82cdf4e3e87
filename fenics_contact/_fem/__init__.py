"""Forms of elasticity and of loads, written once on templates and bound to any mesh."""

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
