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
# # Large deformations
#
# ![A rubber slider that is drawn over a rubber bed](../docs/pictures/notebooks/07_large_deformations.png)
#
# Rubber that is pressed by a third of its height, surfaces that slide over many facets, metal that flows and
# keeps an imprint: this notebook writes a rubber of its own, follows loads, looks at Newton's steps, and
# counts what it costs. A scene calls for all that by its materials; nothing else changes.
#
# It builds on [01 First contact](01_first_contact.ipynb). Units: mm, N, N/mm²; plane bodies have forces in
# N per mm of depth.

# %% [markdown]
# ## A rubber of one's own
#
# Yeoh's energy a volume, with $\bar I = J^{-2/3}\,\mathrm{tr}\,F^T F$ and $J = \det F$:
#
# $$ W(F) = c_1 (\bar I - 3) + c_3 (\bar I - 3)^3 + \tfrac{\kappa}{2} (J - 1)^2 \quad [\mathrm{N/mm^2}]. $$
#
# In UFL it is nearly the same; stress and tangent follow. `F` has three rows in the plane, too.

# %%
from dataclasses import dataclass

import ufl

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    MovingObstacle,
    NewtonSteps,
    RigidSphere,
    Scene,
    Support,
    Surface,
    gallery,
    materials,
    pictures,
    solve_scene,
    solve_steps,
)


@dataclass(frozen=True)
class Yeoh(materials.Hyperelasticity):
    constants: tuple[float, float, float]  # c₁, c₃, κ [N/mm²]

    @property
    def parameters(self):
        return self.constants

    def energy(self, F, parameters):
        c1, c3, kappa = parameters
        J = ufl.det(F)
        shape = J ** (-2 / 3) * ufl.inner(F, F) - 3
        return c1 * shape + c3 * shape**3 + kappa / 2 * (J - 1) ** 2


# %% [markdown]
# A square between smooth plates is pressed to two thirds of its height. Strain is the same everywhere; the
# stretch across is that of least energy, and the force the derivative of this energy: a known answer.

# %%
from mpi4py import MPI

rubber = Yeoh((0.5, 0.02, 5.0))
square = gallery.rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
held = [Support("square", "x0", (0.0, None)), Support("square", "y0", (None, 0.0))]
pressed = Support("square", "y1", (None, -1 / 3))
state = solve_scene(Scene({"square": Body(square, rubber)}, [*held, pressed]), MPI.COMM_WORLD)

# %% [markdown]
# The same by hand, with the stretches $a$ along the load and $b$ across:

# %%
import numpy as np


def energy(a, b):
    J = a * b
    shape = J ** (-2 / 3) * (a**2 + b**2 + 1) - 3
    return 0.5 * shape + 0.02 * shape**3 + 2.5 * (J - 1) ** 2


across = np.linspace(1.0, 2.0, 2_000_001)
b, h = across[np.argmin(energy(2 / 3, across))], 1e-6
exact = (energy(2 / 3 + h, b) - energy(2 / 3 - h, b)) / (2 * h)
force = state.reactions()[2].force[1]
print(f"force {force:.6f} N/mm, by hand {exact:.6f} N/mm")
assert abs(force / exact - 1) < 1e-5

# %% [markdown]
# ## Pressed and drawn
#
# A round slider of harder rubber is pressed into a soft bed, with friction, and drawn along it. Each part of
# the path is a load step. Contact is searched where the surfaces are *now*.

# %%
from dataclasses import replace

bed = gallery.rectangle((0.0, 0.0), (6.0, 3.0), (24, 12))
slider = gallery.rectangle((1.0, 3.0), (2.2, 4.0), (8, 6))
x, y = slider.points.T
rim = 3.0 + 0.3 * (x - 1.6) ** 2
slider = replace(slider, points=np.column_stack([x, rim + (4.0 - rim) * (y - 3.0)]))
bodies = {"bed": Body(bed, rubber), "slider": Body(slider, Yeoh((5.0, 0.0, 50.0)))}
rubbing = ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), Coulomb(0.3), "node")


def moved(right, down):
    return [Support("bed", "y0"), Support("slider", "y1", (right, -down))]


# %% [markdown]
# A tenth of the bed's height down, a millimetre to the right: over several facets.

# %%

way = [(0.0, 0.15), (0.0, 0.3), *((right, 0.3) for right in (0.25, 0.5, 0.75, 1.0))]
steps = [LoadStep(f"{right} mm right, {down} mm down", supports=moved(right, down)) for right, down in way]
drawn = ContactProblem(Scene(bodies, moved(0.0, 0.0), contacts=[rubbing]), MPI.COMM_WORLD)
states = solve_steps(drawn, steps)
for step, state in zip(steps, states, strict=True):
    pull, push = state.reactions()[1].force
    print(f"{step.name:27s} {pull:7.4f} N/mm along, {push:7.4f} N/mm down")
assert abs(pull / push + 0.3) < 0.02

# %% [markdown]
# In the end all nodes slip. The pull is not exactly 0.3 of the push: friction works along the deformed
# surface, which is not level.

# %% tags=["cover"]

pictures.plot_stress(states[-1], title="Drawn by 1 mm", scale=1.0, width=1000)

# %% [markdown]
# *The slider on its way, in true scale: the bed gives way below it, and rises behind and before it.*
#
# ## Newton's steps
#
# Geometry, material and contact are in one loop. Each line of the history has the worst residual after a
# step: near the end each is much smaller than the one before.

