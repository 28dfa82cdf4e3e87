"""Interactive scenes for a browser: a single HTML page that needs no other file and no network."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

from fenics_contact.viz.picture import written_path

#: Height of the scene in a notebook, in units of its screen.
HEIGHT = 520
#: The page is a frame of its own, so that its styles do not affect the notebook's.
_FRAME = (
    '<iframe srcdoc="{page}" style="width: 100%; height: {height}px; border: 1px solid #dddddd"></iframe>'
)
_CAPTION = (
    '<div style="position: absolute; left: 12px; top: 8px; z-index: 1; pointer-events: none; '
    'font: 15px sans-serif; color: #222222; background: #ffffffcc"><b>{title}</b><br>{entries}</div>'
)
_ENTRY = '<span style="color: {colour}; margin-right: 0.3em">&#9679;</span>{name}&emsp;'


@dataclass(frozen=True, eq=False)
class InteractiveScene:
    """A scene that Jupyter shows as the value of a cell; the mouse rotates, shifts and zooms it.

    It can be used like a path to its file. On ranks that did not draw it shows nothing.

    Attributes:
        html: The page on the rank that drew, None on the others.
        path: The file it was written to, None if it was not.
        height: Height in a notebook, in units of its screen.
    """

    html: str | None = field(repr=False)
    path: Path | None = None
    height: int = HEIGHT

    def __fspath__(self) -> str:
        """Return the path of the file.

        Raises:
            InvalidInputError: If the scene was written to no file.
        """
        return written_path(self.path, "function a path, such as path='stress.html'")

    def __str__(self) -> str:
        """Return the path of the file, or a text if there is none."""
        return "scene without a file" if self.path is None else str(self.path)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        if self.html is None:
            return {"text/plain": ""}
        page = html.escape(self.html, quote=True)
        return {"text/html": _FRAME.format(page=page, height=self.height), "text/plain": str(self)}


def exported(plotter: Any) -> str:
    """Return a plotter's scene as a page for the viewer of VTK.js, which it contains.

    Only trame's serializers are used: pyvista's own export starts a server, which looks for files on the
    network.

    Raises:
        ImportError: If trame-vtk is not installed.
    """
    serializers = import_module("trame_vtk.modules.vtk.serializers")
    pages = import_module("trame_vtk.tools.vtksz2html")
    plotter.render()
    window, camera = plotter.render_window, plotter.camera
    serializers.initialize_serializers()
    context = serializers.SynchronizationContext()
    context.set_ignore_last_dependencies(True)
    number = serializers.reference_id(window)
    scene = serializers.serialize(None, window, number, context, 1)
    turning = {"centerOfRotation": list(camera.focal_point), "camera": serializers.reference_id(camera)}
    scene["extra"] = {"vtkRefId": number, **turning}
    arrays = {
        entry["hash"]: {**entry, "content": context.get_cached_data_array(entry["hash"])}
        for entry in serializers.extract_array_hash(scene)
    }
    packed, page = BytesIO(), StringIO()
    with ZipFile(packed, "w", ZIP_DEFLATED) as archive:
        archive.writestr("index.json", json.dumps({"hashes": arrays, "scene": scene}))
    pages.write_html(packed.getvalue(), page)
    return page.getvalue()


def captioned(page: str, title: str, entries: Mapping[str, str]) -> str:
    """Put a title above a scene, and a legend: names and their colours."""
    listed = "".join(_ENTRY.format(colour=colour, name=html.escape(name)) for name, colour in entries.items())
    caption = _CAPTION.format(title=html.escape(title), entries=listed)
    # The viewer clears its container, which therefore must not be the whole page.
    return page.replace("<body>", f'<body>\n{caption}\n<div class="content" style="height: 100%"></div>', 1)
