"""The surface that a design moves, between the nodes of the mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fenics_contact import SurfaceDesign
from fenics_contact.design import MovedSurface
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import half_disc, side_of


def arc(alpha: list[float], *, known: bool = True) -> MovedSurface:
    """A half disc of radius 2 with few nodes."""
    mesh = half_disc(2.0, 4, symmetry="")
    given = mesh if known else mesh.with_shapes({})
    return MovedSurface(SurfaceDesign("disc", side_of(mesh, "contact"), len(alpha)), given, np.array(alpha))


def test_between_the_nodes_it_lies_on_the_true_shape() -> None:
    places = np.linspace(0, 1, 41)[:, None]
    middle = arc([0.0]).mesh.shapes["contact"]
    radius = [
        np.abs(middle.distance(arc([0.0], known=known).before(places))).max() for known in (True, False)
    ]
    assert radius[0] < 1e-12 < 1e-5 < radius[1]


def test_a_constant_net_gives_a_parallel_surface_and_nodes_move_exactly() -> None:
    surface = arc([0.1, 0.1, 0.1])
    places = np.linspace(0, 1, 41)[:, None]
    np.testing.assert_allclose(surface.movement(places), 0.1, rtol=1e-14)
    away = surface.mesh.shapes["contact"].distance(surface.after(places))
    np.testing.assert_allclose(away, 0.1, rtol=0.03)  # the directions are those of facets
    design = surface.design
    wanted = surface.mesh.points[design.lattice.nodes] + design.displacement(surface.alpha)
    np.testing.assert_allclose(surface.after(surface.parameters), wanted, atol=1e-14)


def test_nodes_that_form_no_grid_and_other_variables_are_refused() -> None:
    surface = arc([0.0, 0.1])
    lattice = surface.design.lattice
    turned = replace(surface.design, surface=replace(lattice, parameters=1 - lattice.parameters))
    with pytest.raises(InvalidInputError, match="must form a grid in its parameters"):
        replace(surface, design=turned)
    with pytest.raises(InvalidInputError, match=r"must have shape \(2,\), got \(3,\)"):
        replace(surface, alpha=np.zeros(3))
