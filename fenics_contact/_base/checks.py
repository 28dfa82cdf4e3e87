"""Checks of arguments: numbers, vectors, types and files, named in messages."""

from __future__ import annotations

import importlib.util
import inspect
import re
import reprlib
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from functools import cache, wraps
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from fenics_contact._base.late_names import homes
from fenics_contact.errors import FenicsContactError, InvalidInputError
from fenics_contact.errors.kinds import scene_file_code

#: Largest number of cells in a row, and of any other count: more is a typing error.
MOST = 1_000_000
#: Bound on coordinates and sizes: their products, and the squares of these, must be finite, too.
LARGEST = 1e60
#: Largest logarithm of the ratio of two cells of one mesh.
STEEPEST = 8.0


def check_count(value: int, name: str, least: int = 1) -> None:
    """Reject a count that is not an integer from ``least`` to `MOST`."""
    if not _is_one(value, int) or value < least:
        raise InvalidInputError(f"{name} must be an integer of at least {least}, got {brief(value)}")
    if value > MOST:
        raise InvalidInputError(f"{name} must be at most {MOST}, got {brief(value)}: choose a smaller count")


def check_numbers(**given: Any) -> None:
    """Reject arguments, given by their names, that are not finite numbers, or too large to be multiplied."""
    for name, value in given.items():
        if not _is_number(value):
            raise InvalidInputError(f"{name} must be a finite number below {LARGEST:g}, got {brief(value)}")


def check_grading(value: Any) -> None:
    """Reject a grading, the logarithm of a ratio of cells of one mesh, that is negative or too large."""
    check_numbers(grading=value)
    if not 0.0 <= value <= STEEPEST:
        raise InvalidInputError(f"grading must be from 0 to {STEEPEST:g}, got {value}: 0 gives equal cells")


def check_row(values: Any, name: str, count: int) -> None:
    """Reject a value that is not a sequence of ``count`` finite numbers."""
    known = _is_one(values, Sequence) and np.ndim(values) == 1 and len(values) == count
    if not known or not all(map(_is_number, values)):
        raise InvalidInputError(
            f"{name} must be {count} finite numbers of less than {LARGEST:g}, got {brief(values)}: give them"
        )


def check_each(fits: np.ndarray, needed: str, remedy: str, named: Callable[[int], str]) -> None:
    """Reject what is not all as needed; `named` describes one by its number."""
    if not fits.all():
        few, first = f"{np.count_nonzero(~fits)} of {len(fits)}", named(int(np.argmin(fits)))
        raise InvalidInputError(f"{needed}, {few} do not, first {first}: {remedy}")


def brief(value: Any) -> str:
    """Return a value for messages, also an integer that Python refuses to convert to text."""
    if isinstance(value, int) and value.bit_length() > 100:
        return "an integer of more than thirty digits"
    try:
        text = repr(value)
    except ValueError:  # such an integer inside it
        return f"a {type(value).__name__} of very large integers"
    return text if len(text) <= 200 else f"{text[:197]}..."


def _is_number(value: Any) -> bool:
    return _is_one(value, float) and -LARGEST < value < LARGEST


Class = TypeVar("Class", bound=type)

#: Plain types, their names, and other accepted types; a boolean is not a number.
_PLAIN: dict[Any, tuple[str, tuple[type, ...]]] = {
    float: ("a number", (int, float, np.integer, np.floating)),
    int: ("an integer", (int, np.integer)),
    bool: ("True or False", (bool, np.bool_)),
    str: ("a string", (str,)),
    NoneType: ("None", (NoneType,)),
}


def checked(*own: str) -> Callable[[Class], Class]:
    """Let a dataclass reject values whose types are not those of its fields, before its own checks.

    Vectors, given as any sequence, become tuples.

    Place it below ``@dataclass``.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass
        ... @checked()
        ... class Wire:
        ...     '''A wire.
        ...
        ...     Attributes:
        ...         radius: Above zero.
        ...     '''
        ...     radius: float
        >>> Wire("thick")
        Traceback (most recent call last):
        fenics_contact.errors.InvalidInputError: Wire.radius must be a number, got 'thick': above zero
    """

    def with_check(cls: Class) -> Class:
        further = getattr(cls, "__post_init__", _nothing_else)  # its own, or that of a base

        def __post_init__(self: Any) -> None:
            _check(self, cls, own)
            # Arrays do not compare, and what is built from equal ones must be equal.
            for name in _vectors(cls, own):
                value = getattr(self, name)
                given = value if type(value) is tuple else tuple(np.asarray(value).tolist())
                object.__setattr__(self, name, given)
            further(self)

        __post_init__.__doc__ = further.__doc__
        cls.__post_init__ = __post_init__  # type: ignore[attr-defined]
        return cls

    return with_check


