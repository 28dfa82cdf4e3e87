"""The share of geometry in the errors of a state is what true surfaces on the same mesh would change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, TotalForce, solve_scene
from fenics_contact.gallery import LinkShape, block, half_cylinder, half_disc, two_links
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState

pytestmark = pytest.mark.slow

STEEL = IsotropicElasticity(1000.0, 0.3)


def crossed_cylinders(size: int) -> Scene:
    """Quarters of two cylinders at right angles, pressed together without friction."""
    upper = half_cylinder(10.0, 8.0, size, size, grading=2.0)
    lower = half_cylinder(12.0, 8.0, size - 1, size - 1, grading=2.0)
    lower = lower.placed(np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.zeros(3))
    guides = [Support("upper", "x0", (0, None, None)), Support("upper", "y0", (None, 0, None))]
    guides += [Support("lower", "x0", (None, 0, None)), Support("lower", "y0", (0, None, None))]
    return Scene(
        {"upper": Body(upper, STEEL), "lower": Body(lower, STEEL)},
        [Support("lower", "top"), *guides],
        [TotalForce("upper", "top", (0, 0, -60.0))],
        [ContactPair(Surface("upper", "contact"), Surface("lower", "contact"))],
    )


def two_discs(size: int) -> Scene:
    """Two half discs in the plane, the lower one stiff, with friction, on meshes that do not match."""
    soft, stiff = PlaneStrain(1000.0, 0.3), PlaneStrain(1e5, 0.3)
    upper, lower = half_disc(10.0, size, symmetry=""), half_disc(14.0, size + 1, symmetry="")
    lower = lower.placed(np.diag([-1.0, -1.0]), np.zeros(2))
    return Scene(
        {"upper": Body(upper, soft), "lower": Body(lower, stiff)},
        [Support("lower", "top", (0.0, 0.0)), Support("upper", "top", (0.02, -0.1))],
        [],
        [ContactPair(Surface("upper", "contact"), Surface("lower", "contact"), Coulomb(0.2), "mortar")],
    )


def links(size: int) -> Scene:
    """Two chain links."""
    pair = two_links(LinkShape(n_around=6 * size, n_a=2, n_b=2 * size))
    return Scene(
        {"one": Body(pair.first.mesh, STEEL), "two": Body(pair.second.mesh, STEEL)},
        [Support("one", "grip")],
        [TotalForce("two", "grip", (500.0, 0, 0))],
        [ContactPair(Surface("two", "contact"), Surface("one", "contact"), Coulomb(0.3))],
    )


def with_geometry(scene: Scene, geometry: str) -> Scene:
    """The scene with all surfaces taken in another way."""
    pairs = [replace(pair, geometry=geometry) for pair in scene.contacts]  # type: ignore[arg-type]
    return replace(scene, contacts=pairs)


def without_shapes(scene: Scene) -> Scene:
    """The scene with meshes that know nothing but their nodes."""
    bodies = {name: replace(body, mesh=body.mesh.with_shapes({})) for name, body in scene.bodies.items()}
    return replace(scene, bodies=bodies)


def solved(scene: Scene) -> AnyState:
    return solve_scene(scene, MPI.COMM_WORLD, solver=FaceNewton(tolerance=1e-8))


def distance(state: AnyState, true: AnyState) -> tuple[float, float]:
    """Relative distance in energy norm, and the relative error of the peak pressure."""
    way = true.dual_solution.multiplier - state.dual_solution.multiplier
    peaks = [each.contact.pressure.max() for each in (state, true)]
    energy = np.sqrt(way @ true.dual.apply(way)) / state.energies.norm
    return float(energy), float(abs(peaks[0] / peaks[1] - 1.0))


#: Claims rest on a coarse mesh and on one twice as fine; the others are slow.
CLAIM = pytest.mark.claim
SCENES = [
    pytest.param(build, size, marks=[CLAIM] if size in (4, 8) else [])
    for build, finest in ((crossed_cylinders, 12), (two_discs, 12), (links, 10))
    for size in (4, 6, 8, finest)
]


@pytest.mark.parametrize(("build", "size"), SCENES)
def test_facets_and_reconstructed_surfaces_are_as_wrong_as_they_are_said_to_be(
    build: Callable[[int], Scene], size: int
) -> None:
    scene = build(size)
    true, faceted = solved(scene), solved(with_geometry(scene, "faceted"))
    energy, peak = distance(faceted, true)
    assert energy > 1e-3, "the facets are no worse"
    by_facets = faceted.estimate_errors()
    assert 0.5 < by_facets.geometry / energy < 3.0
    assert 0.5 < by_facets.peak_by_geometry / peak < 3.0
    rebuilt = solved(without_shapes(scene))
    geometry = rebuilt.estimate_errors().geometry
    assert 0.5 * distance(rebuilt, true)[0] < geometry < 0.3 * by_facets.geometry


@CLAIM
def test_the_estimate_at_default_settings_is_that_of_a_solved_state() -> None:
    scene = with_geometry(crossed_cylinders(6), "faceted")
    loose, tight = solve_scene(scene, MPI.COMM_WORLD), solved(scene)
    before = loose.system.products
    assert np.isnan(loose.estimate_errors(geometry=False).geometry)
    assert str(loose.known_errors).endswith("geometry        not estimated")
    assert loose.system.products == before, "nothing is solved unless the geometry is asked about"
    assert loose.estimate_errors().geometry == pytest.approx(tight.estimate_errors().geometry, rel=1e-2)
    assert "in peak pressure" in str(loose.estimate_errors())


@CLAIM
def test_known_shapes_and_flat_surfaces_have_no_error_of_geometry() -> None:
    assert solved(crossed_cylinders(4)).estimate_errors().geometry == 0.0
    flat = {"low": block((0, 0, 0), (1, 1, 1), (2, 2, 2)), "high": block((0, 0, 1), (1, 1, 2), (3, 3, 3))}
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in flat.items()},
        [Support("low", "z0")],
        [TotalForce("high", "z1", (0, 0, -1.0))],
        [ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.3))],
    )
    assert solved(scene).estimate_errors().geometry == 0.0
