"""VTX files, the parallel format of ADIOS2, if dolfinx was built with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from fenics_contact import _dolfinx
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.io.names import checked_name, file_of_each
from fenics_contact.io.replacing import replacing_together
from fenics_contact.io.xdmf import parallel_size


@collectively("write_vtx", lambda state, *_, **__: state.torn.decomposition.comm)
def write_vtx(
    state: State, folder: str | Path, name: str = "state", *, value: float = 0.0
) -> dict[str, tuple[Path, Path]]:
    """Write displacement and von Mises stress of every body in the VTX format. Collective; all ranks write.

    The format is a folder, ``.bp``, which ParaView opens as a file. One holds the displacement, another the
    stress (as a discontinuous field), as all fields of one must have the same nodes.

    Args:
        state: The state.
        folder: Output folder; created.
        name: Beginning of the names: "state" gives "state_link_1_displacement.bp" and
            "state_link_1_von_mises.bp" for a body "link 1". They are replaced when the new ones are complete.
        value: Time that ParaView shows.

    Returns:
        Body name -> its two folders.

    Raises:
        InvalidInputError: If dolfinx was built without ADIOS2, or the name contains a folder.
    """
    comm = state.torn.decomposition.comm
    with together(comm):
        require_vtx()
        base = checked_name(folder, name, "")
    written = {}
    for body, target in file_of_each(state.displacement, base.parent, name, "").items():
        fields = (state.displacement[body], state.von_mises[body])
        pair = [target.with_name(f"{target.name}_{field.name}.bp") for field in fields]
        for path, field, cellwise in zip(pair, fields, (False, True), strict=True):
            write = partial(_write, path.name, field, value, cellwise)
            size = 8 * parallel_size(field.function_space.mesh)  # a discontinuous field has its own nodes
            replacing_together(comm, [path], write, size=size)
        written[body] = (pair[0], pair[1])
    return written


def require_vtx() -> None:
    """Raise if ADIOS2 is missing.

    Raises:
        InvalidInputError: Names the formats to use instead.
    """
    if not _dolfinx.has_vtx():
        version = ".".join(map(str, _dolfinx.version()))
        raise InvalidInputError(
            f"VTX files need a dolfinx that was built with ADIOS2, this one ({version}) was not: use the "
            "formats 'vtu' and 'xdmf', which every dolfinx has; dolfinx of Debian 13 and of conda-forge has "
            "ADIOS2"
        )


def _write(name: str, field: object, value: float, cellwise: bool, hidden: Path) -> None:
    _dolfinx.write_vtx(hidden / name, field, value, cellwise=cellwise)
