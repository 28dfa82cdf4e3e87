"""Results as files for ParaView and other programs, written atomically.

On several ranks rank 0 writes (XDMF: all ranks together), and all raise if one fails.
"""

from fenics_contact.io.design_table import write_design_table
from fenics_contact.io.field_files import FIELD_FILES, StoredFields, fields_of_result, stored_fields
from fenics_contact.io.forces_record import forces_record, listed_forces, scales_of
from fenics_contact.io.json_file import json_text, write_json
from fenics_contact.io.names import file_of_each
from fenics_contact.io.one_run import only_run_in
from fenics_contact.io.provenance import versions
from fenics_contact.io.reading import read_result
from fenics_contact.io.replacing import OutputError, write_text
from fenics_contact.io.result import result_record, write_optimisation_result, write_result
from fenics_contact.io.series import ResultSeries
from fenics_contact.io.spline_fit import CadError
from fenics_contact.io.step import StepFile, write_step
from fenics_contact.io.stl import write_stl
from fenics_contact.io.vtu import write_vtu
from fenics_contact.io.vtx import write_vtx
from fenics_contact.io.xdmf import write_xdmf

__all__ = [
    "FIELD_FILES",
    "CadError",
    "OutputError",
    "ResultSeries",
    "StepFile",
    "StoredFields",
    "fields_of_result",
    "file_of_each",
    "forces_record",
    "json_text",
    "listed_forces",
    "only_run_in",
    "read_result",
    "result_record",
    "scales_of",
    "stored_fields",
    "versions",
    "write_design_table",
    "write_json",
    "write_optimisation_result",
    "write_result",
    "write_step",
    "write_stl",
    "write_text",
    "write_vtu",
    "write_vtx",
    "write_xdmf",
]
