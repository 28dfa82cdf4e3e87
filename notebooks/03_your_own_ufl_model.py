# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own UFL model
#
# ![Shortening over the angle of the fibres](../docs/pictures/notebooks/03_your_own_ufl_model.png)
#
# The package brings a few materials; sooner or later one is missing. This notebook writes one, wood, in a
# few lines of UFL (the form language of FEniCSx): an energy, from which stress and stiffness follow. Then
# come what the package checks before it believes a model, loads in UFL, a stiffness that changes from place
# to place, and a model whose kernel is not that of an elastic body. Everything is compared with a known
# answer.
#
# It builds on [01 First contact](01_first_contact.ipynb). Units: mm, N, N/mm².

# %% [markdown]
# ## What a model is
#
# Total FETI tears bodies into subdomains that float freely. Of a material it needs, besides its stiffness,
# to know which motions cost no energy: the *kernel*. So a model is
#
# | member | what it is |
# |---|---|
# | `parameters` | its numbers, which reach the forms as constants: changing them compiles nothing |
# | `stress(u, parameters)` | $\sigma$ [N/mm²] as UFL, linear in $u$ |
# | `stiffness(u, v, parameters)` | the integrand $\sigma(u) : \varepsilon(v)$ [N/mm²], symmetric |
# | `kernel(points)` | displacements without energy, one a column; for elastic bodies the rigid motions |
#
# `Elasticity` leaves only the first two to write, `EnergyModel` replaces the stress by an energy.
#
# ## Wood
#
# Along its fibres, unit vector $a$, wood is stiff; across them it is soft and alike in all directions. Its
# energy a volume is, with the strain $\varepsilon = \tfrac12 (\nabla u + \nabla u^T)$,
#
# $$ W(\varepsilon) = \tfrac{\lambda}{2} (\mathrm{tr}\,\varepsilon)^2 + \mu_T\, \varepsilon : \varepsilon
#   + \alpha\, (a \cdot \varepsilon a)\, \mathrm{tr}\,\varepsilon + 2 (\mu_L - \mu_T)\, |\varepsilon a|^2
#   + \tfrac{\beta}{2} (a \cdot \varepsilon a)^2 \quad [\mathrm{N/mm^2}]. $$
#
# This is the most general quadratic energy with one direction of fibres (transverse isotropy). In Python it
# is almost the formula; the package derives stress and stiffness from it by UFL, and takes the rigid
# motions as kernel.

# %%
import ufl

