# # A material of one's own: wood under a steel ball
#
# ![Pressure of a steel ball on wood](../docs/pictures/orthotropic_pressure.png)
#
# A rigid ball is pressed into a block of wood. Wood is much stiffer along its fibres than across them, so
# the contact patch is no circle. The model is not taken from the package: it is written here, as a user
# would, by its energy density. With the unit vector $a$ along the fibres and the strain
# $\varepsilon = \tfrac12 (\nabla u + \nabla u^T)$,
#
# $$ W(\varepsilon) = \tfrac{\lambda}{2} (\mathrm{tr}\,\varepsilon)^2 + \mu_T\, \varepsilon : \varepsilon
#   + \alpha\, (a \cdot \varepsilon a)\, \mathrm{tr}\,\varepsilon + 2 (\mu_L - \mu_T)\, |\varepsilon a|^2
#   + \tfrac{\beta}{2} (a \cdot \varepsilon a)^2 \quad [\mathrm{N/mm^2}] $$
#
# is the most general quadratic energy of a material with one direction of fibres (transverse isotropy).
# The package derives stress and stiffness from it by UFL. We compare with the package's own orthotropic
# model, which is written in another way, for the same constants.
#
# Run it with `make demo DEMO=orthotropic`, on two ranks with `make demo DEMO=orthotropic NP=2`.

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidSphere,
    Scene,
    Support,
    Surface,
    gallery,
    materials,
    pictures,
    show_progress,
    solve_scene,
    write_result,
    write_vtu,
)

comm = MPI.COMM_WORLD
output = Path("output/orthotropic")

# ## The model
#
# A frozen dataclass of numbers, `parameters` in the order in which `energy` receives them, and the energy:
# that is all. Engineers measure moduli along (L) and across (T) the fibres; the constants of $W$ follow from
# the stiffness matrix $C$, the inverse of the compliance of the three normal strains.


@dataclass(frozen=True)
class Wood(materials.EnergyModel):
    E_L: float  # Young's moduli [N/mm²]
    E_T: float
    nu_LT: float  # Poisson's ratios
    nu_TT: float
    G_LT: float  # shear modulus [N/mm²]
    fibre: tuple[float, float, float]  # unit vector

    @property
    def parameters(self):
        along, across = -self.nu_LT / self.E_L, -self.nu_TT / self.E_T
        stiff, soft = 1 / self.E_L, 1 / self.E_T
        C = np.linalg.inv([[stiff, along, along], [along, soft, across], [along, across, soft]])
        beta = C[0, 0] - 2 * C[0, 1] + C[1, 1] - 4 * self.G_LT
        return C[1, 2], (C[1, 1] - C[1, 2]) / 2, self.G_LT, C[0, 1] - C[1, 2], beta, *self.fibre

    def energy(self, strain, parameters):
        lame, mu_T, mu_L, alpha, beta, *fibre = parameters
        a = ufl.as_vector(fibre)
        stretched, trace = ufl.dot(strain, a), ufl.tr(strain)
        along = ufl.dot(a, stretched)
        isotropic = lame / 2 * trace**2 + mu_T * ufl.inner(strain, strain)
        shear = 2 * (mu_L - mu_T) * ufl.dot(stretched, stretched)
        return isotropic + shear + alpha * along * trace + beta / 2 * along**2


# ## Scene
#
# Spruce with its fibres in the surface, 30° from the x-axis. The same wood in the package's model: its third
# shear modulus belongs to the plane across the fibres, where the wood is isotropic.

angle = np.radians(30)
fibre = (float(np.cos(angle)), float(np.sin(angle)), 0.0)
wood = Wood(E_L=12000, E_T=800, nu_LT=0.4, nu_TT=0.3, G_LT=700, fibre=fibre)
reference = materials.OrthotropicElasticity(
    young_moduli=(12000, 800, 800),
    poisson_ratios=(0.4, 0.4, 0.3),
    shear_moduli=(700, 700, 800 / 2 / (1 + 0.3)),
    orientation=materials.material_axes(fibre, (0.0, 0.0, 1.0)),
)

# The block, 30 × 30 × 15 mm, has small cells where the ball presses. It rests on the plane z = −15 mm,
# which is lifted by 0.4 mm against the ball.

half = np.concatenate([np.linspace(0, 4, 9), [5, 6.6, 9, 12, 15]])
across = np.concatenate([-half[:0:-1], half])
depth = 15 * np.expm1(2.5 * np.linspace(0, 1, 11)) / np.expm1(2.5)
mesh = gallery.box_lattice([across, across, -depth[::-1]])
ball = RigidSphere(centre=(0.0, 0.0, 20.0), radius=20.0)


def block_of(material):
    return Scene(
        bodies={"block": Body(mesh, material)},
        supports=[Support("block", "z0", (0.0, 0.0, 0.4))],
        contacts=[ContactPair(Surface("block", "z1"), ball)],
    )


# What will be solved is known before anything is computed.

if comm.rank == 0:
    print(block_of(wood).plan(ranks=comm.size))

with show_progress(comm):
    state = solve_scene(block_of(wood), comm, tolerance=1e-6)
    compared = solve_scene(block_of(reference), comm, tolerance=1e-6)

# ## Result
#
# The moments of the contact forces give the half axes of the patch, as a pressure over an ellipse would have
# them: $b_i^2 = 5 \sum_k \lambda_k x_{k,i}^2 / \sum_k \lambda_k$ in principal axes [mm].

force = state.contact.normal_force
places = mesh.points[state.contact.points.slave][:, :2]
moments = (force[:, None] * places).T @ places / force.sum()
squares, axes = np.linalg.eigh(moments)
short, long = np.sqrt(5 * squares)
turned = np.degrees(np.arccos(abs(axes[:, 1] @ fibre[:2])))

# The forces of both models, point by point.

difference = np.abs(force - compared.contact.normal_force).max() / force.max()
record = {"force": force.sum(), "half_axes": [long, short], "angle": turned}
write_result(state, output, more=record)
imbalance = max(each.balance().imbalance for each in (state, compared))

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    counts = state.counts
    print(f"ball on wood: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains, {ranks}")
    print(f"  force                {force.sum():9.1f} N")
    print(f"  half axes of patch   {long:9.3f} mm and {short:.3f} mm")
    print(f"  long axis to fibres  {turned:9.1f} °")
    print(f"  own model against the package's: contact forces differ by {difference:.1e}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")

# ## Pictures and files for ParaView
#
# ![Von Mises stress](../docs/pictures/orthotropic_stress.png)
#
# The thin arc is the outline of the ball.

write_vtu(state, output, "wood")
pictures.plot_stress(state, output / "stress.png", scale=1, reach=6.0, title="Wood under a ball")
pictures.plot_contact_pressure(state, output / "pressure.png", title="Wood under a ball")

if comm.rank == 0:
    print(f"pictures and files in {output}/")

# Both models are the same material. The patch is longer across the fibres: these are stiff, and resist being
# bent to the curvature of the ball. What the ball presses and what the base holds balance, forces and
# moments, to rounding.

assert difference < 1e-6
assert long > 1.15 * short
assert abs(turned - 90) < 3
assert imbalance < 1e-9

# ## What to try next
#
# - `Wood(E_L=800, E_T=800, nu_LT=0.3, nu_TT=0.3, G_LT=800 / 2.6, ...)` is isotropic: the patch is a circle.
# - Fibres that rise from the surface: `fibre=(0.8, 0.0, 0.6)`.
# - A ball that is dragged: give the support a displacement along x and the pair `Coulomb(0.4)`.
