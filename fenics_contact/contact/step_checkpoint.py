"""The checkpoint of a load history: the states after the completed steps."""

from __future__ import annotations

import json
from contextlib import suppress

import numpy as np

from fenics_contact.checkpoint import Checkpoint, CheckpointError, without_checkpoint
from fenics_contact.contact.deformed_state import AnyState
from fenics_contact.contact.problem import ContactProblem
from fenics_contact.contact.stored import stored_state
from fenics_contact.display import counted
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.fingerprint import described, differences
from fenics_contact.scene import LoadStep, Scene

KIND = "load history"


class StepCheckpoint:
    """Reads the states of completed steps and writes new ones; does nothing without a checkpoint."""

    def __init__(self, checkpoint: Checkpoint | None, problem: ContactProblem) -> None:
        """Read the file if it exists. Collective.

        Args:
            checkpoint: The file, or None.
            problem: The problem of the history.

        Raises:
            InvalidInputError: If the file is not a checkpoint of this problem; says what to do.
        """
        self._checkpoint, self._comm = checkpoint, problem.comm
        self._arrays: dict[str, np.ndarray] = {}
        self._fingerprint: dict[str, str] = {}
        self._here, self._stored, self._written = 0, 0, 0
        if checkpoint is None:
            return
        names = ("scene", "partitions", "solver", "tolerance")
        for name in (*names, *(("steps",) if problem.scene.is_nonlinear else ())):
            self._fingerprint.update(described(getattr(problem, name), name))
        arrays = checkpoint.read(KIND, self._fingerprint, problem.comm)
        if arrays is not None:
            self._stored = self._written = int(arrays.pop("steps"))
            self._arrays = arrays

    @property
    def recalling(self) -> bool:
        """Whether the last step was read from the file."""
        return self._here <= self._stored

    def recalled(
        self,
        step: LoadStep,
        scene: Scene,
        problem: ContactProblem,
    ) -> AnyState | None:
        """Return the state after the next step if it is stored, else None. Collective.

        Args:
            step: The step.
            scene: The scene with its loads and supports.
            problem: The problem, whose last solution is the state before the step.

        Raises:
            InvalidInputError: If the stored step is a different one.
        """
        if self._here >= self._stored:
            return None
        names = [name for name in self._arrays if name.startswith(self._prefix)]
        stored = {name.removeprefix(self._prefix): self._arrays[name] for name in names}
        with together(self._comm):
            unlike = differences(json.loads(str(stored.pop("step"))), described(step, "step"))
            if unlike:
                raise InvalidInputError(
                    f"step {self._here} of the checkpoint is a different one; there and here differ "
                    f"{'; '.join(unlike)}: give the same steps to continue, or a new name to start anew"
                )
        self._here += 1
        problem.state = problem.restore(stored, scene)
        return problem.state

    def keep(self, step: LoadStep, state: AnyState) -> None:
        """Add the state after a step and write it if that is due. Collective.

        Raises:
            CheckpointError: If it cannot be written; the file is then unchanged.
        """
        if self._checkpoint is None:
            return
        self._arrays[f"{self._prefix}step"] = np.array(json.dumps(described(step, "step")))
        for name, values in stored_state(state).items():
            self._arrays[f"{self._prefix}{name}"] = values
        self._here += 1
        if self._here >= self._written + self._checkpoint.every:
            self.write()

    def write(self) -> None:
        """Write all steps unless the file holds them. Collective."""
        if self._checkpoint is not None and self._here > self._written:
            arrays = {"steps": np.array(self._here), **self._arrays}
            self._checkpoint.write(KIND, self._fingerprint, arrays, self._comm)
            self._written = self._here

    def write_rest(self) -> None:
        """Write the completed steps in the middle of a step, if that needs no other rank."""
        if self._comm.size == 1:
            with suppress(CheckpointError):
                self.write()

    def summary(self, done: int, count: int | None) -> str:
        """Describe what a run that ends now leaves, and how to continue it.

        Args:
            done: Number of completed steps.
            count: Number of all steps, None if unknown.
        """
        if self._checkpoint is None:
            return without_checkpoint(counted(done, "load step"))
        number = self._written
        words = f"{number} of {count}" if count is not None else f"{number}"
        steps = "load step" if (count or number) == 1 else "load steps"
        return self._checkpoint.resume_hint(number, f"{words} {steps}")

    @property
    def _prefix(self) -> str:
        return f"{self._here:06d}."