from fenics_contact import (
    Body,
    ContactPair,
    Pressure,
    RigidPlane,
    Scene,
    Surface,
    Ufl,
    gallery,
    materials,
    pictures,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials import strain


class FibreEnergy(materials.EnergyModel):
    def energy(self, strain, parameters):
        lame, mu_T, mu_L, alpha, beta, *fibre = parameters
        a = ufl.as_vector(fibre)
        stretched, trace = ufl.dot(strain, a), ufl.tr(strain)
        along = ufl.dot(a, stretched)
        isotropic = lame / 2 * trace**2 + mu_T * ufl.inner(strain, strain)
        shear = 2 * (mu_L - mu_T) * ufl.dot(stretched, stretched)
        return isotropic + shear + alpha * along * trace + beta / 2 * along**2


# %% [markdown]
# Engineers measure moduli along (L) and across (T) the fibres. The five constants of $W$ follow from the
# matrix $C$ that takes the three normal strains to stresses, the inverse of the measured compliances. A
# frozen dataclass of numbers makes the model a value: equal models are one model.

# %%
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Wood(FibreEnergy):
    moduli: tuple[float, float, float]  # E_L, E_T, G_LT [N/mm²]
    ratios: tuple[float, float]  # ν_LT, ν_TT
    fibre: tuple[float, float, float]  # unit vector

    @property
    def parameters(self):
        (E_L, E_T, G_LT), (nu_LT, nu_TT) = self.moduli, self.ratios
        S = [[1 / E_L, -nu_LT / E_L, -nu_LT / E_L], [-nu_LT / E_L, 1 / E_T, -nu_TT / E_T]]
        C = np.linalg.inv([*S, [-nu_LT / E_L, -nu_TT / E_T, 1 / E_T]])
        beta = C[0, 0] - 2 * C[0, 1] + C[1, 1] - 4 * G_LT
        return C[1, 2], (C[1, 1] - C[1, 2]) / 2, G_LT, C[0, 1] - C[1, 2], beta, *self.fibre


# %% [markdown]
# ## Against a known answer
#
# A block of spruce, 20 × 20 × 40 mm, stands on a smooth rigid floor and is pressed with $p$ = 8 N/mm². Its
# fibres lie in the x-z plane, at the angle $\theta$ to the vertical. Whatever the angle is, the stress is
# the same everywhere, and the block becomes shorter by $pL/E(\theta)$ with
#
# $$ \frac1{E(\theta)} = \frac{\cos^4\theta}{E_L} + \frac{\sin^4\theta}{E_T}
#    + \Big(\frac1{G_{LT}} - \frac{2\nu_{LT}}{E_L}\Big) \sin^2\theta \cos^2\theta \quad [\mathrm{mm^2/N}]. $$

# %%

mesh = gallery.block((0, 0, 0), (20, 20, 40), (4, 4, 8))  # mm


def on_floor(material, load):
    floor = RigidPlane(point=(0, 0, 0), normal=(0, 0, 1))
    contact = ContactPair(Surface("block", "z0"), floor)
    return Scene({"block": Body(mesh, material)}, loads=[load], contacts=[contact])


# %% [markdown]
# A floor without friction holds the block only upwards. It may slide sideways, but no load works in that
# direction: the solution is known up to a rigid motion along the floor, and the package accepts that.

# %%
from mpi4py import MPI


def shortening(angle):
    theta = np.radians(angle)
    wood = Wood((12000, 800, 700), (0.4, 0.3), (float(np.sin(theta)), 0.0, float(np.cos(theta))))
    scene = on_floor(wood, Pressure("block", "z1", 8.0))
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-9)
    top = mesh.points[:, 2] == 40
    return -state.gather_displacement("block")[top, 2].mean(), state


# %% [markdown]
# Ten angles. The form is compiled once: the direction of the fibres is a parameter.

# %%
angles = np.linspace(0, 90, 10)
found = np.array([shortening(angle)[0] for angle in angles])
c, s = np.cos(np.radians(angles)), np.sin(np.radians(angles))
modulus = 1 / (c**4 / 12000 + s**4 / 800 + (1 / 700 - 2 * 0.4 / 12000) * s**2 * c**2)
worst = np.abs(found / (8.0 * 40 / modulus) - 1).max()
print(f"along the fibres {found[0]:.5f} mm, across {found[-1]:.5f} mm; largest error {worst:.1e}")
assert worst < 1e-7

# %% [markdown]
# The same as a picture, with the formula on a finer scale behind the computed points.

# %% tags=["cover"]

fine = np.radians(np.linspace(0, 90, 91))
c, s = np.cos(fine), np.sin(fine)
compliance = c**4 / 12000 + s**4 / 800 + (1 / 700 - 2 * 0.4 / 12000) * s**2 * c**2
pictures.plot_curves(
    {"computed with contact": (angles, found)},
    reference={"p L / E(θ)": (np.degrees(fine), 8.0 * 40 * compliance)},
    xlabel="angle between fibres and load (°)", ylabel="shortening (mm)",
    title="A block of wood, pressed on a floor", width=1000,
)  # fmt: skip

# %% [markdown]
# *The computed points lie on the formula, to nine digits: linear elements represent this solution exactly.
# Ten degrees off the fibres, and the block gives in by nearly half as much again.*
#
# At 30° the block also shears, although it is only pressed: fibres, pressure and floor do not agree about
# the directions.

# %%

