"""Contact mechanics with friction, and contact shape optimisation, on FEniCSx by Total FETI.

The floors of the package, from the ground up; each imports only those before it:

* `fenics_contact.progress`: progress of long work, * `fenics_contact.checkpoint`: files from which
interrupted runs continue, * `fenics_contact.theory`: analytical contact solutions, *
`fenics_contact.surface_shapes`: spheres, tori, profiles: true shapes of surfaces, * `fenics_contact.mesh`:
meshes of bodies, * `fenics_contact.mesh_io`: meshes from gmsh, CAD, dolfinx and files, *
`fenics_contact.gallery`: chain links, blocks, Hertz bodies, * `fenics_contact.partition`: bodies cut into
subdomains, * `fenics_contact.scene`: bodies, materials, supports, loads, contact pairs, *
`fenics_contact.qp`: dual solvers for bounds and friction discs, * `fenics_contact.fem`: forms of elasticity
and loads, * `fenics_contact.pairing`: contact search and mortar coupling, * `fenics_contact.feti`:
subdomains, gluing, contact rows, the dual problem, * `fenics_contact.accuracy`: errors of states, *
`fenics_contact.nonlinear`: Newton's method on deformed bodies, *
`fenics_contact.contact`: scene → state, * `fenics_contact.shape`: design → value and subgradient, *
`fenics_contact.optimize`: the bundle trust method; `fenics_contact.outer`: plain functions for other tools.

Beside them: `fenics_contact.viz` (pictures), `fenics_contact.io` (files) and `fenics_contact.scene_file`
(scenes as TOML files). On top: `fenics_contact.study` (cost of accuracy) and `fenics_contact.cli` (the
command line).
"""

from fenics_contact import _requirements

_requirements.check()  # checks that they exist; nothing is loaded or started before it is used

__version__ = "0.2.0.dev0"
__all__ = ["__version__"]
