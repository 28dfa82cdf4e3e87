"""Reading of scene files as objects for scripts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checkpoint import Checkpoint
from fenics_contact._base.checks import require_file
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import LoadSequence
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._scene_file.bodies import Shaped
from fenics_contact._scene_file.building import Builder, ShapeTask, shape_task, with_fields_read
from fenics_contact._scene_file.document import Document, load_steps, refused_python
from fenics_contact._scene_file.source import SceneFileError, Source, located, parse
from fenics_contact._scene_file.validation import validated, wrong_names
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI


#: Largest size of a scene file, in bytes.
LARGEST = 10_000_000


@dataclass(frozen=True, eq=False)
class SceneFile:
    """A scene file that was read and checked. Meshes are built on first access.

    Attributes:
        comm: Communicator on which it was read, and on which everything is built.
    """

    source: Source
    document: Document
    comm: MPI.Comm

    @property
    def name(self) -> str:
        """The file's name without suffix; "scene" for a dictionary."""
        return Path(self.source.name).stem if self.source.text else "scene"

    @property
    def title(self) -> str:
        """Title of pictures and tables."""
        return self.document.title or self.name.replace("_", " ").capitalize()

    @property
    def folder(self) -> Path:
        """Folder of the results, relative to where the program runs."""
        return Path(self.document.output.folder or f"output/{self.name}")

    @cached_property
    def _complete(self) -> Document:
        """The document with the fields of its files."""
        return with_fields_read(self.source, self.document, self.comm)

    @cached_property
    def _built(self) -> tuple[Scene, dict[str, Shaped]]:
        builder = Builder(self.source, self._complete, self.comm)
        bodies, shapes = builder.bodies()
        return builder.scene(bodies), shapes

    @property
    def scene(self) -> Scene:
        """The scene. Collective on first use."""
        return self._built[0]

    @cached_property
    def steps(self) -> tuple[LoadStep, ...]:
        """All load steps; empty where everything acts at once. Collective on first use."""
        document, bodies = self._complete, self.scene.bodies
        return load_steps(document.steps, document.supports, document.loads, bodies, self._at)

    @cached_property
    def partitions(self) -> dict[str, np.ndarray]:
        """Body name -> subdomain of every cell. Collective on first use."""
        scene = self.scene
        with self._at("solver", "subdomains"), together(self.comm):
            return self.document.solver.cut(scene, self.comm.size)

    @property
    def problem(self) -> ContactProblem:
        """The scene with the solver of the file, nothing solved yet. Collective on first use."""
        solver = self.document.solver
        with self._at("solver"):
            chosen = solver.chosen(self.scene, self.partitions)
        with self._at("solver", "newton"):
            steps = solver.following(self.scene)
        return ContactProblem(
            self.scene,
            self.comm,
            partitions=self.partitions,
            solver=chosen,
            tolerance=solver.accuracy(self.scene),
            steps=steps,
        )

    def solve(self) -> State:
        """Compute the equilibrium, of the last load step if there are any. Collective.

        Raises:
            InfeasibleError: If some body is not held against its load.
            ConvergenceError: If the solver does not reach its tolerance.
        """
        if self.steps:
            sequence = self.sequence()
            return [sequence.advance(step) for step in self.steps][-1]
        return self.problem.solve()

    def sequence(self, checkpoint: Checkpoint | None = None) -> LoadSequence:
        """Return the history of the scene before its first load step. Collective.

        `checkpoint`: file from which an interrupted history continues, or None.
        """
        return LoadSequence(self.problem, checkpoint=checkpoint, count=len(self.steps))

    def require_design(self) -> None:
        """Reject a file without an optimisation."""
        if self.document.design is None:
            words = (
                "an optimisation needs [design] with [[design.surfaces]], got none: add them, or find the "
                "state with `fenics-contact run`"
            )
            raise SceneFileError(self.source.name, [self.source.mistake((), words)])

    def shape_task(self) -> ShapeTask:
        """Return the shape optimisation that the file describes. Collective."""
        self.require_design()
        steps = self.steps
        with self._at("design"):
            _, shapes = self._built
            return shape_task(self.source, self.document, self.problem, shapes, steps)

    def _at(self, *keys: str | int) -> AbstractContextManager[None]:
        return located(self.source, keys)


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
    source = _source(scene, comm).with_overrides(overrides)
    document = validated(source)
    wrong = wrong_names(source, document) or ([] if python else refused_python(source, document))
    if wrong:
        raise SceneFileError(source.name, wrong)
    return SceneFile(source, document, comm)


def _source(scene: str | Path | Mapping[str, Any], comm: MPI.Comm) -> Source:
    if isinstance(scene, Mapping):
        return Source("the scene", Path(), scene)
    if not isinstance(scene, str | Path):
        raise InvalidInputError(
            f"a scene must be the path of a TOML file or a dictionary, got {type(scene).__name__}: give one "
            "of them"
        )
    path, text = Path(scene), ""
    with together(comm):
        if comm.rank == 0:
            text = _text_of(path)
    return parse(comm.bcast(text), path.name, path.parent)


def _text_of(path: Path) -> str:
    require_file(path, "a scene file")
    try:
        content = path.read_bytes() if path.stat().st_size <= LARGEST else None
    except OSError as error:
        raise InvalidInputError(
            f"the scene file '{path}' must be readable: {error.strerror or error}"
        ) from error
    if content is None:
        raise InvalidInputError(
            f"the scene file '{path}' must have at most {LARGEST // 10**6} MB, it has more: put meshes into "
            "files of their own"
        )
    try:
        return content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidInputError(
            f"the scene file '{path}' must be readable UTF-8 text, line {line} is not ({error.reason}): let "
            "the editor save it as UTF-8"
        ) from error