_, state = shortening(30)
pictures.plot_stress(state, title="Fibres at 30°", scale=40, clim=(0.0, 16.0), sections=False, width=800)

# %% [markdown]
# *The stress is the same in every cell. The block leans over because its fibres do.*
#
# ## What the package checks
#
# A wrong kernel is the worst mistake in a model: the generalised inverse would blow up or take real
# stiffness away, and the result could pass for a solution. So before anything is built on a model, it must
# prove itself on one skew cell. Four wrong models, and their errors. First a class that forgets the
# rotations, and one that takes a stretch for a rigid motion:

# %%


class NoRotations(Wood):
    def kernel(self, points):
        return materials.rigid_body_modes(points)[:, :, :3]


class Stretched(Wood):
    def kernel(self, points):
        return np.concatenate([materials.rigid_body_modes(points), points[:, :, None]], axis=2)


# %% [markdown]
# Third, an energy that is not quadratic. Fourth, numbers with which the energy can become negative, a usual
# slip of the pen: $\nu_{LT}$ = 4.


# %%
class Stiffening(Wood):
    def energy(self, strain, parameters):
        return super().energy(strain, parameters) + parameters[0] * ufl.tr(strain) ** 3


spruce = (12000, 800, 700), (0.4, 0.3), (0.0, 0.0, 1.0)
wrong = NoRotations(*spruce), Stretched(*spruce), Stiffening(*spruce), Wood(spruce[0], (4.0, 0.3), spruce[2])

# %% [markdown]
# Each is refused, with what is needed, what was found, and what to do:

# %%
from textwrap import fill

refused = []
for model in wrong:
    try:
        solve_scene(on_floor(model, Pressure("block", "z1", 8.0)), MPI.COMM_WORLD)
    except InvalidInputError as error:
        refused.append(model)
        print(fill(f"- {error}", 100, subsequent_indent="  "))
assert len(refused) == 4

# %% [markdown]
# ## A load in UFL
#
# Loads are numbers, functions of position (evaluated at the nodes) or UFL (evaluated in the integrals). A
# pressure $p(x) = 2 (1 + x/20)^2$ N/mm² on the top has the resultant
# $20 \int_0^{20} p\, \mathrm{d}x = 5600/3$ N; the floor must push back with as much. UFL integrates the
# square exactly. A function of position is interpolated first and gives a little more.

# %%

by_form = Pressure("block", "z1", Ufl(lambda x: 2 * (1 + x[0] / 20) ** 2))
by_nodes = Pressure("block", "z1", lambda x: 2 * (1 + x[:, 0] / 20) ** 2)
forces = []
for name, load in {"UFL": by_form, "nodes": by_nodes}.items():
    loaded = solve_scene(on_floor(Wood(*spruce), load), MPI.COMM_WORLD)
    forces.append(float(loaded.contact.normal_force.sum()))
    print(f"{name:6s} {forces[-1]:.4f} N, exactly {5600 / 3:.4f} N")
assert abs(forces[0] - 5600 / 3) < 1e-8

# %% [markdown]
# ## A stiffness that changes from place to place
#
# The forms know the coordinates, so a model may depend on them. Here Young's modulus rises linearly from
# $E_0$ at the floor to $E_1$ at the top, as in a graded material, without Poisson's effect. The answer is
# $\int_0^L p / E(z)\, \mathrm{d}z = \frac{pL}{E_1 - E_0} \ln \frac{E_1}{E_0}$ [mm].

# %%
from ufl.domain import extract_unique_domain


@dataclass(frozen=True)
class Graded(materials.Elasticity):
    low: float  # Young's modulus at z = 0 and at z = height [N/mm²]
    high: float
    height: float  # mm

    @property
    def parameters(self):
        return self.low, self.high, self.height

    def stress(self, u, parameters):
        low, high, height = parameters
        x = ufl.SpatialCoordinate(extract_unique_domain(u))
        return (low + (high - low) * x[2] / height) * strain(u)


# %% [markdown]
# The answer is a logarithm, which linear elements cannot represent: the error falls with the square of the
# size of the cells.

