"""The rows of the results table: what each is computed from, and what it should be."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks.comparing import Record, force_difference, potential_difference, require_agreement
from benchmarks.plan import LINEAR

#: One record by the name of its run.
Summaries = Mapping[str, Record]


@dataclass(frozen=True)
class Row:
    """One figure with its target.

    Attributes:
        name: Short name.
        quantity: What it is, in words.
        unit: Of value and target.
        target: What the value should reach.
        better: ``"lower"`` or ``"higher"``.
        value: Computes it from the records; a KeyError says that a run is missing or was refused.
        of: Run that tells ranks and unknowns.
    """

    name: str
    quantity: str
    unit: str
    target: float
    better: str
    value: Callable[[Summaries], float]
    of: str = "chain"

    def met(self, value: float) -> bool:
        """Tell whether a value reaches the target."""
        return value <= self.target if self.better == "lower" else value >= self.target

    def record(self, summaries: Summaries) -> dict[str, Any]:
        """Return the row as `results.json` has it.

        Raises:
            KeyError: If a run that it needs is missing or was refused.
        """
        run = summaries[self.of]
        return {
            "name": self.name,
            "quantity": self.quantity,
            "value": self.value(summaries),
            "unit": self.unit,
            "target": self.target,
            "better": self.better,
            "ranks": run["ranks"],
            "unknowns": unknowns(run if "counts" in run else summaries["chain"]),
        }


def unknowns(run: Record) -> int:
    """Return the unknowns of a run: of the untorn problem where other solvers solve it too."""
    counts = run["counts"]
    return int(counts.get("unknowns") or counts["torn_unknowns"])


def newton_names(size: str) -> tuple[str, str]:
    """Return the runs of monolithic Newton: two ranks, and one rank with two threads."""
    return f"newton-{size}-ranks", f"newton-{size}-threads"


def _products(run: str) -> Callable[[Summaries], float]:
    return lambda summaries: summaries[run]["counts"]["f_products"]


def _over_linear(summaries: Summaries) -> float:
    counts = summaries["linear-face"]["counts"]
    return counts["f_products"] / counts["linear_products"]


def _converges_or_is_refused(run: str) -> Callable[[Summaries], float]:
    return lambda all_: float("counts" in all_[run] or all_[run]["refused"] == "InfeasibleError")


def _ratio(one: str, other: str, figure: Callable[[Record], float]) -> Callable[[Summaries], float]:
    return lambda summaries: figure(summaries[one]) / figure(summaries[other])


def _against_newton(figure: Callable[[Record, Record], float]) -> Callable[[Summaries], float]:
    """Compare with the faster Newton run of the block, which must agree."""

    def value(summaries: Summaries) -> float:
        ours = summaries["block-92k"]
        newton = [summaries[name] for name in newton_names("92k") if name in summaries]
        if not newton:
            raise KeyError(newton_names("92k")[0])
        fastest = min(newton, key=_seconds)
        require_agreement("block-92k", ours, fastest)
        return figure(ours, fastest)

    return value


def _default_over_boxes(run: str) -> Callable[[Summaries], float]:
    def value(summaries: Summaries) -> float:
        default, by_hand = summaries[run], summaries[f"{run}-boxes"]
        require_agreement(f"{run}-boxes", default, by_hand)
        return _seconds(default) / _seconds(by_hand)

    return value


def _largest(difference: Callable[[Record, Record], float], *others: str) -> Callable[[Summaries], float]:
    return lambda summaries: max(
        difference(summaries["chain-compared-1"], summaries[f"chain-compared-{other}"]) for other in others
    )


def _efficiency(figure: Callable[[Record], float]) -> Callable[[Summaries], float]:
    return lambda summaries: figure(summaries["chain-1-rank"]) / (2 * figure(summaries["chain"]))


def _seconds(run: Record) -> float:
    return run["seconds"]


ROWS = (
    Row(
        "products", "F-products, μ = 0.3, paper's chain, cold, residuals 1e-6", "products", 90, "lower",
        _products("chain"),
    ),
    Row(
        "products-friction-0.1", "F-products, μ = 0.1, link 2 floating", "products", 130, "lower",
        _products("chain-friction-0.1"), "chain-friction-0.1",
    ),
    Row(
        "products-friction-0.6", "F-products, μ = 0.6, link 2 floating", "products", 130, "lower",
        _products("chain-friction-0.6"), "chain-friction-0.6",
    ),
    *(
        Row(
            f"friction-{mu}", f"μ = {mu} converges or is refused as not held", "(1 = yes)", 1, "higher",
            _converges_or_is_refused(f"chain-friction-{mu}"), f"chain-friction-{mu}",
        )
        for mu in ("0.01", "0")
    ),
    Row(
        "products-refined", "F-products, chain refined twice", "products", 150, "lower",
        _products("chain-refined-2"), "chain-refined-2",
    ),
    Row(
        "products-over-linear", "F-products of the state / of one linear solve with its final face", "ratio",
        2, "lower", _over_linear, "linear-face",
    ),
    Row(
        "products-frictionless", "F-products, frictionless block, residuals 1e-6", "products", 27, "lower",
        _products("frictionless-block"), "frictionless-block",
    ),
    Row("cold-state", "paper's chain, gmsh to state", "s", 6, "lower", lambda s: s["chain"]["seconds"]),
    Row(
        "design-step", "one more design / cold state of the same run", "ratio", 0.4, "lower",
        lambda s: s["design-step"]["ratio"], "design-step",
    ),
    Row(
        "optimisation", "whole shape optimisation at paper size", "s", 60, "lower",
        lambda s: s["shape-optimisation"]["seconds"], "shape-optimisation",
    ),
    Row(
        "newton-seconds", "monolithic Newton + MUMPS / this package, seconds, block 92k", "ratio", 15,
        "higher", _against_newton(lambda ours, newton: newton["seconds"] / ours["seconds"]), "block-92k",
    ),
    Row(
        "newton-memory", "this package / monolithic Newton + MUMPS, peak memory, block 92k", "ratio", 0.25,
        "lower", _against_newton(lambda ours, newton: ours["peak_memory"] / newton["peak_memory"]),
        "block-92k",
    ),
    *(
        Row(
            f"{solver}-seconds", f"one linear solve by {words} / state with friction, seconds, block 92k",
            "ratio", target, "higher", _ratio(f"{solver}-92k", "block-92k", _seconds), "block-92k",
        )
        for (solver, words), target in zip(LINEAR.items(), (1.67, 1), strict=True)
    ),
    Row(
        "gamg-part", "one linear solve by CG + GAMG / state with friction, seconds, CAD part of tetrahedra",
        "ratio", 1, "higher", _ratio("gamg-part", "part", _seconds), "part",
    ),
    Row(
        "default-partition", "default partition / boxes by hand, seconds, block 92k", "ratio", 1.2, "lower",
        _default_over_boxes("block-92k"), "block-92k",
    ),
    Row(
        "default-partition-chain", "default partition / boxes by hand, seconds, paper's chain", "ratio", 1.2,
        "lower", _ratio("chain-default", "chain", _seconds), "chain-default",
    ),
    *(
        Row(
            f"products-{kind}", f"F-products, chain of {words}, default partition", "products", 90, "lower",
            _products(f"chain-{kind}"), f"chain-{kind}",
        )
        for kind, words in (("equal", "equal cells"), ("tetrahedra", "tetrahedra"))
    ),
    Row(
        "tetrahedra", "chain of tetrahedra / of hexahedra, seconds, default partitions", "ratio", 1.2,
        "lower", _ratio("chain-tetrahedra", "chain-default", _seconds), "chain-tetrahedra",
    ),
    Row(
        "growth", "seconds per unknown, chain refined three times / not refined", "ratio", 1.5, "lower",
        _ratio("chain-refined-3", "chain-default", lambda run: run["seconds"] / unknowns(run)),
        "chain-refined-3",
    ),
    Row(
        "memory", "peak memory per unknown, chain refined three times", "kB", 6, "lower",
        lambda s: s["chain-refined-3"]["peak_memory"] / 1000 / unknowns(s["chain-refined-3"]),
        "chain-refined-3",
    ),
    Row(
        "efficiency", "two ranks against one, whole cold state", "efficiency", 0.85, "higher",
        _efficiency(_seconds),
    ),
    Row(
        "efficiency-solve", "two ranks against one, solve phase", "efficiency", 0.85, "higher",
        _efficiency(lambda run: run["phases"]["solve"]),
    ),
    Row(
        "potential-ranks", "J on 1, 2 and 4 ranks, relative", "difference", 1e-8, "lower",
        _largest(potential_difference, "2", "4"), "chain-compared-4",
    ),
    Row(
        "forces-ranks", "contact forces on 1, 2 and 4 ranks, relative", "difference", 1e-6, "lower",
        _largest(force_difference, "2", "4"), "chain-compared-4",
    ),
    Row(
        "potential-partitions", "J with other partitions, relative", "difference", 1e-8, "lower",
        _largest(potential_difference, "boxes", "bisection"), "chain-compared-boxes",
    ),
    Row(
        "forces-partitions", "contact forces with other partitions, relative", "difference", 1e-6, "lower",
        _largest(force_difference, "boxes", "bisection"), "chain-compared-boxes",
    ),
)  # fmt: skip
