"""How bodies deform: in space, in the plane, around an axis, with torsion; and finite elements."""

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
