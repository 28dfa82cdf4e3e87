"""Results as files for ParaView and other programs, written atomically.

On several ranks rank 0 writes (XDMF: all ranks together), and all raise if one fails.
"""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names

if TYPE_CHECKING:
    from fenics_contact.output.cad import CadError, write_step
    from fenics_contact.output.files import OutputError, only_run_in, write_json, write_text
    from fenics_contact.output.frd import write_frd
    from fenics_contact.output.heat import write_heat_balance
    from fenics_contact.output.paraview import ResultSeries, write_xdmf
    from fenics_contact.output.result import read_result, versions, write_optimisation_result
    from fenics_contact.output.surfaces import write_design_table, write_stl
    from fenics_contact.output.tables import StepTable, write_contact_table

__all__ = [
    "CadError",
    "OutputError",
    "ResultSeries",
    "StepTable",
    "only_run_in",
    "read_result",
    "versions",
    "write_contact_table",
    "write_design_table",
    "write_frd",
    "write_heat_balance",
    "write_json",
    "write_optimisation_result",
    "write_step",
    "write_stl",
    "write_text",
    "write_xdmf",
]

__getattr__, __dir__ = late_names(__name__)
