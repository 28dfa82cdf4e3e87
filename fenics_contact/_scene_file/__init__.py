"""Scenes as TOML files, checked line by line, or as dictionaries of the same form.

`read_scene_file` reads and checks, `SceneFile` builds the scene, its load steps and its shape optimisation;
`json_schema` is for editors. A `SceneFileError` lists all mistakes, each with line, key, what is allowed and
what was given.
"""

from typing import TYPE_CHECKING

from fenics_contact._base.late_names import late_names
from fenics_contact._scene_file import _libraries  # noqa: F401

if TYPE_CHECKING:
    from fenics_contact._scene_file.document import Document, UnitNames
    from fenics_contact._scene_file.entry import read_scene_file
    from fenics_contact._scene_file.reading import SceneFile, ShapeTask
    from fenics_contact._scene_file.source import Mistake, SceneFileError, Source, suggestion
    from fenics_contact._scene_file.validation import json_schema
    from fenics_contact._scene_file.values import Expression, VectorExpression

__all__ = [
    "Document",
    "Expression",
    "Mistake",
    "SceneFile",
    "SceneFileError",
    "ShapeTask",
    "Source",
    "UnitNames",
    "VectorExpression",
    "json_schema",
    "read_scene_file",
    "suggestion",
]

__getattr__, __dir__ = late_names(__name__)
