"""Pictures of a run, if the libraries for them are installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact.cli.desk import Console
from fenics_contact.contact import State, as_linear
from fenics_contact.errors import InvalidInputError, MissingRequirementError, agree
from fenics_contact.scene_file import SceneFile

if TYPE_CHECKING:
    from fenics_contact.viz import Units


@dataclass
class Gallery:
    """The pictures of a run: those that were drawn, and those that could not be."""

    drawn: list[Path] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def require_all(self) -> None:
        """Refuse to end well without a picture that the scene file requests, once everything else is written.

        Raises:
            InvalidInputError: If one is missing; the reason was said where it was drawn.
        """
        if self.missing:
            raise InvalidInputError(
                f"the pictures that a scene file requests must be possible, {', '.join(self.missing)} could "
                "not be drawn, everything else is written: take it out of [output] pictures, or run with "
                "--no-pictures"
            )


def can_draw(console: Console, file: SceneFile, gallery: Gallery) -> bool:
    """Return whether pictures can be drawn; if not, say what is missing for them. Collective."""
    error: Exception | None = None
    try:
        from fenics_contact.viz import check_renderer

        if console.comm.rank == 0:
            check_renderer()
    except MissingRequirementError as missing:
        error = missing
    try:
        agree(console.comm, error)
    except MissingRequirementError as missing:
        console.say(f"no pictures: {missing}")
        if "pictures" in file.document.output.model_fields_set:
            gallery.missing += [f"{kind}.png" for kind in file.document.output.pictures]
        return False
    return True


def units_of(file: SceneFile) -> Units:
    """Return the names of units for pictures."""
    from fenics_contact.viz import Units

    names = file.document.units
    return Units(length=names.length, force=names.force, stress=names.stress)


def draw_state(
    console: Console, file: SceneFile, states: Mapping[str, State], gallery: Gallery, suffix: str = ""
) -> None:
    """Draw the pictures that a file requests. Collective."""
    state = list(states.values())[-1]
    for kind in file.document.output.pictures:
        path = file.folder / f"{kind}{suffix}.png"
        try:
            _DRAWN[kind](file, states, state, path)
        except InvalidInputError as error:
            console.say(f"no picture {path.name}: {error}")
            gallery.missing.append(path.name)
        else:
            gallery.drawn.append(path)


def _stress(file: SceneFile, states: Mapping[str, State], state: State, path: Path) -> None:
    from fenics_contact.viz import plot_stress

    plot_stress(state, path, title=file.title, units=units_of(file))


def _pressure(file: SceneFile, states: Mapping[str, State], state: State, path: Path) -> None:
    from fenics_contact.viz import plot_contact_pressure

    plot_contact_pressure(state, path, title=file.title, units=units_of(file))


def _status(file: SceneFile, states: Mapping[str, State], state: State, path: Path) -> None:
    from fenics_contact.viz import plot_contact_status

    plot_contact_status(states, path, title=file.title, units=units_of(file))


def _decomposition(file: SceneFile, states: Mapping[str, State], state: State, path: Path) -> None:
    from fenics_contact.viz import plot_decomposition

    plot_decomposition(file.scene, file.partitions, path, comm=file.comm)


def _error(file: SceneFile, states: Mapping[str, State], state: State, path: Path) -> None:
    from fenics_contact.viz import plot_error

    errors = as_linear(state, "errors").estimate_errors(geometry=False)
    parts = {body: errors.by_cell(body) for body in state.scene.bodies}
    plot_error(state, path, parts, title=file.title, units=units_of(file))


_DRAWN: dict[str, Callable[[SceneFile, Mapping[str, State], State, Path], None]] = {
    "stress": _stress,
    "pressure": _pressure,
    "status": _status,
    "decomposition": _decomposition,
    "error": _error,
}
