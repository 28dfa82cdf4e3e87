"""Wear over many cycles in jumps, whose error is that of two histories with jumps of different size."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.checkpoint import Checkpoint, safe_point
from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import Table, tabled
from fenics_contact._base.progress import Task
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import problem_of, require_steps
from fenics_contact._scene.checks import check_positive
from fenics_contact._scene.scene import LoadStep, Scene
from fenics_contact._wear.kept import KeptInFile, NotKept
from fenics_contact._wear.shapes import Follower, ShapeLost
from fenics_contact._wear.track import Track
from fenics_contact.errors import ConvergenceError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.results.deformed_state import AnyState

if TYPE_CHECKING:
    from mpi4py import MPI

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class WearJump:
    """One jump of a history of wear.

    Attributes:
        cycles: Cycles at its end.
        jump: Cycles in it; each of the two solutions of the finer history counts half of them.
        depth: Largest depth that has been worn off, of both surfaces of a pair together, [length].
        depth_error: Estimated error of the depths by all jumps so far, [length].
        volume: Volume that has been worn off, [length³].
        volume_error: Its estimated error.
        pressure: Largest pressure of the pairs that wear, a mean over the second half of the jump, [force /
            length²].
    """

    cycles: float
    jump: float
    depth: float
    depth_error: float
    volume: float
    volume_error: float
    pressure: float

    def excess(self, tolerance: float) -> float:
        """Return by how much errors are larger than a relative tolerance; one and less are small enough."""
        return (
            max(self.depth_error / (self.depth or 1.0), self.volume_error / (self.volume or 1.0)) / tolerance
        )

    def errs_more_than(self, other: WearJump) -> bool:
        """Return whether an error is larger than that of another jump."""
        return self.depth_error > other.depth_error or self.volume_error > other.volume_error


@dataclass(frozen=True)
class WearLimits:
    """What ends a history of wear before its cycles are done.

    Attributes:
        depth: Largest depth, [length].
        volume: Volume of all pairs, [length³].
        pressure: Pressure that the largest one has fallen to, [force / length²].

    Example:
        >>> until_worn_out = WearLimits(depth=0.05)
    """

    depth: float = np.inf
    volume: float = np.inf
    pressure: float = 0.0

    def reached(self, jump: WearJump) -> str:
        """Return which limit a history has reached, to a hundredth, in words; empty if none."""
        found = {
            f"the depth {self.depth:g} is reached": jump.depth >= 0.99 * self.depth,
            f"the volume {self.volume:g} is reached": jump.volume >= 0.99 * self.volume,
            f"the pressure has fallen to {self.pressure:g}": jump.pressure <= 1.01 * self.pressure,
        }
        return next((words for words, there in found.items() if there), "")

    def part(self, before: WearJump, after: WearJump) -> float:
        """Return the part of a jump at which the first limit is reached, by straight lines; else one."""
        limits = ((self.depth, "depth"), (self.volume, "volume"), (-self.pressure, "pressure"))
        parts = [1.0]
        for limit, name in limits:
            sign = np.sign(limit) or -1.0
            start, end = sign * getattr(before, name), sign * getattr(after, name)
            if np.isfinite(start) and end > limit > start:
                parts.append((limit - start) / (end - start))
        return min(parts)


@tabled
@dataclass(frozen=True, eq=False)
class WearHistory:
    """What has worn off over cycles.

    Attributes:
        jumps: One entry for each jump, in their order.
        state: The state at the end of the finer history; its scene has the shape that has followed so far,
            and its contact the depth that is still a gap.
        depth: Depth that its contact points have lost, extrapolated from both histories, shape (n_contact,),
            [length].
        depth_error: Its estimated error, the difference of both histories, shape (n_contact,), [length].
        volume: Volume that each pair has lost, shape (n_pairs,), [length³].
        reason: Why it ended.
    """

    jumps: tuple[WearJump, ...]
    state: AnyState
    depth: np.ndarray
    depth_error: np.ndarray
    volume: np.ndarray
    reason: str

    def _tables(self) -> list[Table]:
        """Return a table with one line for each jump."""
        names = ("cycles", "jump", "depth", "its error", "volume", "its error", "pressure")
        rows = [
            (
                f"{each.cycles:.6g}", f"{each.jump:.4g}", f"{each.depth:.6g}", f"{each.depth_error:.1e}",
                f"{each.volume:.6g}", f"{each.volume_error:.1e}", f"{each.pressure:.5g}",
            )
            for each in self.jumps
        ]  # fmt: skip
        return [Table([names, *rows], 0, notes=(self.reason,))]


@naming_arguments
def wear_to(
    problem: ContactProblem | Scene,
    cycles: float,
    comm: MPI.Comm | None = None,
    *,
    steps: Sequence[LoadStep] = (LoadStep("cycle"),),
    first: Sequence[LoadStep] = (),
    tolerance: float = 0.01,
    limits: WearLimits = WearLimits(),
    checkpoint: Checkpoint | None = None,
    follow: float = np.inf,
) -> WearHistory:
    """Follow wear over many cycles, in jumps whose error is estimated and kept small. Collective.

    One cycle is solved in place of many: its wear counts as often as the jump has cycles. Two histories go on
    side by side, one with jumps half as long as the other; where their depths and volumes differ by more than
    the tolerance, the jump is made shorter. As errors of wear die out, which the difference of whole
    histories knows, jumps become long once a contact has run in. Their error is proportional to the jumps:
    the answer is extrapolated from both, and errs by less than their difference, which is what is stated.

    Args:
        problem: Bodies, supports, loads and pairs, of which one at least wears, as a scene; or as a
            `ContactProblem`, which has further options.
        cycles: Number of cycles, > 0.
        comm: Communicator over which the subdomains of a scene are spread; a problem has its own.
        steps: Load steps of one cycle; by default one, with the loads of the scene, where pairs have a
            prescribed sliding.
        first: Load steps that act once before the first cycle, as one that presses.
        tolerance: Largest error of depths and volumes by jumps, relative to the largest depth and the volume.
        limits: Depth, volume or pressure at which the history ends.
        checkpoint: File that is written after each jump and from which an interrupted history goes on, also
            to more cycles or other limits, on any number of ranks.
        follow: Worn depth, relative to the size of facets, beyond which the meshes lose it and gaps are
            those of the new shape, ≥ 0, such as 0.2; before it is a gap. By default it always is, as where
            bodies deform much, and where pairs give their gaps. A history whose shape cannot follow ends, and
            says so; on coarse meshes moves may err more than the tolerance.

    Raises:
        InvalidInputError: If no pair wears, nothing slides in a cycle, or an argument is outside its range.
        ConvergenceError: If jumps of a billionth of all cycles are too long.

    Example:
        >>> history = wear_to(scene, 1e5, MPI.COMM_WORLD)  # doctest: +SKIP
        >>> print(history)  # doctest: +SKIP
        >>> to = LoadStep("to", supports=[Support("punch", "top", (0.02, None))])
        >>> fro = LoadStep("fro", supports=[Support("punch", "top", (-0.02, None))])
        >>> history = wear_to(scene, 18000, MPI.COMM_WORLD, steps=[to, fro])  # doctest: +SKIP
    """
    problem = problem_of(problem, comm, "wear_to")
    with together(problem.comm):
        require_steps(steps)
        require_steps(first)
        check_positive("cycles", cycles, "give how often the steps are repeated")
        if not 0.0 < tolerance < 1.0:
            raise InvalidInputError(f"tolerance must lie between 0 and 1, got {tolerance:g}: give 0.01")
        if not problem.scene.wears:
            raise InvalidInputError(
                "wear_to needs a pair that wears, got none: give ContactPair(wear=Wear(k))"
            )
        if not follow >= 0.0:
            raise InvalidInputError(f"follow must not be negative, got {follow:g}: give np.inf for never")
    kept = NotKept()
    if checkpoint is not None:
        if np.isfinite(follow):
            raise InvalidInputError(
                f"checkpoints of wear do not keep shapes, got follow={follow:g}: leave out one of both"
            )
        every = (*first, *steps)
        kept = KeptInFile(checkpoint, problem, every, first=len(first), tolerance=tolerance)
    begun = Track(problem, problem.scene, follower=Follower(follow))
    return _Pair(begun, steps, first, tolerance, limits, kept).to(cycles)


class _Pair:
    """Two histories side by side, of which one has jumps half as long.

    Where surfaces slide as load steps say a cycle is a whole: jumps are two cycles and more, before which all
    cycles are solved one by one, in both histories alike.
    """

    #: First jump, smallest jump, and last one, relative to all cycles: a short one, since pressures where
    #: surfaces have just met are those of a jump and not of its end. Largest jump, relative to cycles done.
    begin, least, end, growth = 1e-3, 1e-9, 2e-2, 3.0
    #: Part of an error to which a shorter jump must reduce it, and growth where it does not: what moves of
    #: the shape err is not the jump's.
    vain, retry = 0.9, 2.0
    #: Error of the jump that was refused last, relative to the tolerance.
    _refused = np.inf

    def __init__(
        self,
        begun: Track,
        steps: Sequence[LoadStep],
        first: Sequence[LoadStep],
        tolerance: float,
        limits: WearLimits,
        kept: NotKept,
    ) -> None:
        self._steps, self._tolerance, self._limits, self._kept = steps, tolerance, limits, kept
        self._comm = begun.problem.comm
        self._whole = any(wear.by_slip for pair in begun.scene.contacts for wear in pair.wears)
        self._singly = 1.0
        self._next, self.jumps = 0.0, list[WearJump]()
        tracks, arrays = kept.recalled(begun.at_end_of((*first, *steps)))
        if tracks:
            self._coarse, self._fine = tracks
            self._singly, self._next = (float(each) for each in arrays["pace"])
            self.jumps = [WearJump(*map(float, row)) for row in arrays["jumps"]]
            return
        for step in first:
            begun = begun.after([step], 1.0)
        self._coarse = self._fine = begun.begun()

    def to(self, cycles: float) -> WearHistory:
        """Return the history over so many cycles. Collective."""
        task, jump = Task("wear", unit="cycles"), self._next or self.begin * cycles
        reason = self._ended(cycles)
        with task:
            while not reason:
                rest = cycles - self._fine.cycles
                rest -= self.end * cycles if rest > 1.01 * self.end * cycles else 0.0
                jump, done = min(jump, rest) if jump < 0.75 * rest else rest, len(self.jumps)
                singly = self._whole and jump < 2.0
                try:
                    jump = self._singles(rest) if singly else self._jump(jump, self.least * cycles)
                except ShapeLost as failure:
                    if not self.jumps:
                        raise
                    reason = str(failure)
                    break
                if len(self.jumps) > done:
                    self._keep(jump)
                    task.step(round(self._last.cycles), words=f"depth {self._last.depth:.4g}")
                    reason = self._ended(cycles)
                safe_point(lambda: self._kept.summary(len(self.jumps)), lambda: None, self._comm)
        fine = self._fine
        volume = 2.0 * fine.volume - self._coarse.volume
        return WearHistory(tuple(self.jumps), fine.state, *_profile(self._coarse, fine), volume, reason)

    @property
    def _last(self) -> WearJump:
        """The last jump; before the first nothing."""
        return self.jumps[-1] if self.jumps else _NOTHING

    def _ended(self, cycles: float) -> str:
        """Return why the history ends here, in words; empty if it goes on."""
        done = "all cycles are done" if self._fine.cycles >= cycles * (1.0 - 1e-12) else ""
        return self._limits.reached(self._last) or done

    def _keep(self, jump: float) -> None:
        """Write the history, with the next jump. Collective."""
        table = np.array([astuple(each) for each in self.jumps])
        self._kept.keep((self._coarse, self._fine), jumps=table, pace=np.array([self._singly, jump]))

    def _singles(self, rest: float) -> float:
        """Go on by single cycles, twice as many as the time before; return the next jump. Collective."""
        for _ in range(int(self._singly)):
            single = min(1.0, rest)
            same = self._coarse is self._fine
            self._fine = self._fine.after(self._steps, single)
            self._coarse = self._fine if same else self._coarse.after(self._steps, single)
            self.jumps.append(_described(self._coarse, self._fine, single))
            self._require_wear(self.jumps[-1], self._fine)
            rest -= single
            if rest <= 0.0 or self._limits.reached(self.jumps[-1]):
                break
        self._singly *= 2.0
        return 2.0

    def _jump(self, jump: float, least: float) -> float:
        """Go on by a jump, or return a shorter one; return the next. Collective."""
        if jump <= least:
            raise ConvergenceError(
                f"jumps of wear must be longer than {least:.2g} cycles, after {self._fine.cycles:.6g} cycles "
                "shorter ones are needed: loosen the tolerance, or refine the contact"
            )
        try:
            coarse = self._coarse.after(self._steps, jump)
            fine = self._fine.after(self._steps, 0.5 * jump).after(self._steps, 0.5 * jump)
        except ConvergenceError as failure:
            safe_log(_LOG.info, "a jump of %g cycles is halved: %s", jump, failure)
            return 0.5 * jump
        found, last = _described(coarse, fine, jump), self._last
        self._require_wear(found, fine)
        excess = found.excess(self._tolerance)
        part = self._limits.part(last, found)
        if part < 0.99:
            return jump * max(part, 0.1)
        if excess > 1.0 and found.errs_more_than(last) and excess < self.vain * self._refused:
            self._refused = excess
            return jump * float(np.clip(0.8 / excess, 0.2, 0.7))
        vain, self._refused = excess > 1.0, np.inf
        self._coarse, self._fine = coarse, fine
        self.jumps.append(found)
        grown = self.retry if vain else float(np.clip(0.8 / (excess or 1e-300), 0.3, 1.0 + self.growth))
        return min(self._fine.cycles * self.growth, jump * grown)

    def _require_wear(self, found: WearJump, track: Track, still: float = 1e-10) -> None:
        """Reject a cycle in which nothing slides; `still`: slip that is rounding, relative to all bodies."""
        moved = still * float(np.ptp(track.scene.points))
        if found.volume == 0.0 or (self._whole and track.slip < moved):
            raise InvalidInputError(
                "something must wear in a cycle, but nothing slides under pressure there: give "
                "Wear(sliding=...), or steps= that move the bodies"
            )


_NOTHING = WearJump(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.inf)


def _profile(coarse: Track, fine: Track) -> tuple[np.ndarray, np.ndarray]:
    """Return depths extrapolated from two histories at the points of the finer one, and their errors."""
    difference = fine.depth - coarse.depth_at(fine)
    return np.maximum(fine.depth + difference, 0.0), np.abs(difference)


def _described(coarse: Track, fine: Track, jump: float) -> WearJump:
    """Return a jump of two histories."""
    (depth, error), volume = _profile(coarse, fine), float(2.0 * fine.volume.sum() - coarse.volume.sum())
    volume_error = float(np.abs(fine.volume - coarse.volume).sum())
    largest, errs = float(depth.max(initial=0.0)), float(error.max(initial=0.0))
    return WearJump(fine.cycles, jump, largest, errs, volume, volume_error, fine.pressure)
