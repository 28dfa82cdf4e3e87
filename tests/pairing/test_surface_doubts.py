"""What is told of surfaces: nodes off their shape, facets that stay flat."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, ContactPair, RigidPlane, Scene, Support, Surface
from fenics_contact._surfaces import true_surface as reconstruction
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.gallery import LinkShape, half_cylinder, hemisphere, two_links
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic
from fenics_contact.shapes import Sphere
from fenics_contact.shapes.combined import placed

STEEL = IsotropicElasticity(1000.0, 0.3)


def told(caplog: pytest.LogCaptureFixture, *meshes: BodyMesh, **pair: Any) -> list[str]:
    """Search the contacts of one body on a floor, or of two, and return the warnings."""
    names = [f"body {number}" for number in range(len(meshes))]
    master: Any = Surface(names[1], "contact") if len(meshes) > 1 else RigidPlane((0, 0, 0), (0, 0, 1))
    held = "grip" if "grip" in meshes[0].surfaces else "top"
    scene = Scene(
        {name: Body(mesh, STEEL) for name, mesh in zip(names, meshes, strict=True)},
        [Support(name, held) for name in names],
        contacts=[ContactPair(Surface(names[0], "contact"), master, **pair)],
    )
    with caplog.at_level(logging.WARNING):
        build_torn_system(scene, decompose(scene, scene.partition(), MPI.COMM_SELF), overlap=True)
    return [record.getMessage() for record in caplog.records]


def test_nodes_off_their_shape_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    ball = hemisphere(1.0, 6)
    nodes = len({int(node) for node in ball.surfaces["contact"].ravel()})
    off = ball.with_shapes({"contact": Sphere((0.0, 0.0, 1.0), 1.0001)})
    (warning,) = told(caplog, off)
    assert (
        f"{nodes} of {nodes} nodes of surface 'contact' of 'body 0' lie off its shape, Sphere, by " in warning
    )
    assert warning.endswith("move them onto the shape, or correct it")
    caplog.clear()
    assert told(caplog, off, geometry="reconstructed") == []
    assert told(caplog, off.reshaped(off.points * 1.001)) == [warning], "the nodes had that shape before"


def test_nodes_of_a_master_count_too(caplog: pytest.LogCaptureFixture) -> None:
    links = two_links(LinkShape(n_around=24, n_a=2, n_b=6))
    first, second = links.first.mesh, links.second.mesh
    assert told(caplog, second, first) == []
    crown = first.shapes["contact"]
    moved = placed(crown, np.eye(3), (0.0, 0.0, 1e-4))
    (warning,) = told(caplog, second, first.with_shapes({"contact": moved}))
    assert "of surface 'contact' of 'body 1' lie off its shape" in warning


@pytest.mark.parametrize("build", [hemisphere, half_cylinder])
def test_bodies_of_the_package_lie_on_their_shapes(build: Any, caplog: pytest.LogCaptureFixture) -> None:
    mesh = hemisphere(10.0, 4) if build is hemisphere else half_cylinder(10.0, 5.0, 4)
    assert mesh.shapes
    assert told(caplog, mesh) == []
    assert told(caplog, quadratic(mesh)) == []


def test_facets_that_stay_flat_are_counted(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = hemisphere(1.0, 4)
    bare = BodyMesh(ball.points, ball.cells, ball.surfaces)
    assert told(caplog, bare) == []
    monkeypatch.setattr(reconstruction, "STEEPEST", 0.1)
    (warning,) = told(caplog, BodyMesh(ball.points, ball.cells, ball.surfaces))
    count = len(ball.surfaces["contact"])
    assert f" of {count} facets of surface 'contact' of 'body 0' stay flat, as the surface that" in warning
    assert 0 < int(warning.split()[0]) < count
