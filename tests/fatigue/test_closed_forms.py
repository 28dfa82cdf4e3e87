"""Critical planes of cycles that are known by formula, and circles against all pairs and triples."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from fenics_contact.fatigue import FatemiSocie, Findley, LifeCurve, SmithWatsonTopper, find_critical_planes
from fenics_contact.fatigue.circles import smallest_circles
from fenics_contact.fatigue.criteria import Criterion

YOUNG, POISSON = 2e5, 0.3
#: Amplitude and mean of a tension, k of Findley and of Fatemi and Socie, and σ_y.
A, M, K, F, Y = 100.0, 40.0, 0.3, 0.8, 300.0
WAY = np.append(2.0 * np.pi * np.arange(16) / 16, 0.0)
SINE, COSINE = np.sin(WAY), np.cos(WAY)
#: Axes that are in no plane of the net.
TURN = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]


def strain_of(stress: np.ndarray) -> np.ndarray:
    trace = np.trace(stress, axis1=-2, axis2=-1)[..., None, None]
    return np.asarray(((1.0 + POISSON) * stress - POISSON * trace * np.eye(3)) / YOUNG)


def cycle(tension: np.ndarray, shear: np.ndarray) -> np.ndarray:
    stress = np.zeros((len(tension), 1, 3, 3))
    stress[:, 0, 0, 0], stress[:, 0, 0, 1], stress[:, 0, 1, 0] = tension, shear, shear
    return TURN @ stress @ TURN.T


def parameter(criterion: Criterion, stress: np.ndarray, spacing: float = 5.0) -> float:
    return float(find_critical_planes(criterion, stress, strain_of(stress), spacing=spacing).parameter[0])


# φ: between the normal of a plane and the first principal axis; Mohr's circle of principal stresses ±R about
# their mean gives τ = R sin 2φ and σ_n = mean + R cos 2φ.
#
# Findley, tension σ: τ_a = A/2 sin 2φ, max σ_n = (M + A)/2 (1 + cos 2φ), so that
# P = k(M + A)/2 + ½ √(A² + k²(M + A)²) at tan 2φ = A / (k(M + A));
# with M = 0, P = A/2 (k + √(1 + k²)). Torsion: mean 0, R = A, P = A √(1 + k²).
# In phase with a shear of 0.6 A: R = √(A²/4 + 0.36 A²), mean A/2 at the largest, P = k A/2 + R √(1 + k²).
#
# Findley, tension A sin t, shear A/2 cos t: at each time √(σ²/4 + τ²) = A/2, so that no shear stress is
# larger, nor its circle, and σ_n ≤ σ/2 + A/2 ≤ A. On the plane across the bar both are so large:
# P = A (1/2 + k).
#
# Smith, Watson, Topper: tension, φ = 0: both factors are largest there, P = (M + A) A/E. Torsion: the plane
# of the largest tension, σ = A, Δε/2 = A (1 + ν)/E.
#
# Fatemi, Socie, tension: Δγ/2 = (1 + ν) A/E sin 2φ, so P = (1 + ν) A/E s (a + b c) with s, c = sin, cos 2φ,
# b = k(M + A)/(2σ_y), a = 1 + b; dP = 0: a c + b (2c² − 1) = 0.
def of_fatemi_and_socie() -> float:
    b = F * (M + A) / (2.0 * Y)
    a = 1.0 + b
    c = (np.sqrt(a**2 + 8.0 * b**2) - a) / (4.0 * b)
    return float((1.0 + POISSON) * A / YOUNG * np.sqrt(1.0 - c**2) * (a + b * c))


PUSH, MEAN, TORSION = (
    cycle(A * SINE, 0.0 * SINE),
    cycle(M + A * SINE, 0.0 * SINE),
    cycle(0.0 * SINE, A * SINE),
)
ROOT = np.sqrt(1.0 + K**2)
FORMS: dict[str, tuple[Criterion, np.ndarray, float]] = {
    "push and pull": (Findley(K), PUSH, A / 2.0 * (K + ROOT)),
    "mean stress": (Findley(K), MEAN, K * (M + A) / 2.0 + 0.5 * np.hypot(A, K * (M + A))),
    "torsion": (Findley(K), TORSION, A * ROOT),
    "in phase": (Findley(K), cycle(A * SINE, 0.6 * A * SINE), K * A / 2.0 + A * np.sqrt(0.61) * ROOT),
    "out of phase": (Findley(K), cycle(A * SINE, A / 2.0 * COSINE), A * (0.5 + K)),
    "tension, SWT": (SmithWatsonTopper(), MEAN, (M + A) * A / YOUNG),
    "torsion, SWT": (SmithWatsonTopper(), TORSION, A * A * (1.0 + POISSON) / YOUNG),
    "tension, FS": (FatemiSocie(F, Y), MEAN, of_fatemi_and_socie()),
}


@pytest.mark.parametrize("name", FORMS)
def test_parameters_are_those_of_the_formula(name: str) -> None:
    criterion, stress, known = FORMS[name]
    assert parameter(criterion, stress) == pytest.approx(known, rel=1e-8)
    assert parameter(criterion, stress, spacing=15.0) == pytest.approx(known, rel=1e-8)


def test_planes_and_what_is_on_them_are_those_of_the_formula() -> None:
    found = find_critical_planes(SmithWatsonTopper(), MEAN, strain_of(MEAN))
    assert abs(found.normal[0] @ TURN[:, 0]) == pytest.approx(1.0, abs=1e-10)
    assert found.normal_stress[0] == pytest.approx(M + A, rel=1e-8)
    assert found.amplitude[0] == pytest.approx(A / YOUNG, rel=1e-8)
    findley = find_critical_planes(Findley(K), MEAN)
    assert abs(findley.normal[0] @ TURN[:, 0]) == pytest.approx(
        np.cos(0.5 * np.arctan2(A, K * (M + A))), rel=1e-6
    )


def test_the_largest_shear_of_plane_bodies_may_lie_out_of_their_plane() -> None:
    # Equal tension in both directions of the plane shears only planes that are inclined to it.
    stress = np.zeros((3, 1, 3, 3))
    stress[:, 0] = np.diag([1.0, 1.0, 2.0 * POISSON]) * np.array([A, -A, A])[:, None, None]
    found = find_critical_planes(Findley(0.0), stress)
    assert found.parameter[0] == pytest.approx(A / 2.0 * (1.0 - 2.0 * POISSON), rel=1e-8)
    assert abs(found.normal[0, 2]) == pytest.approx(np.sqrt(0.5), rel=1e-5)


@pytest.mark.slow
@pytest.mark.claim
def test_random_cycles_are_searched_as_by_a_far_finer_net() -> None:
    stress = np.random.default_rng(0).standard_normal((5, 6, 3, 3))
    stress = np.concatenate([stress + stress.swapaxes(2, 3), (stress + stress.swapaxes(2, 3))[:1]])
    for criterion in (Findley(K), SmithWatsonTopper(), FatemiSocie(F, 2.0)):
        coarse, fine = (
            find_critical_planes(criterion, stress, strain_of(stress), spacing=spacing).parameter
            for spacing in (5.0, 2.0)
        )
        np.testing.assert_allclose(coarse, fine, rtol=1e-8)


def by_trial(path: np.ndarray) -> float:
    """The smallest circle among those on all pairs and through all triples of points."""
    middles = [(path[i] + path[j]) / 2.0 for i, j in combinations(range(len(path)), 2)]
    for chosen in combinations(range(len(path)), 3):
        a, b, c = path[list(chosen)]
        sides = 2.0 * np.stack([b - a, c - a])
        middles.append(np.linalg.solve(sides, np.array([b @ b - a @ a, c @ c - a @ a])))
    return float(min(np.linalg.norm(path - middle, axis=1).max() for middle in middles))


def test_circles_are_the_smallest_of_all() -> None:
    paths = np.random.default_rng(0).standard_normal((11, 150, 2))
    paths[:, 100:] /= np.linalg.norm(paths[:, 100:], axis=2, keepdims=True) + 0.01
    paths[:, 140:, 1] *= 1e-3
    radius, slope = smallest_circles(paths)
    np.testing.assert_allclose(radius, [by_trial(path) for path in paths.swapaxes(0, 1)])
    assert set(np.count_nonzero(slope.any(axis=2), axis=0)) == {2, 3}


@pytest.mark.parametrize(
    ("path", "radius"),
    [
        (np.stack([COSINE, SINE], axis=1) + 100.0, 1.0),
        (np.linspace(-1.0, 1.0, 9)[:, None] * (3.0, 4.0), 5.0),
        (np.ones((4, 2)), 0.0),
        (np.array([[0.0], [3.0], [-1.0]]), 2.0),
    ],
)
def test_circles_of_a_round_a_straight_and_a_still_path(path: np.ndarray, radius: float) -> None:
    assert smallest_circles(path[:, None])[0][0] == pytest.approx(radius, rel=1e-12, abs=1e-14)


def test_radii_have_the_derivatives_of_differences() -> None:
    rng, step = np.random.default_rng(1), 1e-6
    for width in (1, 2):
        paths, way = rng.standard_normal((2, 6, 80, width))
        near, far = (smallest_circles(paths + sign * step * way)[0] for sign in (-1.0, 1.0))
        slope = (smallest_circles(paths)[1] * way).sum(axis=(0, 2))
        np.testing.assert_allclose(slope, (far - near) / (2.0 * step), atol=1e-8)


@pytest.mark.parametrize("cycles", [0.7, 1e3, 1e7])
def test_lives_are_those_of_the_curve(cycles: float) -> None:
    curve = LifeCurve([(1000.0**2 / YOUNG, -0.2), (1000.0 * 0.5, -0.7)])
    made = sum(size * (2.0 * cycles) ** power for size, power in curve.terms)
    assert curve.cycles(made) == pytest.approx(cycles, rel=1e-10)
    assert LifeCurve([(1000.0, -0.1)]).cycles(500.0) == pytest.approx(512.0)
    assert np.isinf(curve.cycles(np.array([0.0, -1.0]))).all()
