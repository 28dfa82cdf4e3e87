"""A mesh is cut in the same way whatever was imported before it was, and in whatever order."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.partition.import_orders import cut

WALK = Path(__file__).with_name("import_orders.py")
#: Two that bring a METIS each, and the package.
DECISIVE = ["dolfinx", "pymetis", "fenics_contact.mesh"]
ALL = [*DECISIVE, "petsc4py.PETSc", "gmsh", "pyvista"]


@pytest.mark.parametrize("modules", [DECISIVE, pytest.param(ALL, marks=pytest.mark.slow)], ids=len)
def test_libraries_are_imported_in_any_order(modules: list[str], mpirun: Callable[..., str]) -> None:
    lines = mpirun(WALK, 1, *modules, timeout=3600.0, fresh=True).splitlines()
    assert [line for line in lines if line.startswith("failed")] == []
    assert len(set(lines)) == math.factorial(len(modules))
    assert {line.partition(" ")[0] for line in lines} == {cut()}


def solve_after(imports: str, mpirun: Callable[..., str]) -> None:
    """Solve on two ranks a scene that METIS cuts: a block is pressed evenly on a floor without friction."""
    script = f"""
        import {imports}
        import sys
        from dataclasses import replace
        from mpi4py import MPI
        from fenics_contact import solve_scene
        from fenics_contact.gallery import block
        from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface
        from fenics_contact.materials import IsotropicElasticity

        pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))
        mesh = replace(block((0, 0, 0), (0.7, 0.5, 0.3), (7, 5, 3)), grid=None)
        body = Body(mesh, IsotropicElasticity(100.0, 0.25))
        held = {{"x0": (0.0, None, None), "y0": (None, 0.0, None), "z1": (None, None, -0.01)}}
        supports = [Support("block", side, value) for side, value in held.items()]
        state = solve_scene(Scene({{"block": body}}, supports, (), [pair]), MPI.COMM_WORLD)
        sys.stdout.write(f"{{state.energies.strain}}\\n")
    """
    energy = 0.5 * 100.0 * (0.01 / 0.3) ** 2 * 0.7 * 0.5 * 0.3
    energies = [float(found) for found in mpirun(script, 2, fresh=True).split()]
    assert energies == pytest.approx(2 * [energy], rel=1e-4)


@pytest.mark.parametrize("imports", ["dolfinx, pymetis", "fenics_contact.mesh, dolfinx"])
def test_a_mesh_without_a_grid_is_solved_on_two_ranks(imports: str, mpirun: Callable[..., str]) -> None:
    solve_after(imports, mpirun)


@pytest.mark.slow
@pytest.mark.parametrize("first", list(itertools.permutations(ALL, 2)), ids=" ".join)
def test_any_two_libraries_come_first_on_two_ranks(
    first: tuple[str, str], mpirun: Callable[..., str]
) -> None:
    solve_after(", ".join([*first, *(module for module in ALL if module not in first)]), mpirun)
