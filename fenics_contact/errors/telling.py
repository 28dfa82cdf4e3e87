"""Reports to loggers: a handler that fails does not stop a run, on one rank least of all."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any


def tell(log: Callable[..., None], message: str, *arguments: Any, **named: Any) -> None:
    """Log a message, whatever handlers do.

    A handler of the user's that raises is treated as those of the standard library treat their own errors:
    its traceback goes to stderr if ``logging.raiseExceptions`` is set, and the run goes on.

    Args:
        log: Method of a logger, such as ``logger.info``.
        message: The message.
        *arguments: What is put into it.
        **named: As the method takes them.

    Example:
        >>> tell(logging.getLogger("fenics_contact").debug, "%d products", 3)
    """
    try:
        log(message, *arguments, stacklevel=2, **named)
    except Exception:
        record = logging.makeLogRecord({"msg": message, "args": arguments})
        logging.Handler().handleError(record)
