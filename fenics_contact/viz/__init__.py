"""Pictures of scenes, states and optimisations as PNG files, drawn without a display.

Three-dimensional parts are rendered by pyvista; matplotlib adds titles, colour bars and diagrams, and draws
plane bodies. On several ranks the fields are gathered by all and drawn by rank 0. Every ``plot_`` function
returns a `Picture`, which Jupyter shows and which is written to a file if a path is given.
"""

from fenics_contact.viz._libraries import check_libraries
from fenics_contact.viz.before_after import plot_before_after
from fenics_contact.viz.colours import (
    BLUE,
    FAMILIES,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PRESSURE_MAP,
    SIGNED_MAP,
    SPARE,
    STRESS_MAP,
)
from fenics_contact.viz.control_net import plot_control_net
from fenics_contact.viz.convergence import plot_convergence
from fenics_contact.viz.curves import plot_curves
from fenics_contact.viz.decomposition import plot_decomposition
from fenics_contact.viz.error import plot_error
from fenics_contact.viz.fields import field_entries, is_plane, linear_cells
from fenics_contact.viz.obstacles import outline
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.pressure import plot_contact_pressure
from fenics_contact.viz.renderer import check_renderer, rendering
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.status import plot_contact_status
from fenics_contact.viz.stress import chosen_scale, plot_field, plot_stress
from fenics_contact.viz.units import Units

__all__ = [
    "BLUE",
    "FAMILIES",
    "GREEN",
    "GREY",
    "INK",
    "ORANGE",
    "PRESSURE_MAP",
    "SIGNED_MAP",
    "SPARE",
    "STRESS_MAP",
    "Picture",
    "Units",
    "check_libraries",
    "check_renderer",
    "chosen_scale",
    "draw_picture",
    "field_entries",
    "is_plane",
    "linear_cells",
    "outline",
    "plot_before_after",
    "plot_contact_pressure",
    "plot_contact_status",
    "plot_control_net",
    "plot_convergence",
    "plot_curves",
    "plot_decomposition",
    "plot_error",
    "plot_field",
    "plot_stress",
    "png_path",
    "rendering",
    "sheet",
]