def _nothing_else(instance: Any) -> None:
    """Reject values of other types."""


def _check(instance: Any, cls: type, own: tuple[str, ...]) -> None:
    """Reject the first field whose value does not fit its type."""
    hints = _hints(cls)
    for field in fields(instance):
        if field.name in own or field.name not in hints:
            continue
        name = f"{type(instance).__name__}.{field.name}"
        for place, hint, value in _misfits(getattr(instance, field.name), hints[field.name], name):
            explanation = meaning(type(instance), field.name)
            given = f"{place} must be {_named(hint)}, got {reprlib.repr(value)}"
            raise InvalidInputError(f"{given}: {explanation}" if explanation else given)


@cache
def _vectors(cls: type, own: tuple[str, ...]) -> tuple[str, ...]:
    """Return the fields that are vectors, but for those that a class checks on its own."""
    names = (each.name for each in fields(cls) if each.name not in own)
    return tuple(name for name in names if _hints(cls).get(name) == GivenVector)


@cache
def _hints(cls: type) -> dict[str, Any]:
    return get_type_hints(cls)


def _misfits(value: Any, hint: Any, place: str) -> list[tuple[str, Any, Any]]:
    """Return where a value does not fit first, the declared type and the value there; nothing if it fits."""
    if get_origin(hint) in (Union, UnionType):
        if not all(_misfits(value, option, place) for option in get_args(hint)):
            return []
        # For the alternative of the right form the misfit is located more precisely.
        every = (wrong for option in get_args(hint) for wrong in _misfits(value, option, place))
        return [next((wrong for wrong in every if wrong[0] != place), (place, hint, value))]
    if not _is_one(value, hint):
        return [(place, hint, value)]
    inside = get_args(hint)[-1 if get_origin(hint) is Mapping else 0 :]
    wrong = (_misfits(part, inside[0], f"{place}[{key!r}]") for key, part in _parts(value, hint))
    return next(filter(None, wrong), [])


def _is_one(value: Any, hint: Any) -> bool:
    """Return whether a value has the outer type of a hint, regardless of its content."""
    kind = get_origin(hint) or hint
    if kind is Any:
        return True
    if kind is Literal:
        return any(value == option and type(value) is type(option) for option in get_args(hint))
    if kind in _PLAIN:
        return isinstance(value, _PLAIN[kind][1]) and (kind is bool or not isinstance(value, bool))
    if kind in (Sequence, tuple):
        many = value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, Sequence)
        return many and not isinstance(value, str | bytes)
    if members := _members(kind):
        return all(hasattr(value, member) for member in members)
    return callable(value) if kind is Callable else isinstance(value, kind)


def _parts(value: Any, hint: Any) -> Sequence[tuple[Any, Any]]:
    """Return the items of a sequence or a mapping, with indices or keys."""
    kind = get_origin(hint)
    if kind is Mapping:
        return list(value.items())
    return list(enumerate(value)) if kind in (Sequence, tuple) else []


def _members(kind: Any) -> list[str]:
    """Return the members that a protocol requires; none for other types."""
    if not getattr(kind, "_is_protocol", False):
        return []
    protocols = [each for each in kind.__mro__ if getattr(each, "_is_protocol", False)]
    return [name for each in reversed(protocols) for name in vars(each) if not name.startswith("_")]


def _named(hint: Any) -> str:
    """Describe what a type requires."""
    kind, inside = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType, Literal):
        *first, last = [repr(part) if kind is Literal else _named(part) for part in inside]
        return f"{', '.join(first)} or {last}" if first else last
    if kind in _PLAIN:
        return _PLAIN[kind][0]
    if kind in (Sequence, tuple):
        return f"a sequence (each {_named(inside[0])})"
    if kind is Mapping:
        return f"a mapping (each value {_named(inside[-1])})"
    if members := _members(kind):
        return f"a {kind.__name__} with {', '.join(members[:-1])} and {members[-1]}"
    if kind is Callable:
        return "a function"
    name = str(kind.__name__)
    if not is_dataclass(kind):
        return f"a {name}"
    needed = [field.name for field in fields(kind) if field.default is field.default_factory is MISSING]
    return f"{name}({', '.join(needed)})"


Given = ParamSpec("Given")
Found = TypeVar("Found")


