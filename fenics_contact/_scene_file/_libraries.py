"""The libraries that read scene files, checked by name before any of this folder imports them."""

from __future__ import annotations

from fenics_contact._base.requirements import require_extra

require_extra("scene files", "cli", "pydantic", "tomlkit")
