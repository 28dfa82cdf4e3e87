"""A scene of the comparison by GetFEM, where `python3-getfem` is installed.

On a rigid plane with its brick of nodal contact, as in `benchmarks.cases.getfem_block`; between bodies with
that of integral contact of meshes that do not match, in small displacements, with multipliers on the slave.
GetFEM brings a MUMPS without MPI, so nothing that uses PETSc may be imported here.
"""

from __future__ import annotations

from time import process_time
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cases.scene_data import PLANE_HEIGHT
from benchmarks.large_deformations.getfem_ironing import missing
from benchmarks.peers.evaluation import Whole, evaluated, taken
from benchmarks.peers.scenes import SCENES, PeerScene, Side

#: GetFEM's order of a hexahedron's corners in that of VTK.
ORDER = [0, 1, 3, 2, 4, 5, 7, 6]
#: Augmentation relative to Young's modulus by what is touched: fewest Newton steps of the powers of ten.
ON_PLANE, BETWEEN = 10.0, 1.0


class Model:
    """GetFEM's model of a scene."""

    def __init__(self, gf: Any, scene: PeerScene, whole: Whole) -> None:
        """Build meshes, elements and bricks."""
        self.gf, self.scene, self.whole = gf, scene, whole
        self.model, self.regions = gf.Model("real"), dict[Side, int]()
        self.meshes, self.elements, self.methods = {}, {}, {}
        young, poisson = scene.young, scene.poisson
        lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        self.model.add_initialized_data("lame", [lame])
        self.model.add_initialized_data("shear", [young / (2 * (1 + poisson))])
        for name, body in scene.bodies.items():
            mesh = gf.Mesh("empty", 3)
            for corners in body.points[body.cells[:, ORDER]]:
                mesh.add_convex(gf.GeoTrans("GT_QK(3,1)"), corners.T)
            elements = gf.MeshFem(mesh, 3)
            elements.set_classical_fem(1)
            method = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))
            self.meshes[name], self.elements[name], self.methods[name] = mesh, elements, method
            self.model.add_fem_variable(f"u_{name}", elements)
            self.model.add_isotropic_linearized_elasticity_brick(method, f"u_{name}", "lame", "shear")
        for number, (side, values) in enumerate(scene.held):
            self._hold(number, side, values)
        if scene.traction is not None:
            side, value = scene.traction
            self.model.add_initialized_data("traction", list(value))
            loaded = self.methods[side[0]], f"u_{side[0]}"
            self.model.add_source_term_brick(*loaded, "traction", self._region(side))
        self._touch()

    def _region(self, side: Side) -> int:
        """Return the number of a side's faces."""
        if side not in self.regions:
            mesh, number = self.meshes[side[0]], len(self.regions) + 1
            faces = mesh.outer_faces()
            places = (mesh.pts()[:, mesh.pid_in_faces(face[:, None])] for face in faces.T)
            middles = np.array([corners.mean(axis=1) for corners in places])
            wanted = self.whole.points[self.whole.facets(side)].mean(axis=1)
            away, _ = cKDTree(wanted).query(middles)
            mesh.set_region(number, faces[:, away < 1e-9])
            self.regions[side] = number
        return self.regions[side]

    def _hold(self, number: int, side: Side, values: tuple[float | None, ...]) -> None:
        """Give a side its displacement: all components, or the one across a plane."""
        name, region = f"u_{side[0]}", self._region(side)
        given = [direction for direction, value in enumerate(values) if value is not None]
        if len(given) == 3:
            self.model.add_initialized_data(f"given{number}", list(values))
            self.model.add_Dirichlet_condition_with_simplification(name, region, f"given{number}")
            return
        (direction,) = given
        facet = self.whole.points[self.whole.facets(side)[0]]
        outward = np.sign(np.cross(facet[1] - facet[0], facet[2] - facet[0])[direction])
        self.model.add_initialized_data(f"given{number}", [outward * float(values[direction] or 0.0)])
        self.model.add_normal_Dirichlet_condition_with_multipliers(
            self.methods[side[0]], name, 1, region, f"given{number}"
        )

    def _touch(self) -> None:
        """Add the brick of contact."""
        scene, model = self.scene, self.model
        slave, friction = scene.slave, ["friction"] if scene.friction else []
        one, region = slave[0], self._region(slave)
        model.add_initialized_data("friction", [scene.friction])
        if scene.master is None:
            nodes = len(self.elements[one].basic_dof_on_region(region)) // 3
            model.add_variable("normal_force", nodes)
            model.add_variable("friction_force", 2 * nodes)
            model.add_initialized_data("r", [ON_PLANE * scene.young])
            model.add_nodal_contact_with_rigid_obstacle_brick(
                self.methods[one], f"u_{one}", "normal_force", "friction_force", "r", "friction", region,
                f"z-({PLANE_HEIGHT})", 1,
            )  # fmt: skip
            return
        self.forces = self.gf.MeshFem(self.meshes[one], 3 if friction else 1)
        self.forces.set_classical_fem(1)
        model.add_filtered_fem_variable("force", self.forces, region)
        model.add_initialized_data("r", [BETWEEN * scene.young])
        model.add_integral_contact_between_nonmatching_meshes_brick(
            self.methods[one], f"u_{one}", f"u_{scene.master[0]}", "force", "r", *friction, region,
            self._region(scene.master), 1,
        )  # fmt: skip

    def displacement(self) -> np.ndarray:
        """Return the displacement of all nodes of the scene, shape (n, 3)."""
        found = []
        for name, body in self.scene.bodies.items():
            _, at = cKDTree(self.elements[name].basic_dof_nodes()[:, ::3].T).query(body.points)
            found.append(np.asarray(self.model.variable(f"u_{name}")).reshape(-1, 3)[at])
        return np.concatenate(found)


def measure(comm: None, scene: str) -> dict[str, Any]:
    """Return the record of a scene; processor seconds from the meshes to the state."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    import getfem as gf

    start, given = process_time(), SCENES[scene]()
    made = Model(gf, given, whole := Whole(given))
    # Steps are halved once at most between bodies; on the plane GetFEM's own rule takes fewer.
    search = () if given.master is None else ("lsearch", "simplest", "alpha min", 0.5)
    steps, converged = made.model.solve("max_res", 1e-8, "max_iter", 100, "lsolver", "mumps", *search)
    record = taken(start, steps, converged)
    return {**record, **evaluated(whole, made.displacement())} if converged else record
