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
from fenics_contact.errors.telling import safe_log
from fenics_contact.errors.user_code import scene_file_code, user_code

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
    "collective",
    "collectively",
    "safe_log",
    "scene_file_code",
    "together",
    "user_code",
]

for _kind in [value for value in globals().values() if isinstance(value, type)]:
    _kind.__module__ = __name__  # tracebacks show the public module
