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
# # First contact: two blocks
#
# ![A block pressed and pushed on another one](../docs/pictures/notebooks/01_first_contact.png)
#
# A steel block lies on another one. It is pressed down with 16 kN and pushed sideways with 3 kN. Nothing
# holds it but contact and friction: it could lift off, slide, or stay. What does it do, and with which
# pressure are the blocks in contact?
#
# This notebook solves that problem with a few lines of code, looks at the answer, and checks it against
# what a sheet of paper says. No knowledge of contact mechanics is needed.

# %% [markdown]
# ## Three conditions
#
# Inside each block the displacement $u$ [mm] obeys linear elasticity: the stress
# $\sigma = \lambda\, \mathrm{tr}(\varepsilon)\, I + 2 G\, \varepsilon$ [N/mm²] balances the loads, with the
# strain $\varepsilon = \tfrac12 (\nabla u + \nabla u^T)$. Where the blocks can touch, three conditions join
# in. Let $g$ [mm] be the gap after deformation, $p$ [N/mm²] the contact pressure and $\tau$ [N/mm²] the
# friction traction:
#
# $$ g \ge 0, \qquad p \ge 0, \qquad g\, p = 0. $$
#
# Bodies do not enter each other; they press and never pull; and they press only where they touch. Friction
# follows Coulomb's law with the coefficient $\mu$ (no unit):
#
# $$ \|\tau\| \le \mu\, p, \qquad \|\tau\| = \mu\, p \ \text{ against the motion where it slips}. $$
#
# These are inequalities: which points touch and which of them slip is part of the answer. That makes
# contact nonlinear even if nothing else is.

# %% [markdown]
# ## Units
#
# The package knows no units; it needs consistent ones. Here everything is in mm and N. Stresses and Young's
# modulus are then in N/mm² = MPa, energies in N mm = mJ.
#
# ## The scene in a few lines
#
# The names that we need:

# %%
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Scene,
    Status,
    Support,
    Surface,
    TotalForce,
    gallery,
    materials,
    pictures,
    solve_scene,
    write_vtu,
)

# %% [markdown]
# A *scene* says what there is: bodies with mesh and material, what holds them, what loads them, and which
# surfaces may touch. The faces of a block are called x0, x1, y0, y1, z0, z1. Of a pair of surfaces the
# *slave* brings the points at which contact is checked, the *master* is what they are checked against; take
# the smaller or finer one as slave.

# %%
steel = materials.IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
table = gallery.block((-10, -5, -15), (30, 25, 0), (20, 15, 8))  # corners in mm, cells
tower = gallery.block((0, 0, 0), (20, 20, 30), (12, 12, 12))
scene = Scene(
    bodies={"table": Body(table, steel), "tower": Body(tower, steel)},
    supports=[Support("table", "z0")],
    loads=[TotalForce("tower", "z1", (3000.0, 0.0, -16000.0))],  # N
    contacts=[
        ContactPair(Surface("tower", "z0"), Surface("table", "z1"), Coulomb(0.3), discretisation="node")
    ],
)

# %% [markdown]
# Nothing has been computed yet. The plan reports what will be: how many unknowns, which solver, how much
# memory. It is the place to notice a forgotten support or a mesh that is far too fine.

# %%
print(scene.plan())

# %% [markdown]
# One call solves it. `None` lets the package cut the blocks into subdomains of a good size; the
# communicator makes the same script run on many processes with `mpirun`.

# %%
state = solve_scene(scene, MPI.COMM_WORLD)

# %% [markdown]
# ## What came out
#
# The *state* holds fields and numbers. First a picture: the von Mises stress in the deformed blocks, and
# below it two sections through the contact. A function that is given no file name returns the picture, and
# the notebook shows it.

# %% tags=["cover"]

pictures.plot_stress(state, title="A pushed tower", scale=200, width=1200)

# %% [markdown]
# *The displacement is exaggerated in the upper picture, true in the sections. The tower presses with its
# right edge, where the stress is largest, and its left edge has lifted off the table.*
#
# What every contact point does:

# %%
contact = state.contact
for status in Status:
    print(f"{status.name.lower():6s} {contact.count(status):4d} points")
print(f"largest pressure {contact.pressure.max():8.1f} N/mm²")
print(f"widest gap       {contact.gap.max():8.4f} mm")

# %% [markdown]
# The next picture shows the surface of contact from below, as the table sees it: x runs to the left.

# %%

pictures.plot_contact_pressure(state, title="Under the tower", width=1200)

