"""What users call for a web page: drawing libraries are loaded by the call, not with the name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.requirements import require_extra
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact._page.page import Page
    from fenics_contact.pictures.canvas import Units
    from fenics_contact.results.on_bodies import OnBodies


@naming_arguments
def result_page(
    result: OnBodies | Mapping[str, OnBodies] | str | Path,
    path: str | Path | None = None,
    *,
    field: str = "",
    title: str = "",
    units: Units | None = None,
    revolved: float = 0.0,
) -> Page:
    """Make a web page of a result: bodies to turn, to cut and to colour, curves and tables. Collective.

    The page is one file that works without a server and without a network, and in notebooks. It shows the
    bodies with any of their fields, a section, a magnified deformation, the contact, the load steps, the
    history of residuals, forces and moments, and how it was computed. It holds the meshes and all fields of
    all steps, numbers with four digits: for each step a megabyte for 15 000 cells, besides 5 MB for the
    library plotly, which draws.

    Args:
        result: A state; several by name, which become load steps, as do those of a series; or files: a folder
            of results, its result.json, or a .vtu, .vtm or .pvd file. Of files the page is made by the
            calling rank alone, and not collectively.
        path: HTML file to write, None to write none. A file of that name is replaced when the new one is
            complete.
        field: Name of the field that is shown first, such as "contact_pressure"; the others are in its menu.
        title: Title of the page; that of the result unless given.
        units: Names of the units; those of the result unless given.
        revolved: Angle in degrees by which the sections of bodies of revolution are turned around their axis,
            then that of z, such as 270, with vectors and stresses in space; 0 shows the sections.

    Returns:
        The page, which Jupyter shows as the value of a cell.

    Raises:
        InvalidInputError: If there is no such result, or it has no fields, or not the one to show first, or
            other bodies are to be turned.
        MissingRequirementError: If plotly or pyvista is missing.
        OutputError: If the file cannot be written.

    Example:
        >>> result_page("output/chain_links", "chain_links.html")  # doctest: +SKIP
        >>> result_page(state)  # in a notebook  # doctest: +SKIP
    """
    require_extra("web pages", "viz", "plotly", "pyvista")
    target = None if path is None else Path(path)
    if target is not None and target.suffix != ".html":
        raise InvalidInputError(f"pages are HTML files, got the name {target.name!r}: let it end in '.html'")
    from fenics_contact._page.page import page_of, source_of

    source = source_of(result, revolved)
    return page_of(source, target, title or source.title, units or source.units, field)
