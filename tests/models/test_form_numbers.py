"""Forms are the same however many UFL constants were made before, as on ranks with more subdomains."""

from __future__ import annotations

import pytest
import ufl

from fenics_contact import _dolfinx
from fenics_contact._fem.composition import integrate
from fenics_contact._fem.templates import Constants, volume_measure
from fenics_contact.materials import J2Plasticity, Material, MooneyRivlin, NeoHooke

MATERIALS = [NeoHooke(1.0, 0.3), MooneyRivlin(1.0, 0.5, 10.0), J2Plasticity(1.0, 0.3, 0.01)]

#: Rank 1 makes the constants numbered 9 and 10, whose names sort the other way round.
APART = """
import ufl
from mpi4py import MPI
from fenics_contact import solve_scene
from fenics_contact.gallery import block
from fenics_contact import Body, Scene, Support
from fenics_contact.materials import NeoHooke

comm = MPI.COMM_WORLD
ufl.Constant._globalcount = 8 + comm.rank
mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 1, 1))
supports = [Support("pad", "x0"), Support("pad", "x1", (0.01, 0.0, 0.0))]
state = solve_scene(Scene({"pad": Body(mesh, NeoHooke(1.0, 0.3))}, supports), comm)
energies = comm.gather(state.energies.strain)
if comm.rank == 0:
    print(*energies)
"""


def signature(material: Material) -> str:
    space = _dolfinx.displacement_space("hexahedron")
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)

    def work(m: Material, constants: Constants) -> ufl.core.expr.Expr:
        return m.stiffness(u, v, constants)

    form, _ = integrate((material,), "hexahedron", work, volume_measure("hexahedron"))
    return str(form.signature())


@pytest.mark.parametrize("material", MATERIALS, ids=lambda each: type(each).__name__)
def test_forms_do_not_depend_on_the_number_of_constants_made_before(
    material: Material, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = set()
    for before in range(6, 12):
        monkeypatch.setattr(ufl.Constant, "_globalcount", before, raising=False)
        found.add(signature(material))
    assert len(found) == 1


def test_ranks_that_made_different_numbers_of_constants_write_the_same_forms(mpirun) -> None:
    one, two = mpirun(APART, 2, fresh=True).split()
    assert float(one) == float(two) > 0.0
