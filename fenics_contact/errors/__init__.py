"""Errors that state what is needed, what was given and what to do, raised by all ranks or by none."""

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
    safe_log,
    scene_file_code,
    user_code,
)
from fenics_contact.errors.ranks import agree, collective, collectively, together

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
