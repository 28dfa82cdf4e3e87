"""Parameters of a deck: numbers with names, ``width = 2*height``, for ``<width>`` in its cards."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from fenics_contact.readers.deck_cards import Card

_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: math.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
}  # fmt: skip
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    name: getattr(math, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sqrt", "exp", "log", "log10")
} | {"abs": abs, "float": float, "int": int, "min": min, "max": max}
_USED = re.compile(r"<\s*(\w+)\s*>")


def with_parameters(cards: Sequence[Card]) -> list[Card]:
    """Return the cards of a deck with the values of its *PARAMETER cards in place of their names."""
    known: dict[str, Any] = {}
    found = []
    for card in cards:
        if card.name == "PARAMETER":
            _read(card, known)
        else:
            found.append(_filled(card, known) if known else card)
    return found


def _read(card: Card, known: dict[str, Any]) -> None:
    """Add the values of a card to those that are known."""
    if card.parameters:
        raise card.error(f"parameters of *PARAMETER are not read, got {card.given}: give plain formulas")
    for row, line in enumerate(card.lines):
        text = line.partition("#")[0].strip().rstrip(";")
        name, equals, formula = (part.strip() for part in text.partition("="))
        if not equals or not name.isidentifier():
            raise card.error(f"needs a name, = and a formula, got {line.strip()!r}: correct it", row)
        try:
            known[name.upper()] = _value(ast.parse(formula, mode="eval").body, known)
        except (SyntaxError, KeyError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
            raise card.error(
                f"{formula!r} has no value ({error}): give numbers, names, + - * / **", row
            ) from None


def _value(node: ast.AST, known: Mapping[str, Any]) -> Any:
    """Return the value of a formula of numbers and names."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return value
        case ast.Name(id=name):
            return known[name.upper()]
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATORS[type(op)](_value(left, known), _value(right, known))
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATORS[type(op)](_value(operand, known))
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _FUNCTIONS[name.lower()](*(_value(each, known) for each in args))
    raise ValueError("it is no plain formula")


def _filled(card: Card, known: Mapping[str, Any]) -> Card:
    """Return a card with values in place of names in angle brackets."""

    def filled(text: str, row: int | None) -> str:
        def value(match: re.Match[str]) -> str:
            name = match.group(1).upper()
            return str(card.known("parameter", name, known, row))

        return _USED.sub(value, text) if "<" in text else text

    if card.name == "HEADING":
        return card
    parameters = {name: filled(value, None) for name, value in card.parameters.items()}
    lines = [filled(line, row) for row, line in enumerate(card.lines)]
    return replace(card, parameters=parameters, lines=lines)