# %%

newton = NewtonSteps.of(states)
for step, residuals in zip(steps, newton.residuals, strict=True):
    print(f"{step.name:27s}", " ".join(f"{each:.0e}" for each in residuals[-5:]))
assert np.median(newton.reduction) < 1e-3

# %% [markdown]
# ## Energies
#
# What the supports do in the last quarter of a millimetre goes into friction, but for what rubber stores.

# %%
before, after = states[-2], states[-1]
pulls = [each.reactions()[1].force[0] for each in (before, after)]
work = 0.25 * (pulls[0] + pulls[1]) / 2
stored = after.energies.strain - before.energies.strain
print(f"work {work:.5f}, stored {stored:.5f}, friction {after.energies.friction:.5f} N mm/mm")
assert abs(work - stored - after.energies.friction) < 0.05 * work

# %% [markdown]
# ## Metal that flows
#
# A rigid disc is pressed into metal and taken away, twice. `FinitePlasticity` remembers its plastic strain;
# `MovingObstacle` moves the disc by a function of time.

# %%

along = np.append(np.linspace(0.0, 1.0, 11), 1.0 + gallery.growing_ticks(11.0, 0.14, 1.3)[1:])
plate = gallery.rectangle_lattice([along, -gallery.growing_ticks(12.0, 0.1, 1.25)[::-1]])
metal = materials.FinitePlasticity(2.1e5, 0.3, yield_stress=300.0, isotropic_hardening=1000.0)
disc = RigidSphere((0.0, 5.0), 5.0)
held = [Support("plate", "x0", (0.0, None)), Support("plate", "y0", (None, 0.0))]


def depth(time):
    return 0.03 * (1 - abs(1 - time % 2))


pair = ContactPair(Surface("plate", "y1"), MovingObstacle(disc, lambda time: (None, (0.0, -depth(time)))))
times = [0.1, 0.3, 0.5, 0.75, 1.0, 1.05, 1.1, 1.15, 1.2, 1.3, 1.4]
times += [2.6, 2.7, 2.8, 2.85, 2.9, 2.95, 3.0, 3.05, 3.1, 3.15, 3.2, 3.3, 3.4]

# %% [markdown]
# The force against the depth: on the first way in metal flows, on all others hardly.

# %%

pressing = ContactProblem(Scene({"plate": Body(plate, metal)}, held, contacts=[pair]), MPI.COMM_WORLD)
cycle = solve_steps(pressing, [LoadStep(f"{time}", time=time) for time in times])
sunk = np.array([depth(time) for time in times])
force = np.array([-2 * state.contact.force[:, 1].sum() for state in cycle])
first, second = slice(0, 11), slice(11, None)
pictures.plot_curves(
    {"first": (sunk[first], force[first]), "second": (sunk[second], force[second])},
    xlabel="depth (mm)", ylabel="force (N/mm)", title="A disc in metal, twice", connected=True, width=1000,
)  # fmt: skip

# %% [markdown]
# *The second time the disc runs over the imprint of the first, and goes back the way it came.*

# %%
imprints = [-cycle[k].gather_displacement("plate")[:, 1].min() for k in (10, -1)]
peaks = [force[first].max(), force[second].max()]
left = cycle[-1].gather_von_mises("plate").max()
print(f"imprint {1e3 * imprints[0]:.2f} µm, then {1e3 * imprints[1]:.2f} µm")
print(f"largest force {peaks[0]:.1f} N/mm, then {peaks[1]:.1f} N/mm")
print(f"stress that stays {left:.1f} N/mm²")
assert abs(imprints[1] / imprints[0] - 1) < 0.02
assert abs(peaks[1] / peaks[0] - 1) < 0.02

# %% [markdown]
# *Under the imprint* there is stress that no load causes:

# %%
pictures.plot_stress(cycle[-1], title="Stress that stays", scale=1.0, width=800)

# %% [markdown]
# *Metal around the imprint has flowed and no longer fits; the rest holds it.*
#
# ## What it costs
#
# The slider pressed half as far, with the tangent at rest as a linear material, and with rubber. A product
# with $F$ is one solve in all subdomains; tangents are factored once a Newton step.

# %%

linear = {
    name: Body(body.mesh, materials.PlaneStrain(9 * k * g / (3 * k + g), (3 * k - 2 * g) / (6 * k + 2 * g)))
    for (name, body), (k, g) in zip(bodies.items(), ((5.0, 1.0), (50.0, 10.0)), strict=True)
}
small = solve_scene(Scene(linear, moved(0.0, 0.15), contacts=[rubbing]), MPI.COMM_WORLD, tolerance=1e-8)
large = states[0]
products = [each.counts["f_products"] for each in (small, large)]
print(f"small strains: {products[0]} products, 1 factorisation")
print(f"large ones: {products[1]} products, {len(newton.residuals[0])} factorisations")
print(f"pushing force {small.reactions()[1].force[1]:.4f}, {large.reactions()[1].force[1]:.4f} N/mm")
assert products[1] < 3 * products[0]

# %% [markdown]
# ## What to try next
#
# - `Coulomb(0.6)` for the slider: it sticks longer, and tilts.
# - `isotropic_hardening=0.0`: with each cycle the metal flows at the same stress.
# - Contact by means over facets: `ContactPair(..., discretisation="mortar")`.
# - `demos/demo_snap_fit.py`, `demos/demo_rubber_seal.py`, `demos/demo_ball_imprint.py` go further.
