"""What users call for a scene file: the models of its keys are loaded by the call, not with the name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact._base.checks import naming_arguments

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact._scene_file.reading import SceneFile


@naming_arguments
def read_scene_file(
    scene: str | Path | Mapping[str, Any],
    comm: MPI.Comm,
    *,
    overrides: Sequence[str] = (),
    python: bool = True,
) -> SceneFile:
    """Read and check a scene file, or a dictionary of the same form. Collective on ``comm``.

    Rank 0 reads, all ranks receive the text and raise the same mistakes.

    Args:
        scene: A TOML file, or a dictionary of its content.
        comm: Communicator on which meshes will be built and states computed.
        overrides: Other values for some keys, ``"contacts.0.friction.coefficient=0.2"``.
        python: Whether the file may name Python code ("file.py:Name"), which is run when the scene is built.
            Use False for an untrusted file.

    Returns:
        The file, checked as far as possible without building meshes.

    Raises:
        SceneFileError: Naming all mistakes, each with line, key, what is allowed and what was given.

    Example:
        >>> file = read_scene_file("two_blocks.toml", MPI.COMM_WORLD)  # doctest: +SKIP
        >>> state = file.solve()  # doctest: +SKIP
    """
    from fenics_contact._scene_file.document import refused_python
    from fenics_contact._scene_file.heat import HeatedFile, HeatFile
    from fenics_contact._scene_file.reading import SceneFile, source_of
    from fenics_contact._scene_file.source import SceneFileError
    from fenics_contact._scene_file.validation import validated, wrong_names

    source = source_of(scene, comm).with_overrides(overrides)
    of_heat: type[SceneFile] = HeatedFile if "materials" in source.data else HeatFile
    kind = of_heat if "heat" in source.data else SceneFile
    document = validated(source, kind.documents())
    wrong = wrong_names(source, document) or ([] if python else refused_python(source, document))
    if wrong:
        raise SceneFileError(source.name, wrong)
    return kind(source, document, comm)
