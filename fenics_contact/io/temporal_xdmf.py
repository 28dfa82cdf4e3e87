"""XDMF files of a series: one grid per time, with mesh and fields from the file of each member."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path


def grid_of(path: Path, prefix: str, value: float) -> ET.Element:
    """Return mesh and fields of an XDMF file as one grid with a time.

    Args:
        path: File of `write_xdmf`: a grid of the mesh and a collection with one grid for each field.
        prefix: Folder of its HDF5 file as seen from the file of the series, with a slash at the end.
        value: The time.
    """
    domain = ET.parse(path).getroot().find("Domain")
    assert domain is not None
    mesh = domain.find("Grid[@GridType='Uniform']")
    assert mesh is not None
    grid = ET.Element("Grid", Name=path.stem, GridType="Uniform")
    ET.SubElement(grid, "Time", Value=repr(value))
    fields = [attribute for part in domain.iter("Grid") for attribute in part.findall("Attribute")]
    for part in (*mesh.findall("Topology"), *mesh.findall("Geometry"), *fields):
        grid.append(copy.deepcopy(part))
    for item in grid.iter("DataItem"):
        item.text = f"{prefix}{(item.text or '').strip()}"
    return grid


def temporal(name: str, grids: Sequence[ET.Element]) -> str:
    """Return the text of an XDMF file with one grid per time."""
    root = ET.Element("Xdmf", Version="3.0")
    domain = ET.SubElement(root, "Domain")
    collection = ET.SubElement(domain, "Grid", Name=name, GridType="Collection", CollectionType="Temporal")
    collection.extend(grids)
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'
