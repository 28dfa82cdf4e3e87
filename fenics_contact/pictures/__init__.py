"""Pictures of scenes, states and optimisations as PNG files, drawn without a display.

Three-dimensional parts are rendered by pyvista; matplotlib adds titles, colour bars and diagrams, and draws
plane bodies. On several ranks the fields are gathered by all and drawn by rank 0. Every ``plot_`` function
returns a `Picture`, which Jupyter shows and which is written to a file if a path is given.

Arguments that they share:

* ``path``: PNG file to write, None to write none,
* ``title``: text before the facts in the title,
* ``units``: names of the units in titles and labels, mm, N and MPa unless given,
* ``width``: width of the picture in pixels,
* ``comm``, of functions that take no state: if given, the call is collective, only rank 0 draws, and an error
  is raised on all ranks.

All raise `InvalidInputError` if an option or the name of the file cannot be used, those that draw in space
`MissingRequirementError` if this machine cannot render.
"""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names
from fenics_contact.pictures import _libraries  # noqa: F401

if TYPE_CHECKING:
    from fenics_contact.pictures.canvas import Picture, Units
    from fenics_contact.pictures.curves import plot_curves
    from fenics_contact.pictures.designs import plot_before_after, plot_control_net, plot_convergence
    from fenics_contact.pictures.levels import plot_levels, plot_meshes
    from fenics_contact.pictures.states import (
        plot_contact_pressure,
        plot_contact_status,
        plot_decomposition,
        plot_error,
        plot_field,
        plot_stress,
    )

__all__ = [
    "Picture",
    "Units",
    "plot_before_after",
    "plot_contact_pressure",
    "plot_contact_status",
    "plot_control_net",
    "plot_convergence",
    "plot_curves",
    "plot_decomposition",
    "plot_error",
    "plot_field",
    "plot_levels",
    "plot_meshes",
    "plot_stress",
]

__getattr__, __dir__ = late_names(__name__)
