"""XDMF files of the fields on the bodies' own meshes, written by dolfinx."""

from __future__ import annotations

from pathlib import Path

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, collectively
from fenics_contact.io.names import file_of_each
from fenics_contact.io.replacing import replacing_together


@collectively("write_xdmf", lambda state, *_, **__: state.torn.decomposition.comm)
def write_xdmf(state: State, path: str | Path) -> dict[str, Path]:
    """Write displacement and von Mises stress of every body to XDMF, all ranks together. Collective.

    The data are in HDF5 files beside them. ParaView opens them with its "Xdmf3 Reader S".

    Args:
        state: The state.
        path: Name from which those of the files are derived: for the body "link 1" "chain.xdmf" becomes
            "chain_link_1.xdmf" and "chain_link_1.h5". The folder is created; files are replaced when the new
            ones are complete.

    Returns:
        Body name -> its XDMF file.

    Raises:
        InvalidInputError: If the name does not end in ".xdmf".
    """
    base = Path(path)
    if base.suffix != ".xdmf":
        raise InvalidInputError(
            f"the file must be an XDMF file, got the name {base.name!r}: let it end in '.xdmf'"
        )
    files = file_of_each(state.displacement, base.parent, base.stem, ".xdmf")
    for name, target in files.items():
        _write(state.torn.decomposition.comm, target, state.displacement[name], state.von_mises[name])
    return files


#: The standard name of the rule that grids include the mesh, and what dolfinx 0.9 writes instead, with which
#: ParaView finds no mesh and VTK's reader crashes.
_XINCLUDE, _UNKNOWN = "http://www.w3.org/2001/XInclude", "https://www.w3.org/2001/XInclude"


def _write(
    comm: MPI.Comm, target: Path, displacement: _dolfinx.fem.Function, von_mises: _dolfinx.fem.Function
) -> None:
    mesh = displacement.function_space.mesh
    # The XDMF file names its HDF5 file: both keep their names and are written in a separate folder.
    replacing_together(
        comm,
        [target.with_suffix(".h5"), target],
        lambda hidden: _dolfinx.write_xdmf(hidden / target.name, mesh, [displacement, von_mises]),
        size=parallel_size(mesh),
        repair=lambda hidden: _repair(hidden / target.name),
    )


def parallel_size(mesh: _dolfinx.mesh.Mesh) -> int:
    """Return the approximate bytes of a file with a mesh, its displacement and a field on its cells."""
    nodes = mesh.geometry.index_map().size_global
    cells = mesh.topology.index_map(mesh.topology.dim).size_global
    return int(8 * (6 * nodes + 28 * cells) + 2**16)


def _repair(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(_UNKNOWN, _XINCLUDE), encoding="utf-8")
