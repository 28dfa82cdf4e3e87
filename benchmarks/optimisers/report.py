"""The page and the picture of the study."""

from __future__ import annotations

from typing import Any


def page(study: dict[str, Any]) -> str:
    return ""


def plot(path: Any, runs: Any) -> None:
    return None
