"""Forms that are compiled once and bound to many meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives

from fenics_contact._base.libraries import MPI
from fenics_contact._base.progress import Task
from fenics_contact._dolfinx.cache import compiled_once
from fenics_contact._dolfinx.loading import cpp, dolfinx, old, side_effects_undone
from fenics_contact._dolfinx.numbering import cell_count, table

#: Cells or facets with one tag: cell numbers, or (cells, local facets).
Facets = Mapping[int, tuple[np.ndarray, np.ndarray]]
Cells = Mapping[int, np.ndarray]


#: What this process has compiled, by the signature of the form as it was written: what dolfinx made of it,
#: the expanded form and the symbols of the form. To expand and find it again takes as long as a small body.
_COMPILED: dict[str, tuple[Any, ufl.Form, tuple[Any, ...]]] = {}


class CompiledForm:
    """A UFL form on a template, compiled once, bound to many meshes."""

    def __init__(self, comm: MPI.Comm, form: ufl.Form) -> None:
        """Compile ``form``, unless all ranks have compiled one that differs from it in its symbols alone.

        Collective on ``comm``: one rank compiles, the others read its cache.
        """
        signature, symbols = form.signature(), (*form.coefficients(), *form.constants())
        if not comm.allreduce(signature in _COMPILED, op=MPI.LAND):
            expanded = _expanded(form)
            with Task("compile forms"), side_effects_undone(), compiled_once():
                build = dolfinx.jit.ffcx_jit if old() else dolfinx.fem.compile_form
                _COMPILED[signature] = build(comm, expanded, {}, {}), expanded, symbols
        self._compiled, self.form, its_symbols = _COMPILED[signature]
        #: Symbols of ``form`` by those of the compiled one.
        self._mine = dict(zip(its_symbols, symbols, strict=True))

    def bind(
        self,
        mesh: dolfinx.mesh.Mesh,
        spaces: Sequence[dolfinx.fem.FunctionSpace],
        coefficients: Mapping[ufl.Coefficient, dolfinx.fem.Function],
        constants: Mapping[ufl.Constant, dolfinx.fem.Constant],
        facets: Facets | None = None,
        *,
        cells: Cells | None = None,
    ) -> dolfinx.fem.Form:
        """Return the form on one mesh.

        Integrals without a tag cover the whole mesh, those with a tag only the entities given for it.
        `facets`: tag of a surface integral -> (cells, local facets) from `match_facets`.
        """
        if old():
            return self._bind_old(mesh, spaces, coefficients, constants, facets or {}, cells or {})
        kinds = dolfinx.fem.IntegralType
        surfaces = [(tag, np.column_stack(pair)) for tag, pair in sorted((facets or {}).items())]
        volumes = [(tag, np.sort(numbers)) for tag, numbers in sorted((cells or {}).items())]
        domains = {
            kind: [(tag, part.astype(np.int32).ravel()) for tag, part in parts]
            for kind, parts in ((kinds.exterior_facet, surfaces), (kinds.cell, volumes))
            if parts
        }
        # A symbol that UFL has simplified away must not be passed.
        functions = {symbol: coefficients[self._mine[symbol]] for symbol in self.form.coefficients()}
        numbers = {symbol: constants[self._mine[symbol]] for symbol in self.form.constants()}
        return dolfinx.fem.create_form(self._compiled, list(spaces), mesh, domains, functions, numbers)

    def _bind_old(
        self,
        mesh: dolfinx.mesh.Mesh,
        spaces: Sequence[dolfinx.fem.FunctionSpace],
        coefficients: Mapping[ufl.Coefficient, dolfinx.fem.Function],
        constants: Mapping[ufl.Constant, dolfinx.fem.Constant],
        facets: Facets,
        cells: Cells,
    ) -> dolfinx.fem.Form:
        compiled, module, code = self._compiled
        mine = [self._mine[symbol] for symbol in self.form.coefficients()]
        order = [compiled.original_coefficient_position[i] for i in range(compiled.num_coefficients)]
        kinds = cpp.fem.IntegralType
        domains = dict.fromkeys((kinds.cell, kinds.exterior_facet, kinds.interior_facet, kinds.vertex))
        if facets:
            domains[kinds.exterior_facet] = _facet_tags(mesh, facets)
        if cells:
            domains[kinds.cell] = _tags(mesh, mesh.topology.dim, cells)
        bound = type("Form", (dolfinx.fem.FormMetaClass, cpp.fem.Form_float64), {})
        return bound(
            compiled,
            [space._cpp_object for space in spaces],
            [coefficients[mine[i]]._cpp_object for i in order],
            [constants[self._mine[symbol]]._cpp_object for symbol in self.form.constants()],
            domains,
            mesh._mesh,
            module.ffi,
            code,
        )


def _expanded(form: ufl.Form) -> ufl.Form:
    """Return the form with its derivatives worked out, where coefficients drop out of them.

    dolfinx 0.9 binds those that are left by wrong names otherwise. A derivative that is zero leaves nothing
    to compile and no coefficient to be bound wrongly: it stays as it is written.
    """
    expanded = expand_derivatives(form)
    alike = expanded.empty() or expanded.coefficients() == form.coefficients()
    return form if alike else expanded


def _facet_tags(mesh: dolfinx.mesh.Mesh, facets: Facets) -> dolfinx.mesh.MeshTags:
    """Facet tags of dolfinx 0.5 from (cell, local facet) pairs."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    numbers = table(mesh.topology.connectivity(tdim, tdim - 1), cell_count(mesh))
    return _tags(mesh, tdim - 1, {tag: numbers[cells, local] for tag, (cells, local) in facets.items()})


def _tags(mesh: dolfinx.mesh.Mesh, dim: int, entities: Cells) -> dolfinx.mesh.MeshTags:
    """Tags of dolfinx 0.5 on entities of one dimension."""
    indices = np.concatenate(list(entities.values())).astype(np.int32)
    tags = np.concatenate([np.full(len(part), tag, np.int32) for tag, part in entities.items()])
    order = np.argsort(indices)
    return dolfinx.mesh.meshtags(mesh, dim, indices[order], tags[order])
