"""JSON schema of scene files, for editors."""

from __future__ import annotations

from typing import Any

from fenics_contact.scene_file.document import Document


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of scene files (Draft 2020-12), with descriptions and units.

    Editors that know TOML by schema (taplo, Even Better TOML) complete and check a file whose first line is
    ``#:schema scene_file.schema.json``; ``fenics-contact schema`` writes it.
    """
    schema = Document.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "Scene file of fenics_contact",
    }
