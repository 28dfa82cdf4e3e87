"""Meshes without coordinates and their spaces, on which forms are written."""

from __future__ import annotations

from functools import cache, lru_cache
from itertools import count

import ufl

from fenics_contact._dolfinx.cells import degree, dimension
from fenics_contact._dolfinx.cells import shape as shape_of
from fenics_contact._dolfinx.loading import old

_NUMBERS = count(10**9)


@cache
def _element(cell_type: str, shape: tuple[int, ...]) -> ufl.finiteelement.AbstractFiniteElement:
    if not old():
        import basix.ufl

        return basix.ufl.element("Lagrange", shape_of(cell_type), degree(cell_type), shape=shape)
    # The variant is spelt out because ffcx 0.5 rewrites coordinate elements to it while compiling: without
    # it the signature of the next process differs and misses the compilation cache.
    cell, family = ufl.Cell(shape_of(cell_type)), ufl.VectorElement if shape else ufl.FiniteElement
    return family("Lagrange", cell, degree(cell_type), *shape, variant="equispaced")


def vector_element(cell_type: str, size: int = 0) -> ufl.finiteelement.AbstractFiniteElement:
    """Return the element of coordinates and displacements, of the cells' degree, one value per direction."""
    return _element(cell_type, (size or dimension(cell_type),))


def scalar_element(cell_type: str) -> ufl.finiteelement.AbstractFiniteElement:
    """Return the element of scalars, of the cells' degree."""
    return _element(cell_type, ())


@cache
def cellwise_element(cell_type: str, shape: tuple[int, ...] = ()) -> ufl.finiteelement.AbstractFiniteElement:
    """Return the element of scalars, vectors or tensors that are constant on each cell."""
    if not old():
        import basix.ufl

        return basix.ufl.element("DG", shape_of(cell_type), 0, shape=shape)
    cell = ufl.Cell(shape_of(cell_type))
    if len(shape) < 2:
        family = ufl.VectorElement if shape else ufl.FiniteElement
        return family("DG", cell, 0, *shape)
    return ufl.TensorElement("DG", cell, 0, shape=shape)


@cache
def point_element(cell_type: str, degree: int) -> ufl.finiteelement.AbstractFiniteElement:
    """Return the element of scalars at the points of the quadrature of a degree."""
    if not old():
        import basix.ufl

        return basix.ufl.quadrature_element(shape_of(cell_type), degree=degree)
    cell = ufl.Cell(shape_of(cell_type))
    return ufl.FiniteElement("Quadrature", cell, degree, quad_scheme="default")


@lru_cache(maxsize=16)
def template(cell_type: str) -> ufl.Mesh:
    """Return the mesh without coordinates on which forms for cells of this type are written."""
    return ufl.Mesh(vector_element(cell_type))


@lru_cache(maxsize=16)
def displacement_space(cell_type: str, size: int = 0) -> ufl.FunctionSpace:
    """Return the template's space of displacements, of the cells' degree, by default one per direction."""
    return ufl.FunctionSpace(template(cell_type), vector_element(cell_type, size))


def field_symbols(cell_type: str, count: int, size: int = 0) -> list[ufl.Coefficient]:
    """Return UFL coefficients on the template's `displacement_space`, to be bound to Functions later.

    They are numbered from 0 in every form: ffcx 0.5 writes counts into C identifiers, which fails from ten
    on.
    """
    return [ufl.Coefficient(displacement_space(cell_type, size), count=number) for number in range(count)]


def constant_symbol(cell_type: str, shape: tuple[int, ...] = ()) -> ufl.Constant:
    """Return a UFL constant on the template, to be bound to a number later.

    UFL sorts the terms of sums by the names of constants, and "9" comes after "10": numbers of one length
    keep their order, however many constants a rank has made before. Forms are then the same on all ranks, and
    those of other runs are found in the cache.
    """
    return ufl.Constant(template(cell_type), shape=shape, count=next(_NUMBERS))


@lru_cache(maxsize=16)
def nodal_space(cell_type: str) -> ufl.FunctionSpace:
    """Return the template's space of scalars, of the cells' degree."""
    return ufl.FunctionSpace(template(cell_type), scalar_element(cell_type))


@lru_cache(maxsize=16)
def cellwise_space(cell_type: str, shape: tuple[int, ...] = ()) -> ufl.FunctionSpace:
    """Return the template's space of scalars, or vectors, that are constant on each cell."""
    return ufl.FunctionSpace(template(cell_type), cellwise_element(cell_type, shape))


@lru_cache(maxsize=16)
def point_space(cell_type: str, degree: int) -> ufl.FunctionSpace:
    """Return the template's space of scalars at the points of the quadrature of a degree."""
    return ufl.FunctionSpace(template(cell_type), point_element(cell_type, degree))
