"""Total FETI: torn systems, contact rows, the dual problem and its operators."""

from fenics_contact.feti.condensation import Condensations
from fenics_contact.feti.contact_rows import on_copies
from fenics_contact.feti.decomposition import Decomposition, decompose
from fenics_contact.feti.direct import DirectSolution, DirectSystem
from fenics_contact.feti.dirichlet import DirichletPreconditioner
from fenics_contact.feti.dual import DualSystem
from fenics_contact.feti.factor import (
    FIXING_NODES,
    Factor,
    fixing_dofs,
    fixing_nodes,
    held_by,
    motions_at,
    require_factored,
    symmetric_matrix,
)
from fenics_contact.feti.gluing import prescribed_displacements
from fenics_contact.feti.implicit import FactoredOperator, dofs_inside
from fenics_contact.feti.initial_gap import check_apart
from fenics_contact.feti.inverse import LocalKind, TornInverse, kernel_matrix
from fenics_contact.feti.local import LocalOperator
from fenics_contact.feti.nodal_mean import nodal_mean, nodal_mean_at, nodal_mean_transposed
from fenics_contact.feti.nodal_sum import nodal_sum
from fenics_contact.feti.petsc_calls import petsc_call
from fenics_contact.feti.rows import Rows
from fenics_contact.feti.same_input import check_same_input
from fenics_contact.feti.sharing import Sharing
from fenics_contact.feti.subdomain import CachedMatrix, Subdomain, common_kernel
from fenics_contact.feti.torn import TornSystem, build_torn_system, meeting_at

__all__ = [
    "FIXING_NODES",
    "CachedMatrix",
    "Condensations",
    "Decomposition",
    "DirectSolution",
    "DirectSystem",
    "DirichletPreconditioner",
    "DualSystem",
    "Factor",
    "FactoredOperator",
    "LocalKind",
    "LocalOperator",
    "Rows",
    "Sharing",
    "Subdomain",
    "TornInverse",
    "TornSystem",
    "build_torn_system",
    "check_apart",
    "check_same_input",
    "common_kernel",
    "decompose",
    "dofs_inside",
    "fixing_dofs",
    "fixing_nodes",
    "held_by",
    "kernel_matrix",
    "meeting_at",
    "motions_at",
    "nodal_mean",
    "nodal_mean_at",
    "nodal_mean_transposed",
    "nodal_sum",
    "on_copies",
    "petsc_call",
    "prescribed_displacements",
    "require_factored",
    "symmetric_matrix",
]