# %% [markdown]
# *Left the pressure: nothing on the side that lifts, most at the far edge. Right the status: open (no
# contact), stick, and slip with arrows that show where the points slide to. In the middle it sticks; near
# the edges, where the blocks bulge differently, it slips by less than a micrometre.*
#
# ## Is it right?
#
# A sheet of paper knows the resultants. The table must push back with exactly the load, 16 kN upwards and 3
# kN sideways. And the moment shows where the pressure's resultant acts: the push at the height $h$ = 30 mm
# moves it by $e = F_x h / F_z$ from the middle.

# %%
import numpy as np

total = contact.force.sum(axis=0)
x = state.contact_places[:, 0]
resultant = float(contact.normal_force @ x / contact.normal_force.sum())
e = 3000.0 * 30.0 / 16000.0
print("force of the table on the tower", np.round(total, 6) + 0.0, "N")
print(f"the pressure's resultant acts at x = {resultant:.4f} mm, by the moments at {10.0 + e:.4f} mm")
assert np.allclose(total, (-3000.0, 0.0, 16000.0), atol=1e-6)
assert abs(resultant - 10.0 - e) < 1e-8

# %% [markdown]
# Engineers know the *middle third*: as long as the resultant stays within the middle third of the base,
# $e \le L/6$ = 3.3 mm, nothing lifts. Here $e$ = 5.6 mm. If the pressure were distributed linearly, the
# contact would be $3 (L/2 - e)$ = 13.1 mm long. It is not linear, as the pictures show, but the estimate is
# not bad:

# %%
closed = contact.status != Status.OPEN
length = 20.0 - x[closed].min()
print(f"contact begins at x = {x[closed].min():.2f} mm: {length:.1f} mm long, estimate {3 * (10 - e):.1f} mm")
assert abs(length - 3 * (10 - e)) < 2.0
assert np.all(contact.gap[~closed] > 0)
assert np.all(contact.normal_force[closed] > 0)

# %% [markdown]
# The state also knows how far off it is itself, in energy norm: what the solver left, what is missing to
# Coulomb's law, and what the mesh cannot represent. The last is much the largest, mostly because of the
# sharp edges; the solver stops when its own error no longer matters compared with it.

# %%
print(state.estimate_errors())

# %% [markdown]
# ## Heat through the contact
#
# Let the tower be warm above and the table cool below. Rough surfaces conduct where they are pressed
# together, by $h = c\,p/H$: heat takes the way through the pressed edge. In N and mm heat is in N mm/s = mW.

# %%
from fenics_contact.heat import (
    Conductor,
    HeatScene,
    HeldTemperature,
    PressureConductance,
    ThermalContact,
    solve_heated,
)  # fmt: skip

joint = ThermalContact(
    Surface("tower", "z0"), Surface("table", "z1"), PressureConductance(20.0, hardness=1000.0)
)
ends = [HeldTemperature("table", "z0", 20.0), HeldTemperature("tower", "z1", 80.0)]  # °C
conductors = {"table": Conductor(50.0), "tower": Conductor(50.0)}  # N/(s K)
warm = solve_heated(scene, HeatScene.on(scene, conductors, held=ends, contacts=[joint]), MPI.COMM_WORLD)
celsius = pictures.Units(temperature="°C", power="mW")
pictures.plot_field(warm, "temperature", clip=((0, 10, 0), (0, -1, 0)), units=celsius, width=1200)

# %% [markdown]
# *Cut in the middle: isotherms bend towards the right edge, where heat passes; at the left edge, which has
# lifted off, the temperature jumps.*
#
# If only the joint resisted, $c\,F_z\,\Delta T/H$ would pass, whatever the pressure is like. The blocks
# resist, too, so that it is less; and what enters above leaves below, to rounding:

# %%
passed, most = warm.heat.contacts[0].total, 20.0 / 1000.0 * 16000.0 * 60.0
print(f"heat {passed:.0f} mW, through the joint alone {most:.0f} mW")
print(f"largest jump of the temperature {warm.heat.contacts[0].jump.max():.2f} degrees")
assert 0.3 * most < passed < most
assert warm.heat.balance.error < 1e-8

# %% [markdown]
# ## To look at it elsewhere
#
# A file for [ParaView](https://www.paraview.org), with displacement, stress and all contact fields; open
# the `.vtm`, it names the others.

# %%

print(write_vtu(state, "output/notebooks/first_contact", "tower"))

# %% [markdown]
# ## What to try next
#
# - `Coulomb(0.15)`: friction cannot carry a push of 3 kN under a load of 16 kN. The error says so, names
#   the body and the direction in which it slides away.
# - A push of 1500 N: the resultant stays in the middle third, and everything is in contact.
# - A finer mesh, `(20, 20, 20)` cells: where does the contact begin, how do the errors change, and
#   why does the largest pressure keep growing? (The edge of the tower is sharp: the pressure there has no
#   finite limit.)
# - Next notebook: [two chain links](02_chain_links_and_friction.ipynb), which are round, and friction with
#   a memory.