# %%
errors = []
for n in (4, 8, 16):
    mesh = gallery.block((0, 0, 0), (20, 20, 40), (2, 2, n))
    scene = on_floor(Graded(1000.0, 3000.0, 40.0), Pressure("block", "z1", 8.0))
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-10)
    exact = 8.0 * 40 / 2000 * np.log(3)
    errors.append(abs(-state.gather_displacement("block")[:, 2].min() / exact - 1))
    print(f"{n:3d} cells in the height: error {errors[-1]:.2e}")
rates = np.log2(np.array(errors[:-1]) / errors[1:])
assert np.all(np.abs(rates - 2) < 0.1)

# %% [markdown]
# ## A kernel of one's own: a pile in soft ground
#
# A pile stands on rock; the soft ground around it resists every displacement with a force $-k u$ [N/mm³] a
# volume. Virtual work gains a term that the stress does not know, so `stiffness` is written, too:
# $\sigma(u) : \varepsilon(v) + k\, u \cdot v$. On such a bed nothing moves for free. The kernel is empty,
# and a model that inherits the rigid motions is refused:


# %%
@dataclass(frozen=True)
class Bedded(materials.Elasticity):
    young: float  # N/mm²
    bed: float  # N/mm⁴

    @property
    def parameters(self):
        return self.young, self.bed

    def stress(self, u, parameters):
        return parameters[0] * strain(u)

    def stiffness(self, u, v, parameters):
        return ufl.inner(self.stress(u, parameters), strain(v)) + parameters[1] * ufl.inner(u, v)


# %% [markdown]
# We try it as it is, read the message, and correct the model:

# %%
try:
    solve_scene(on_floor(Bedded(1000.0, 1.0), Pressure("block", "z1", 8.0)), MPI.COMM_WORLD)
except InvalidInputError as error:
    print(fill(str(error), 100))


class Pile(Bedded):
    def kernel(self, points):
        return np.zeros((*points.shape, 0))


# %% [markdown]
# Along the pile $E\, u'' = k\, u$. With $m = \sqrt{k/E}$ [1/mm] the pressed pile ($p$ > 0) sinks at its
# head by $p \tanh(mL) / \sqrt{kE}$ and passes $p / \cosh(mL)$ on to the rock; the rest is carried by the
# ground. The pulled pile ($p$ < 0) rises by $|p| \coth(mL) / \sqrt{kE}$, and its foot leaves the rock:
# contact makes the difference. Nothing but the bed holds it then.

# %%
mesh, m = gallery.block((0, 0, 0), (20, 20, 40), (2, 2, 32)), np.sqrt(1.0 / 1000.0)
for p in (8.0, -8.0):
    scene = on_floor(Pile(1000.0, 1.0), Pressure("block", "z1", p))
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-9)
    head = -state.gather_displacement("block")[mesh.points[:, 2] == 40, 2].mean()
    foot, pressed = state.contact.normal_force.sum() / 400, p > 0
    exact = p / np.sqrt(1000.0) * (np.tanh(m * 40) if pressed else 1 / np.tanh(m * 40))
    print(f"p = {p:+.0f}: head {head:+.5f} mm, exactly {exact:+.5f} mm; foot on rock {foot:.4f} N/mm²")
    assert abs(head / exact - 1) < 2e-3
    assert abs(foot - (p / np.cosh(m * 40) if pressed else 0.0)) < 2e-3

# %% [markdown]
# ## What to try next
#
# - The block of wood with `Coulomb(0.3)` on the floor: at 30° the floor now holds the shear back, and the
#   pressure is no longer even.
# - Fibres that turn from place to place, as around a knot: let `a` depend on `ufl.SpatialCoordinate`.
# - A scene with wood on steel: models may differ from body to body, or from region to region of a body.
# - `demos/demo_orthotropic.py`: the same wood under a steel ball.
# - Next: [04 Shape optimisation](04_shape_optimisation.ipynb).
