"""Errors that state what is needed, what was given and what to do, raised by all ranks or by none."""

from fenics_contact.errors.kinds import (
    ConvergenceError,
    FenicsContactError,
    ForkedProcessError,
    InfeasibleError,
    InvalidDesignError,
    InvalidInputError,
    LoadStepError,
    MissingRequirementError,
    OutOfMemoryError,
    RemoteError,
    UserCodeError,
)
from fenics_contact.errors.ranks import agree, collective, collectively, together

__all__ = [
    "ConvergenceError",
    "FenicsContactError",
    "ForkedProcessError",
    "InfeasibleError",
    "InvalidDesignError",
    "InvalidInputError",
    "LoadStepError",
    "MissingRequirementError",
    "OutOfMemoryError",
    "RemoteError",
    "UserCodeError",
    "agree",
    "collective",
    "collectively",
    "together",
]

for _kind in [value for value in globals().values() if isinstance(value, type)]:
    _kind.__module__ = __name__  # tracebacks show the public module
