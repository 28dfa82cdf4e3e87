"""How accurate a state is: its errors by solver, friction law and mesh, in energy norm."""

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
