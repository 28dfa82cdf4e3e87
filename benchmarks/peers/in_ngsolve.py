"""A scene of the comparison by NGSolve, where the distribution ``ngsolve`` of pip is installed.

Contact is an energy of the closure, a penalty as NGSolve's documentation has it: between bodies by its
``ContactBoundary``, on the plane as a form on the side; friction is written by hand, the same for both.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np

from benchmarks.cases.scene_data import PLANE_HEIGHT
from benchmarks.peers.evaluation import Whole, evaluated, taken
from benchmarks.peers.scenes import SCENES, PeerScene

#: Penalty by Young's modulus, [1/length]; the stick stiffness is a tenth of it.
PENALTY = 100.0
#: Relative residual at which Newton's method ends, and its most steps.
RESIDUAL, STEPS = 1e-8, 40


def missing() -> str | None:
    """Return why NGSolve cannot be used, or None."""
    try:
        import ngsolve  # noqa: F401
    except ImportError as error:
        return f"NGSolve cannot be imported ({error}); pip install ngsolve"
    return None


def in_netgen(scene: PeerScene, whole: Whole) -> Any:
    """Return Netgen's mesh of all bodies, with a boundary for each side, named BODY_SIDE."""
    import netgen.meshing as nm

    mesh = nm.Mesh(dim=3)
    nodes = [mesh.Add(nm.MeshPoint(nm.Pnt(*map(float, point)))) for point in whole.points]
    number = 0
    for order, (name, body) in enumerate(scene.bodies.items(), 1):
        mesh.SetMaterial(order, name)
        for cell in whole.cells[whole.body == name]:
            mesh.Add(nm.Element3D(order, [nodes[node] for node in cell]))
        for side in body.surfaces:
            number += 1
            mesh.Add(nm.FaceDescriptor(surfnr=number, domin=order, domout=0, bc=number))
            for facet in whole.facets((name, side)):
                mesh.Add(nm.Element2D(number, [nodes[node] for node in facet]))
            mesh.SetBCName(number - 1, f"{name}_{side}")
    return mesh


class Equations:
    """Elasticity and contact of a scene, as NGSolve's forms."""

    def __init__(self, scene: PeerScene, whole: Whole) -> None:
        """Write the forms, and give the displacement its values on the supports."""
        import ngsolve as ng

        self.ng, self.scene = ng, scene
        self.mesh = ng.Mesh(in_netgen(scene, whole))
        held = [
            "|".join("_".join(side) for side, values in scene.held if values[d] is not None) for d in range(3)
        ]
        self.space = ng.VectorH1(
            self.mesh, order=1, dirichletx=held[0], dirichlety=held[1], dirichletz=held[2]
        )
        u, v = self.space.TnT()
        young, poisson = scene.young, scene.poisson
        lame, shear = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
        strain = 0.5 * (ng.Grad(u) + ng.Grad(u).trans)
        energy = shear * ng.InnerProduct(strain, strain) + 0.5 * lame * ng.Trace(strain) ** 2
        self.form = ng.BilinearForm(self.space)
        self.form += ng.Variation(energy * ng.dx)
        if scene.traction is not None:
            side, value = scene.traction
            work = ng.InnerProduct(ng.CoefficientFunction(tuple(value)), u)
            self.form += ng.Variation(-work * ng.ds("_".join(side)))
        self.displacement = ng.GridFunction(self.space)
        field = self.displacement.vec.FV().NumPy().reshape(3, -1)
        for (node, direction), given in whole.held().items():
            field[direction, node] = given
        self.contact = self._touching(u, v)

    def _pull(self, slide: Any, pressure: Any) -> Any:
        """Return the friction for a slide under a pressure."""
        ng, stick = self.ng, PENALTY * self.scene.young / 10
        size = ng.sqrt(ng.InnerProduct(slide, slide) + 1e-24)
        bound = self.scene.friction * pressure
        return ng.IfPos(bound - stick * size, stick * slide, bound * slide / size)

    def _touching(self, u: Any, v: Any) -> Any:
        """Add the contact; return NGSolve's pair of boundaries, None on a plane."""
        ng, scene, penalty = self.ng, self.scene, PENALTY * self.scene.young
        slave = "_".join(scene.slave)
        if scene.master is None:
            gap = u[2] + ng.z - PLANE_HEIGHT
            pressure = penalty * ng.IfPos(-gap, -gap, 0)
            pull = self._pull(ng.CoefficientFunction((u[0], u[1], 0)), pressure)
            self.form += (-pressure * v[2] + ng.InnerProduct(pull, v)) * ng.ds(slave)
            return None
        pair = ng.ContactBoundary(self.mesh.Boundaries(slave), self.mesh.Boundaries("_".join(scene.master)))
        place, normal = ng.CoefficientFunction((ng.x, ng.y, ng.z)), ng.specialcf.normal(3)
        depth = ng.InnerProduct(place + u - place.Other() - u.Other(), normal)
        closure = ng.IfPos(depth, depth, 0)
        pair.AddEnergy(0.5 * penalty * closure * closure)
        if scene.friction:
            jump = u - u.Other()
            pull = self._pull(jump - ng.InnerProduct(jump, normal) * normal, penalty * closure)
            pair.AddIntegrator(ng.InnerProduct(pull, v - v.Other()))
        return pair

    def newton(self) -> tuple[int, bool]:
        """Solve by Newton's method; return its steps and whether it has converged."""
        vector = self.displacement.vec
        residual, step = vector.CreateVector(), vector.CreateVector()
        free = np.array(list(self.space.FreeDofs()), bool)
        reach = 1.0 if self.scene.young == 1.0 else 2.0  # of the search for contact
        largest, solver = 0.0, "sparsecholesky" if self.contact is None else "umfpack"
        for number in range(STEPS):
            if self.contact is not None:
                self.contact.Update(self.displacement, self.form, 5, reach)
            self.form.Apply(vector, residual)
            size = float(np.linalg.norm(residual.FV().NumPy()[free]))
            largest = max(largest, size)
            if number and size < RESIDUAL * largest:
                return number, True
            self.form.AssembleLinearization(vector)
            step.data = self.form.mat.Inverse(self.space.FreeDofs(), inverse=solver) * residual
            vector.data -= step
        return STEPS, False


def measure(comm: None, scene: str) -> dict[str, Any]:
    """Return the record of a scene; processor seconds from the meshes to the state."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    start, given = process_time(), SCENES[scene]()
    whole = Whole(given)
    equations = Equations(given, whole)
    steps, converged = equations.newton()
    record = taken(start, steps, converged)
    field = equations.displacement.vec.FV().NumPy().reshape(3, -1)[:, : len(whole.points)].T.copy()
    return {**record, **evaluated(whole, field)} if converged else record
