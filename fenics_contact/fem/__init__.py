"""Forms of elasticity and of loads, written once on templates and bound to any mesh."""

from __future__ import annotations

from fenics_contact.fem.composition import Composition, composition, integrate, material_sets
from fenics_contact.fem.forms import FormLibrary, Template, volume_measure
from fenics_contact.fem.history import History
from fenics_contact.fem.history_checks import check_history_material
from fenics_contact.fem.hyperelastic_checks import check_hyperelastic
from fenics_contact.fem.load_forms import (
    Symbol,
    is_scalar,
    load_fields,
    load_key,
    load_name,
    load_parameters,
    load_work,
)
from fenics_contact.fem.mechanics import Mechanics, Response
from fenics_contact.fem.model_checks import check_kernel, kernel_of, stiffness_of_cell
from fenics_contact.fem.nodal_stiffness import cell_stiffness
from fenics_contact.fem.spread_force import LinearTraction, as_tractions, spread_traction
from fenics_contact.fem.temperature import Temperature, stress_in_space, stress_left, temperature_of
from fenics_contact.fem.templates import Constants, Templates, Written, quadrature_degree, scalar_constants

__all__ = [
    "Composition",
    "Constants",
    "FormLibrary",
    "History",
    "LinearTraction",
    "Mechanics",
    "Response",
    "Symbol",
    "Temperature",
    "Template",
    "Templates",
    "Written",
    "as_tractions",
    "cell_stiffness",
    "check_history_material",
    "check_hyperelastic",
    "check_kernel",
    "composition",
    "integrate",
    "is_scalar",
    "kernel_of",
    "load_fields",
    "load_key",
    "load_name",
    "load_parameters",
    "load_work",
    "material_sets",
    "quadrature_degree",
    "scalar_constants",
    "spread_traction",
    "stiffness_of_cell",
    "stress_in_space",
    "stress_left",
    "temperature_of",
    "volume_measure",
]
