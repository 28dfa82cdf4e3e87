"""Reports to loggers: a failing handler must not stop a run, least of all on one rank."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any


def safe_log(log: Callable[..., None], message: str, *arguments: Any, **named: Any) -> None:
    """Log a message, whatever handlers raise.

    A user's handler that raises is treated as in the standard library: its traceback goes to stderr if
    ``logging.raiseExceptions`` is set, and the run continues.

    Args:
        log: Method of a logger, such as ``logger.info``.
        message: The message.
        *arguments: Values that are formatted into it.
        **named: Keyword arguments of the method.

    Example:
        >>> safe_log(logging.getLogger("fenics_contact").debug, "%d products", 3)
    """
    try:
        log(message, *arguments, stacklevel=2, **named)
    except Exception:
        record = logging.makeLogRecord({"msg": message, "args": arguments})
        logging.Handler().handleError(record)
