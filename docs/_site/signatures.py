"""Signatures and types as the source has them: ``npt.ArrayLike``, not the union that NumPy makes of it."""

from __future__ import annotations

import inspect
import re
from enum import Enum
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.inspect import stringify_signature

#: Short names of the package's inside, and what they stand for.
PLAIN = {"Array": "np.ndarray", "Vector": "np.ndarray", "Marks": "np.ndarray", "_dolfinx": "dolfinx"}
_PLAIN = re.compile(r"(?<![\w.])(" + "|".join(PLAIN) + r")\b")


def as_written(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, returned: str | None
) -> tuple[str, str | None] | None:
    """Return the signature of a function or class without resolving its annotations."""
    if signature is None:
        return None
    uncalled = inspect.isclass(obj) and (issubclass(obj, Enum) or getattr(obj, "_is_protocol", False))
    if uncalled or hasattr(obj, "model_fields"):
        return "", None  # nobody calls these: tables of scene files, say, are made by reading one
    try:
        found = inspect.signature(obj)
    except (TypeError, ValueError):
        return None
    parameters = list(found.parameters.values())
    if inspect.isfunction(obj) and parameters and parameters[0].name == "self":
        parameters = parameters[1:]
    parameters = [shown(parameter) for parameter in parameters]
    text = stringify_signature(found.replace(parameters=parameters), show_return_annotation=False)
    result = found.return_annotation
    plain_result = plain(result) if isinstance(result, str) and not inspect.isclass(obj) else None
    return plain(text), plain_result


class Ellipses:
    """A default value that no line shows."""

    def __repr__(self) -> str:
        return "..."


def shown(parameter: inspect.Parameter) -> inspect.Parameter:
    """Write three dots for the factory of a dataclass's field, and for a default that needs several lines."""
    default = repr(parameter.default)
    hidden = default == "<factory>" or "\n" in default
    return parameter.replace(default=Ellipses()) if hidden else parameter


def annotations(obj: Any) -> dict[str, str]:
    """Return the annotations in the body of a class and its bases, as they are written."""
    if not inspect.isclass(obj):
        return {}
    return {
        name: plain(text)
        for base in reversed(obj.__mro__)
        for name, text in inspect.get_annotations(base).items()
        if isinstance(text, str)
    }


def plain(text: str) -> str:
    """Write a type without short names of the package's inside."""
    return _PLAIN.sub(lambda found: PLAIN[found[1]], text)


def connect(app: Sphinx) -> None:
    """Connect to Sphinx."""
    app.connect("autodoc-process-signature", as_written)
