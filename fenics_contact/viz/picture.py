"""A finished picture, for notebooks and files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from fenics_contact.checkpoint import write_atomically
from fenics_contact.errors import InvalidInputError, together

if TYPE_CHECKING:
    from mpi4py import MPI

#: Largest width on the screen, in its own units.
SHOWN_WIDTH = 900


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that Jupyter shows as the value of a cell, and its file, if any.

    It can be used like a path to its file, as in ``open(picture)`` or ``Path(picture)``. On ranks that did
    not draw it has its path and shows nothing.

    Attributes:
        png: The PNG file's content on the rank that drew, None on the others.
        path: The file it was written to, None if it was not.
    """

    png: bytes | None = field(repr=False)
    path: Path | None = None

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height in pixels, None on ranks that did not draw."""
        if self.png is None:
            return None
        # A PNG file begins with 16 fixed bytes; then come width and height, four bytes each.
        return int.from_bytes(self.png[16:20], "big"), int.from_bytes(self.png[20:24], "big")

    def __fspath__(self) -> str:
        """Return the path of the file.

        Raises:
            InvalidInputError: If the picture was written to no file.
        """
        if self.path is None:
            raise InvalidInputError(
                "this needs the file of a picture, but the picture was not written: give the plot_ function "
                "a path, such as 'stress.png'"
            )
        return str(self.path)

    def __str__(self) -> str:
        """Return the path of the file, or a text if there is none."""
        return "picture without a file" if self.path is None else str(self.path)

    def _repr_png_(self) -> bytes | None:
        return self.png

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Show many pixels on a limited width: sharp on fine screens, and no wider than a notebook."""
        if self.png is None or self.size is None:
            return {"text/plain": ""}, {}
        width = min(self.size[0], SHOWN_WIDTH)
        return {"image/png": self.png, "text/plain": str(self)}, {"image/png": {"width": width}}


def png_path(path: str | Path | None) -> Path | None:
    """Return the path if it names a PNG file, else raise."""
    target = None if path is None else Path(path)
    if target is not None and target.suffix != ".png":
        raise InvalidInputError(f"pictures are PNG files, got the name {target.name!r}: let it end in '.png'")
    return target


def draw_picture(comm: MPI.Comm | None, path: Path | None, draw: Callable[[BinaryIO], None]) -> Picture:
    """Let rank 0 draw and write; if it fails, all ranks raise. Collective on ``comm`` if given.

    Args:
        comm: Communicator, None if this rank draws for itself.
        path: PNG file to write, or None.
        draw: Draws the picture into a file opened for bytes.
    """
    png = None
    with nullcontext() if comm is None else together(comm):
        if comm is None or comm.rank == 0:
            paper = BytesIO()
            draw(paper)
            png = paper.getvalue()
            if path is not None:
                write_atomically(path, png)
    return Picture(png, path)
