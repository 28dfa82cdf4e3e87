"""Errors of quantities of rubber, metal and bodies that slide far, by the tangents of their states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    GoalError,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    gallery,
    goal_error,
    quantity,
)
from fenics_contact.design.adjoint import WeakChoice, linearise_face
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.sensitivity import adjoint_of
from fenics_contact.feti.averages import nodal_mean
from fenics_contact.materials import (
    FinitePlasticity,
    IsotropicElasticity,
    Material,
    NeoHooke,
    PlaneStrain,
    StVenantKirchhoff,
)

SELF = MPI.COMM_SELF


def estimated(scene: Scene, name: str, **where: object) -> GoalError:
    state = ContactProblem(scene, SELF, tolerance=1e-9).solve(adjoint=True)
    return goal_error(state, quantity(name, scene, **where), tolerance=1e-8)  # type: ignore[arg-type]


def bent(material: Material, cells: int, cell: str = "triangle", size: float = 0.01) -> Scene:
    beam = gallery.rectangle((0, 0), (4, 1), (4 * cells, cells), cell)
    return Scene(
        {"beam": Body(beam, material)}, [Support("beam", "x0")], [Traction("beam", "x1", (0.0, -size))]
    )


def sinking(scene: Scene) -> GoalError:
    return estimated(scene, "displacement", surface="beam x1", direction=(0, -1))


def pressed(material: Material, cells: int, friction: Coulomb | None = None) -> Scene:
    pad = gallery.rectangle((0, 0), (2, 1), (2 * cells, cells))
    pair = ContactPair(Surface("pad", "y0"), RigidSphere((1.0, -2.0), 2.0), friction)
    return Scene({"pad": Body(pad, material)}, [Support("pad", "y1", (0.0, -0.25))], contacts=[pair])


def reaction(scene: Scene) -> GoalError:
    return estimated(scene, "reaction", surface="pad y1", direction=(0, -1))


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_in_small_strain_it_is_that_of_the_linear_material(cell: str) -> None:
    size = 1e-7
    linear = sinking(bent(PlaneStrain(1.0, 0.3), 3, cell, size))
    found = sinking(bent(StVenantKirchhoff(1.0, 0.3), 3, cell, size))
    assert linear.mesh > 0.05 * linear.value
    assert found.mesh == pytest.approx(linear.mesh, rel=1e-4)
    np.testing.assert_allclose(found.by_cell("beam"), linear.by_cell("beam"), rtol=1e-3)


def test_around_an_axis_and_in_space_it_is_that_of_the_linear_material() -> None:
    """Around an axis moduli hold for the mean radius of a cell."""
    section = gallery.rectangle((1, 0), (2, 2), (4, 8))
    cube = gallery.block((0, 0, 0), (2, 1, 1), (4, 2, 2))

    def of(material: Material, mesh: BodyMesh) -> GoalError:
        plane, last = mesh.dim == 2, "xyz"[mesh.dim - 1]
        body = Body(mesh, material, axisymmetric=plane)
        down = (*(0.0,) * (mesh.dim - 1), -1e-7)
        ends = [Support("body", f"{last}0"), Support("body", f"{last}1", down)]
        return estimated(Scene({"body": body}, ends), "reaction", surface=f"body {last}1", direction=down)

    for mesh, off in ((section, 1e-2), (cube, 1e-4)):
        linear, found = (of(law(1.0, 0.3), mesh) for law in (IsotropicElasticity, StVenantKirchhoff))
        assert abs(linear.mesh) > 1e-3 * abs(linear.value)
        assert found.mesh == pytest.approx(linear.mesh, rel=off)


def test_curved_boundaries_add_what_they_do_in_small_strain() -> None:
    def of(material: Material) -> GoalError:
        ring = gallery.disc(2.0, 3, hole=1.0)
        ends = [RigidSurface("ring", "inner", (0, 0), (0.0, 0.0), 0.0)]
        scene = Scene({"ring": Body(ring, material)}, ends, [Traction("ring", "outer", (0.0, -1e-7))])
        return estimated(scene, "displacement", surface="ring outer", direction=(0, -1))

    linear, found = of(PlaneStrain(1.0, 0.3)), of(StVenantKirchhoff(1.0, 0.3))
    assert abs(linear.geometry) > 1e-4 * linear.value
    assert found.geometry == pytest.approx(linear.geometry, rel=1e-2)


def test_estimates_tend_to_the_error_of_a_bent_rubber() -> None:
    """What is exact is 1.9269, of quadratic cells; the beam turns by 40°."""
    found = [sinking(bent(NeoHooke(1.0, 0.3), cells)) for cells in (4, 8)]
    shares = [each.total / (1.9269 - each.value) for each in found]
    assert found[0].value < 1.7
    assert shares == pytest.approx([0.85, 0.93], abs=0.05)


def test_estimates_of_nearly_incompressible_rubber_stay_as_small_as_its_errors() -> None:
    """What is exact is about 1.694; changes of volume times the bulk modulus would be twice that."""
    rubber = NeoHooke(1.0, 0.499, mean_dilatation=True)
    found = sinking(bent(rubber, 2, "quadrilateral"))
    assert abs(found.value - 1.694) < 0.02
    assert abs(found.total) < 0.015


def test_contact_between_nodes_counts_where_bodies_have_moved() -> None:
    """What is exact is 0.4568: errors inside bodies and between nodes cancel."""
    found = reaction(pressed(NeoHooke(1.0, 0.3), 6))
    assert abs(found.total - (0.4568 - found.value)) < 5e-4
    assert found.uncancelled > 5e-3


def test_metal_that_locks_has_most_of_its_error_estimated() -> None:
    """What is exact is about 2.4; quadrilaterals that must keep their volumes are too stiff."""
    found = reaction(pressed(FinitePlasticity(200.0, 0.3, 0.5, 2.0), 3))
    assert found.total / (2.4 - found.value) == pytest.approx(0.7, abs=0.1)


def test_hubs_that_forces_move_have_no_adjoint() -> None:
    ring = Body(gallery.disc(35.0, 2, hole=17.5), NeoHooke(0.275, 0.475))
    hub = RigidSurface("ring", "inner", (0.0, 0.0), (0.0, None), 0.0, force=(0.0, -2.0))
    pair = ContactPair(Surface("ring", "outer"), RigidPlane((0.0, -35.0), (0.0, 1.0)))
    scene = Scene({"ring": ring}, [hub], contacts=[pair])
    found = estimated(scene, "displacement", surface="ring outer", direction=(0, -1))
    assert "whole motion is prescribed" in found.without_adjoint
    assert np.isnan(found.mesh)
    assert found.by_cell("ring").max() > 0.0


@pytest.mark.parametrize("name", ["contact_force", "peak_pressure"])
def test_adjoints_of_moved_contact_are_those_of_difference_quotients(name: str) -> None:
    """Where nodes slide, directions of forces and areas change with the places of surfaces."""

    where: dict[str, Any] = {"direction": (0.3, 1.0)} if name == "contact_force" else {}

    def of(load: float) -> tuple[float, State]:
        scene = pressed(NeoHooke(1.0, 0.3), 4, Coulomb(0.05))
        scene = replace(scene, loads=[Traction("pad", "x1", (load, -0.3 * load))])
        state = ContactProblem(scene, SELF, tolerance=1e-11).solve()
        return quantity(name, scene, **where).value(state, ShapeForms.at_rest(state.torn)), state

    _, state = of(0.0)
    partials = quantity(name, state.scene, **where).partials(state, ShapeForms.at_rest(state.torn))
    adjoint, _, _ = adjoint_of(state, partials, linearise_face(state, WeakChoice.RELEASED), 1e-10)
    along = nodal_mean(state.torn.decomposition, adjoint.displacement) @ (1.0, -0.3)
    mesh = state.scene.bodies["pad"].mesh
    ends = mesh.surfaces["x1"]
    work = np.linalg.norm(np.diff(mesh.points[ends], axis=1)[:, 0], axis=1) @ along[ends].mean(axis=1)
    assert abs(work) > 0.01
    assert work == pytest.approx((of(1e-5)[0] - of(-1e-5)[0]) / 2e-5, rel=1e-6)


def test_changes_of_volume_around_an_axis_do_not_count_by_the_bulk_modulus() -> None:
    """Strains around the axis are a part of these: without them it would be three times the force."""

    def of(cells: int) -> GoalError:
        section = gallery.rectangle((1, 0), (2, 2), (cells, 2 * cells))
        ring = Body(section, NeoHooke(1.0, 0.4999, mean_dilatation=True), axisymmetric=True)
        ends = [Support("ring", "y0"), Support("ring", "y1", (0.0, -0.02))]
        return estimated(Scene({"ring": ring}, ends), "reaction", surface="ring y1", direction=(0, -1))

    coarse, fine = of(3), of(9)
    error = fine.value - coarse.value
    assert abs(error) > 3e-3 * coarse.value
    assert abs(coarse.total - error) < 0.03 * coarse.value
    assert abs(fine.total) < 0.5 * abs(coarse.total)
