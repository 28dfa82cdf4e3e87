"""A history of wear in a file, from which an interrupted run goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fenics_contact._base.checkpoint import Checkpoint
from fenics_contact._base.fingerprint import described
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact._scene.scene import LoadStep
from fenics_contact._wear.track import Track
from fenics_contact.errors import InvalidInputError

KIND = "history of wear"


class NotKept:
    """No file: every history begins anew, and none is kept."""

    def recalled(self, track: Track) -> tuple[tuple[Track, ...], Mapping[str, np.ndarray]]:
        """Return the histories that are stored, begun as a track, and arrays beside; none. Collective."""
        return (), {}

    def keep(self, tracks: Sequence[Track], **arrays: Any) -> None:
        """Write histories, and arrays beside. Collective."""

    def summary(self, jumps: int) -> str:
        """Describe what a run that ends now leaves, and how to continue it."""
        return f"after {jumps} jumps of wear, which are lost: give a checkpoint to keep them"


class KeptInFile(NotKept):
    """A file that is written after each jump."""

    def __init__(
        self, checkpoint: Checkpoint, problem: ContactProblem, steps: Sequence[LoadStep], **more: Any
    ) -> None:
        """Identify the history.

        Raises:
            InvalidInputError: If supports keep what they have, which is not stored.
        """
        supports = [part for step in steps if not callable(step.supports) for part in step.supports or ()]
        if any(part.keeps for part in supports):
            raise InvalidInputError(
                "a checkpoint of wear needs values of all supports, got HoldCurrent: give the displacements"
            )
        self._checkpoint, self._comm = checkpoint, problem.comm
        parts = {"scene": problem.scene, "partitions": problem.partitions, "steps": list(steps), **more}
        self._fingerprint = {
            key: text for name, part in parts.items() for key, text in described(part, name).items()
        }

    def recalled(self, track: Track) -> tuple[tuple[Track, ...], Mapping[str, np.ndarray]]:
        arrays = self._checkpoint.read(KIND, self._fingerprint, self._comm) or {}
        count = int(arrays["tracks"]) if arrays else 0
        return tuple(_restored(track, _within(arrays, number)) for number in range(count)), arrays

    def keep(self, tracks: Sequence[Track], **arrays: Any) -> None:
        stored = {
            f"{number}.{name}": array
            for number, track in enumerate(tracks)
            for name, array in _stored(track).items()
        }
        everything = {"tracks": np.array(len(tracks)), **arrays, **stored}
        self._checkpoint.write(KIND, self._fingerprint, everything, self._comm)

    def summary(self, jumps: int) -> str:
        return self._checkpoint.resume_hint(jumps, f"{jumps} jumps of wear")


def _within(arrays: Mapping[str, np.ndarray], number: int) -> dict[str, np.ndarray]:
    start = f"{number}."
    return {name.removeprefix(start): array for name, array in arrays.items() if name.startswith(start)}


def _stored(track: Track) -> dict[str, np.ndarray]:
    """Return the arrays from which a history goes on. Collective."""
    names = ("cycles", "steps", "volume", "jump")
    return {**stored_state(track.state), **{name: np.array(getattr(track, name)) for name in names}}


def _restored(track: Track, stored: Mapping[str, np.ndarray]) -> Track:
    """Return the history that arrays were made of, given one with the scene at its end. Collective."""
    jump = float(stored["jump"])
    scene = replace(track.scene, contacts=[pair.repeated(jump) for pair in track.scene.contacts])
    state, cycles = track.problem.restore(stored, scene), float(stored["cycles"])
    volume, steps = stored["volume"], int(stored["steps"])
    return Track(track.problem, scene, (state,), cycles, volume, steps, jump, before=(state,))
