"""Errors that state what is needed, what was given and what to do, raised by all ranks or by none."""

from fenics_contact.errors.agreement import agree, collective, collectively, together
from fenics_contact.errors.kinds import (
    ConvergenceError,
    FenicsContactError,
    FoldedFacetsError,
    ForkedProcessError,
    InfeasibleError,
    InvalidDesignError,
    InvalidInputError,
    LoadStepError,
    MissingRequirementError,
    RemoteError,
    UserCodeError,
)
from fenics_contact.errors.telling import tell
from fenics_contact.errors.user_code import calling, running

__all__ = [
    "ConvergenceError",
    "FenicsContactError",
    "FoldedFacetsError",
    "ForkedProcessError",
    "InfeasibleError",
    "InvalidDesignError",
    "InvalidInputError",
    "LoadStepError",
    "MissingRequirementError",
    "RemoteError",
    "UserCodeError",
    "agree",
    "calling",
    "collective",
    "collectively",
    "running",
    "tell",
    "together",
]

for _kind in [value for value in globals().values() if isinstance(value, type)]:
    _kind.__module__ = __name__  # tracebacks show the public module
