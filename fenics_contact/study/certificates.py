"""Check that the certificate is never below the true error, and not far above it."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact.study.results import Results

#: Largest accepted ratio of a certificate to the true error.
LARGEST_FACTOR = 10.0


@dataclass(frozen=True)
class CertificateCheck:
    """The certificates of all runs compared with the true errors.

    Attributes:
        checked: Number of runs of which both are known.
        unknown: Number of runs without one of them.
        smallest_factor: Smallest ratio of the certificate to the true error, 1 or more if it is a bound.
        largest_factor: Largest ratio.
        broken: Descriptions of violations.
    """

    checked: int
    unknown: int
    smallest_factor: float | None
    largest_factor: float | None
    broken: tuple[str, ...]


def check_certificates(results: Results) -> CertificateCheck:
    """Compare the certificate of every run with its true algebraic error.

    The reference solution has a certificate of its own, which is the uncertainty of the comparison.
    """
    factors, broken, unknown = [], [], 0
    for run in results.good:
        bound = (run.parts or {}).get("algebraic")
        if bound is None or run.true_errors is None:
            unknown += 1
            continue
        true, doubt = run.true_errors["algebraic"], run.true_errors["uncertainty"]
        if bound + doubt < true:
            broken.append(f"{run.parameters}: {bound:.3e} is below the true error {true:.3e}")
        if bound > LARGEST_FACTOR * (true + doubt):
            times = f"more than {LARGEST_FACTOR:g} times the true error"
            broken.append(f"{run.parameters}: {bound:.3e} is {times} {true:.3e}")
        if true > doubt:
            factors.append(bound / true)
    return CertificateCheck(
        len(results.good) - unknown,
        unknown,
        min(factors, default=None),
        max(factors, default=None),
        tuple(broken),
    )
