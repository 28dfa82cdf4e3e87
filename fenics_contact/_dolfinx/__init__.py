"""The only module that depends on the dolfinx version; everything else uses FEniCSx through it.

Forms are written once on a *template*, a `ufl.Mesh` without coordinates, compiled once, and then bound to any
number of meshes: subdomain meshes of one body differ in their data, not in their code.

Node numbers of given meshes are called *input nodes*, their cells *input cells*; cells are in the node order
of VTK. Triangles and quadrilaterals lie in the plane: their points have two coordinates, their fields two
components.
"""

from fenics_contact._base import form_language  # noqa: F401 (imports UFL at less cost)
from fenics_contact._dolfinx.assembly import (
    assemble_csr,
    assemble_matrix,
    assemble_scalar,
    assemble_vector,
    write_xdmf,
)
from fenics_contact._dolfinx.cells import (
    CELL_TYPES,
    degree,
    dimension,
    facet_corners,
    facet_vertices,
    shape,
)
from fenics_contact._dolfinx.forms import CompiledForm
from fenics_contact._dolfinx.loading import fem, mesh, release, untested, version, warn_if_untested
from fenics_contact._dolfinx.meshes import local_mesh, rank_mesh
from fenics_contact._dolfinx.numbering import (
    cell_dofs,
    cell_field,
    cell_geometry,
    cell_nodes,
    cellwise_space_on,
    coefficient,
    global_dofs,
    input_cells,
    lagrange_degree,
    match_facets,
    nodal_space_on,
    node_dofs,
    point_space_on,
    scalar_space,
    update_coordinates,
    vtk_cell_dofs,
)
from fenics_contact._dolfinx.reading import (
    MeshArrays,
    TagArrays,
    mesh_arrays,
    read_mesh,
    read_tags,
    tag_arrays,
)
from fenics_contact._dolfinx.refinement import halved_simplices
from fenics_contact._dolfinx.templates import (
    cellwise_space,
    constant_symbol,
    displacement_space,
    field_symbols,
    nodal_space,
    point_space,
    template,
)

__all__ = [
    "CELL_TYPES",
    "CompiledForm",
    "MeshArrays",
    "TagArrays",
    "assemble_csr",
    "assemble_matrix",
    "assemble_scalar",
    "assemble_vector",
    "cell_dofs",
    "cell_field",
    "cell_geometry",
    "cell_nodes",
    "cellwise_space",
    "cellwise_space_on",
    "coefficient",
    "constant_symbol",
    "degree",
    "dimension",
    "displacement_space",
    "facet_corners",
    "facet_vertices",
    "fem",
    "field_symbols",
    "global_dofs",
    "halved_simplices",
    "input_cells",
    "lagrange_degree",
    "local_mesh",
    "match_facets",
    "mesh",
    "mesh_arrays",
    "nodal_space",
    "nodal_space_on",
    "node_dofs",
    "point_space",
    "point_space_on",
    "rank_mesh",
    "read_mesh",
    "read_tags",
    "release",
    "scalar_space",
    "shape",
    "tag_arrays",
    "template",
    "untested",
    "update_coordinates",
    "version",
    "vtk_cell_dofs",
    "warn_if_untested",
    "write_xdmf",
]