def naming_arguments(function: Callable[Given, Found]) -> Callable[Given, Found]:
    """Let a function that fails because an argument is of another kind than declared name the argument.

    The call itself is as it was: only an error that is none of this package's is looked into.

    Example:
        >>> @naming_arguments
        ... def size_of(path: str | Path) -> int:
        ...     '''Return a size.
        ...
        ...     Args:
        ...         path: File.
        ...     '''
        ...     return len(path.strip())
        >>> size_of(3)
        Traceback (most recent call last):
        fenics_contact.errors.InvalidInputError: size_of: path must be a string or a Path, got an int: file
    """

    @wraps(function)
    def called(*arguments: Given.args, **named: Given.kwargs) -> Found:
        try:
            return function(*arguments, **named)
        except FenicsContactError:
            raise
        except (AttributeError, TypeError, ValueError, LookupError) as error:
            words = _unfit_argument(function, arguments, named)
            if not words:
                raise
            raise InvalidInputError(words) from error

    return called


def _unfit_argument(function: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> str:
    """Return words on the first argument that does not fit its declaration, "" if all do."""
    try:
        given = signature(function).bind(*arguments, **named).arguments
    except TypeError:
        return ""  # Python names arguments that are missing or too many
    hints = _argument_hints(inspect.unwrap(function))
    for name, value in given.items():
        wrong: list[tuple[str, Any, Any]] = []
        with suppress(TypeError):  # a declaration that no value can be compared with
            wrong = _misfits(value, hints.get(name, Any), name)
        for place, hint, found in wrong:
            words = f"{function.__name__}: {place} must be {_kinds(hint)}, got {kind_in_words(type(found))}"
            explanation = meaning(function, name)
            return f"{words}: {explanation}" if explanation else words
    return ""


@cache
def _argument_hints(function: Any) -> dict[str, Any]:
    """Return the declared types of arguments, those too that are imported for type checkers alone."""
    known: dict[str, Any] = {name: module for name, module in sys.modules.items() if "." not in name}
    of_package = function.__module__.startswith("fenics_contact.")
    for name, home in homes(function.__module__).items() if of_package else ():
        with suppress(ImportError, AttributeError):
            known[name] = getattr(import_module(home), name)
    try:
        return get_type_hints(function, localns=known)
    except (AttributeError, NameError, TypeError):  # of a library that is not loaded
        return {}


def _kinds(hint: Any) -> str:
    """Describe the kinds of values that fit a type."""
    if get_origin(hint) in (Union, UnionType):
        *first, last = [_kinds(part) for part in get_args(hint)]
        return f"{', '.join(first)} or {last}" if first else last
    return kind_in_words(hint) if isinstance(hint, type) and hint not in _PLAIN else _named(hint)


def kind_in_words(kind: type) -> str:
    """Return the name of a class with its article."""
    if kind is NoneType:
        return "None"
    return f"{'an' if kind.__name__[0] in 'AEIOUaeio' else 'a'} {kind.__name__}"


def meaning(owner: Any, name: str) -> str:
    """Return the documentation of a field or an argument of a class or function, "" if there is none."""
    for known in getattr(owner, "__mro__", (owner,)):
        text = inspect.cleandoc(known.__doc__ or "")
        if match := re.search(rf"^    {name}: (.*(?:\n {{8}}.*)*)", text, re.MULTILINE):
            words = re.split(r"\.(?: |$)", " ".join(match[1].split()))[0].replace("``", "")
            ordinary = words[1:2].islower() and "'s" not in words.split()[0]  # neither ΔT nor Poisson's
            return f"{words[0].lower() if ordinary else words[0]}{words[1:]}"
    return ""


def require_file(path: Path, what: str = "a file") -> None:
    """Reject a path that is not a readable file, also if its name is too long or its folder closed."""
    try:
        if path.is_file():
            return
        instead = "a folder" if path.is_dir() else "something else" if path.exists() else "none"
        reason = f"there is {instead}"
    except OSError as error:
        reason = f"it cannot be looked at: {error.strerror or error}"
    raise InvalidInputError(f"there must be {what} '{path}', {reason}: check the name and folder")


def run_file(path: Path) -> ModuleType:
    """Run a Python file of the user's own as a module."""
    require_file(path, "a Python file")
    name = f"_fenics_contact_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses of the file are looked up there
    with scene_file_code(f"the Python file '{path}'"):
        spec.loader.exec_module(module)
    return module


#: A vector given by a user.
GivenVector: TypeAlias = tuple[float, ...]


def floats(values: np.ndarray) -> GivenVector:
    """Return the entries of a one-dimensional array as plain numbers."""
    return tuple(float(value) for value in values)


def unit_vector(name: str, value: GivenVector, dim: int) -> GivenVector:
    """Return a direction at unit length."""
    length = float(np.linalg.norm(value)) if len(value) == dim else 0.0
    if not (np.isfinite(length) and length > 0):
        raise InvalidInputError(f"{name} must be {dim} finite numbers, not all zero, got {value!r}")
    return floats(np.asarray(value) / length)
