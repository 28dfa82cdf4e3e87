"""A scene or a design as a plain function for other tools: sampling, surrogates, optimisers."""

from __future__ import annotations

from fenics_contact.outer.answer import Answer
from fenics_contact.outer.response import DesignResponse, SceneResponse
from fenics_contact.outer.served import served

__all__ = ["Answer", "DesignResponse", "SceneResponse", "served"]
