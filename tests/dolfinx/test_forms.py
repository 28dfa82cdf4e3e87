"""Forms are compiled once and mean the same on every mesh they are bound to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from fenics_contact import _dolfinx
from tests.dolfinx.samples import CELLS, Sample, box


def constants(cell: str, count: int) -> list[Any]:
    return [ufl.Constant(_dolfinx.template(cell)) for _ in range(count)]


def boxes(cell: str) -> list[tuple[Sample, Any, float]]:
    """Three boxes of different size and fineness with their volumes."""
    found = []
    for k in (1, 2, 3):
        mesh = box(cell, (k, 1, 2), (k, 1, k))
        volume = 2.0 * k if mesh.dim == 3 else 1.0 * k
        found.append((mesh, _dolfinx.local_mesh(mesh.points, mesh.cells, cell), volume))
    return found


@pytest.mark.parametrize("cell", CELLS)
def test_a_form_bound_to_several_meshes_is_compiled_once(cell: str, monkeypatch: pytest.MonkeyPatch) -> None:
    factor = constants(cell, 1)[0]
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 1})
    form = _dolfinx.CompiledForm(MPI.COMM_SELF, factor * dx)

    def refuse(*arguments: Any, **options: Any) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr("dolfinx.jit.ffcx_jit", refuse)
    with pytest.raises(AssertionError, match="compiled again"):
        _dolfinx.CompiledForm(MPI.COMM_SELF, 2 * factor * dx)
    other = constants(cell, 1)[0]
    like_it = _dolfinx.CompiledForm(MPI.COMM_SELF, other * dx)
    for scale, (_, mesh, volume) in enumerate(boxes(cell), start=1):
        for symbol, compiled in ((factor, form), (other, like_it)):
            bound = compiled.bind(mesh, [], {}, {symbol: _dolfinx.fem.Constant(mesh, np.float64(scale))})
            assert _dolfinx.assemble_scalar(bound) == pytest.approx(scale * volume, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_symbols_of_a_form_like_a_compiled_one_reach_their_own_places(cell: str) -> None:
    space = _dolfinx.displacement_space(cell)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    along = ufl.TestFunction(space)
    _, mesh, volume = boxes(cell)[1]
    one, two = _dolfinx.coefficient(mesh, "one"), _dolfinx.coefficient(mesh, "two")
    one.x.array[:], two.x.array[:] = 3.0, 5.0
    for number in (5, 0):  # the second is found, and its symbols have other numbers
        u, v = (ufl.Coefficient(space, count=number + k) for k in range(2))
        a, b = constants(cell, 2)
        energy = (7 * u[0] + a * v[0] * v[0] + b * b * v[1] * v[0]) * dx  # u drops out of the derivative
        form = _dolfinx.CompiledForm(MPI.COMM_SELF, ufl.derivative(energy, v, along))
        values = {a: _dolfinx.fem.Constant(mesh, 2.0), b: _dolfinx.fem.Constant(mesh, 10.0)}
        force = _dolfinx.assemble_vector(form.bind(mesh, [two.function_space], {u: one, v: two}, values))
        assert force.sum() == pytest.approx((2 * 2 * 5 + 2 * 100 * 5) * volume, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_a_surface_integral_covers_the_facets_it_is_given(cell: str) -> None:
    area = ufl.Constant(_dolfinx.template(cell)) * ufl.ds(
        domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2}
    )(1)
    one = area.constants()[0]
    form = _dolfinx.CompiledForm(MPI.COMM_SELF, area)
    for geometry, mesh, volume in boxes(cell):
        sides = (
            {"x0": 2.0, "y1": volume, "z0": volume / 2} if geometry.dim == 3 else {"x0": 1.0, "y1": volume}
        )
        for side, expected in sides.items():
            facets = {1: _dolfinx.match_facets(mesh, geometry.surfaces[side])}
            bound = form.bind(mesh, [], {}, {one: _dolfinx.fem.Constant(mesh, np.float64(1.0))}, facets)
            assert _dolfinx.assemble_scalar(bound) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_constants_and_coefficients_reach_their_own_places(cell: str) -> None:
    u, v = _dolfinx.field_symbols(cell, 2)
    a, b = constants(cell, 2)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    form = _dolfinx.CompiledForm(MPI.COMM_SELF, (a * u[0] + b * b * v[1]) * dx)
    _, mesh, volume = boxes(cell)[1]
    fields = {u: _dolfinx.coefficient(mesh, "u"), v: _dolfinx.coefficient(mesh, "v")}
    fields[u].x.array[:], fields[v].x.array[:] = 3.0, 5.0
    numbers = {symbol: _dolfinx.fem.Constant(mesh, np.float64(value)) for symbol, value in ((b, 10), (a, 2))}
    bound = form.bind(mesh, [], fields, numbers)
    assert _dolfinx.assemble_scalar(bound) == pytest.approx((2 * 3 + 100 * 5) * volume, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_derivatives_keep_the_coefficients_that_are_left_in_their_places(cell: str) -> None:
    gone, left = _dolfinx.field_symbols(cell, 2)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    along = ufl.TestFunction(_dolfinx.displacement_space(cell))
    _, mesh, volume = boxes(cell)[1]
    fields = {gone: _dolfinx.coefficient(mesh, "gone"), left: _dolfinx.coefficient(mesh, "left")}
    fields[gone].x.array[:], fields[left].x.array[:] = 7.0, 5.0
    by_gone = ufl.derivative(gone[0] * left[0] * left[0] * dx, gone, along)
    none = ufl.derivative(left[0] * dx, gone, along)
    variable = ufl.variable(gone[0])
    by_variable = ufl.diff(variable * left[0] * left[0], variable) * along[0] * dx
    for form, expected in ((by_gone, 25 * volume), (by_variable, 25 * volume), (none, 0.0)):
        compiled = _dolfinx.CompiledForm(MPI.COMM_SELF, form)
        bound = compiled.bind(mesh, [fields[left].function_space], fields, {})
        assert _dolfinx.assemble_vector(bound).sum() == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_the_mass_matrix_and_a_uniform_load_hold_the_volume(cell: str) -> None:
    space = _dolfinx.displacement_space(cell)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    mass = _dolfinx.CompiledForm(MPI.COMM_SELF, ufl.inner(u, v) * dx)
    load = _dolfinx.CompiledForm(MPI.COMM_SELF, (v[0] + 2 * v[1]) * dx)
    for sample, mesh, volume in boxes(cell):
        dim = sample.dim
        V = _dolfinx.coefficient(mesh, "u").function_space
        indptr, indices, data = _dolfinx.assemble_csr(mass.bind(mesh, [V, V], {}, {}))
        assert len(indptr) == len(mesh.geometry.x) * dim + 1
        assert len(indices) == len(data) == indptr[-1]
        assert data.sum() == pytest.approx(dim * volume, rel=1e-13)
        force = _dolfinx.assemble_vector(load.bind(mesh, [V], {}, {}))
        assert force.reshape(-1, dim).sum(axis=0) == pytest.approx([volume, 2 * volume, 0.0][:dim])


@pytest.mark.parametrize("cell", CELLS)
def test_a_tagged_volume_integral_covers_the_cells_it_is_given(cell: str) -> None:
    a, b = constants(cell, 2)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    form = _dolfinx.CompiledForm(MPI.COMM_SELF, a * dx(1) + b * dx(2))
    sample = box(cell, (4, 1, 2), (4, 2, 2))
    mesh = _dolfinx.local_mesh(sample.points, sample.cells, cell)
    numbers = {
        a: _dolfinx.fem.Constant(mesh, np.float64(1.0)),
        b: _dolfinx.fem.Constant(mesh, np.float64(100.0)),
    }
    height = 2.0 if sample.dim == 3 else 1.0
    middle = sample.points[sample.cells].mean(axis=1)[_dolfinx.input_cells(mesh), 0]
    left, right = np.flatnonzero(middle < 1.0), np.flatnonzero(middle > 2.0)
    for cells, expected in (
        ({1: left, 2: right}, 201.0),
        ({1: right[::-1]}, 2.0),
        ({2: left, 1: left[:0]}, 100.0),
    ):
        bound = form.bind(mesh, [], {}, numbers, cells=cells)
        assert _dolfinx.assemble_scalar(bound) == pytest.approx(expected * height, rel=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_tagged_and_untagged_parts_of_a_matrix_add_up(cell: str) -> None:
    space = _dolfinx.displacement_space(cell)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.dx(domain=_dolfinx.template(cell), metadata={"quadrature_degree": 2})
    whole = _dolfinx.CompiledForm(MPI.COMM_SELF, ufl.inner(ufl.grad(u), ufl.grad(v)) * dx)
    parts = _dolfinx.CompiledForm(
        MPI.COMM_SELF,
        ufl.inner(ufl.grad(u), ufl.grad(v)) * dx(1) + ufl.inner(ufl.grad(u), ufl.grad(v)) * dx(7),
    )
    sample = box(cell, (4, 1, 2), (4, 2, 2))
    mesh = _dolfinx.local_mesh(sample.points, sample.cells, cell)
    V = _dolfinx.coefficient(mesh, "u").function_space
    n_cells = len(sample.cells)
    halves = {1: np.arange(0, n_cells, 2), 7: np.arange(1, n_cells, 2)}
    expected = _dolfinx.assemble_csr(whole.bind(mesh, [V, V], {}, {}))
    found = _dolfinx.assemble_csr(parts.bind(mesh, [V, V], {}, {}, cells=halves))
    for given, wanted in zip(found[:2], expected[:2], strict=True):
        np.testing.assert_array_equal(given, wanted)
    np.testing.assert_allclose(found[2], expected[2], atol=1e-13)
    assert np.abs(expected[2]).max() > 0.1
