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
# # Two chain links: stick, slip and memory
#
# ![Von Mises stress in two chain links](../docs/pictures/notebooks/02_chain_links_and_friction.png)
#
# Two links of a round-steel chain hang in each other. One is held, the other is pulled, then swung to and
# fro. What does friction do where they touch? This notebook looks at the status of contact points, at the
# influence of the coefficient of friction, and at what makes friction special among forces: it remembers.
#
# It builds on [01 First contact](01_first_contact.ipynb). Lengths are in mm, forces in N, stresses in
# N/mm².

# %% [markdown]
# ## Coulomb's law, point by point
#
# In the discrete problem every contact point carries forces: a normal force $\lambda_N \ge 0$ [N] and a
# friction force $\tau$ [N] in the tangent plane, with the slip $s$ [mm], the tangential displacement of the
# one body relative to the other since the last load step:
#
# | status | | |
# |---|---|---|
# | open | $\lambda_N = 0$ | $\tau = 0$ |
# | stick | $\lambda_N > 0,\ \|\tau\| < \mu \lambda_N$ | $s = 0$ |
# | slip | $\lambda_N > 0,\ \|\tau\| = \mu \lambda_N$ | $s = \gamma\, \tau,\ \gamma \ge 0$ [mm/N] |
#
# The bound depends on the solution itself, $\mu \lambda_N$: with Coulomb's friction contact is no longer
# the minimisation of an energy, but a fixed point.

# %% [markdown]
# ## Links
#
# Wire of 16 mm, inner width of 19.2 mm. The second link is turned by 90° and moved
# until it just touches the first. Along the ring the cells are about as long as across the wire: contact by
# nodes does best where the facets on both sides are of one size.

# %%
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    Scene,
    Status,
    Support,
    Surface,
    gallery,
    materials,
    pictures,
    result_page,
    solve_scene,
    solve_steps,
)

links = gallery.two_links(gallery.LinkShape(inner_radius=9.6, n_around=72, n_a=3, n_b=10))
print(f"{links.first.mesh.n_cells} hexahedra a link")
print("surfaces by name:", ", ".join(links.first.mesh.surfaces))

# %% [markdown]
# A function returns the scene, so that friction and pull can be varied. Link 2 is pulled at its far crown
# by a given displacement [mm]; it could not get away even without friction.

# %%

steel = materials.IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²


def chain(friction_coefficient, pull=(0.25, 0.0, 0.0)):
    friction = Coulomb(friction_coefficient)
    crowns = Surface("link 2", "contact"), Surface("link 1", "contact")
    return Scene(
        bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
        supports=[Support("link 1", "grip"), Support("link 2", "grip", pull)],
        contacts=[ContactPair(*crowns, friction, discretisation="node")],
    )


# %% [markdown]
# ## One state
#
# By default the solver stops where the mesh's error dominates. Here the status of single points matters, so
# the tolerance is given: residuals of $10^{-8}$.

# %%
from mpi4py import MPI

mu = 0.3
state = solve_scene(chain(mu), MPI.COMM_WORLD, tolerance=1e-8)
contact = state.contact
print(f"the links pull at each other with {-contact.force[:, 0].sum() / 1e3:.1f} kN")
print(", ".join(f"{contact.count(status)} points {status.name.lower()}" for status in Status))

# %% [markdown]
# The stress in both links, and two sections through the spot where they touch:

# %% tags=["cover"]

pictures.plot_stress(state, title="Two chain links", width=1000)

# %% [markdown]
# *The stress is largest where the links touch; the sections show how deep it reaches. The dark spots at the
# far crowns are the rims of the surfaces by which the links are held and pulled.*
#
# Now the contact itself: pressure and status, with the direction in which points slip.

# %%

pictures.plot_contact_pressure(state, title=f"μ = {mu:g}", width=1200)

# %% [markdown]
# *Left the pressure, largest in the middle. Right the status: the middle sticks, the rim slips, because the
# pressure and with it the bound of friction falls to zero there. The arrows show the direction of slip.*
#
# Coulomb's law can be checked in every point. The package's friction force acts on the master; the slave
# is under the opposite one, so a point slips along $\tau$: the cosine between both is one.

# %%
import numpy as np

sticks, slips = contact.status == Status.STICK, contact.status == Status.SLIP
used = np.linalg.norm(contact.friction_force, axis=1)
force, slip = contact.friction_force[slips], contact.slip[slips]
cosine = np.sum(force * slip, axis=1) / (used[slips] * np.linalg.norm(slip, axis=1))
print(f"sticking points use at most {np.max(used[sticks] / contact.slip_bound[sticks]):.1%} of μλ_N")
print(f"slipping points use at least {np.min(used[slips] / contact.slip_bound[slips]):.4%} of it")
print(f"smallest cosine between τ and slip: {cosine.min():.6f}")
assert len(cosine) > 0
assert np.all(used <= contact.slip_bound * (1 + 1e-6))
assert cosine.min() > 0.999

# %% [markdown]
# ## From no friction to much friction
#
# The same pull with other coefficients. Without friction every closed point slips freely. The dissipated
# energy $\sum \tau \cdot s$ [N mm] is zero without friction, and would be zero if nothing slipped.

# %%
states = {}
print("          pull [kN]   peak pressure [N/mm²]   stick   slip   dissipated [N mm]")
for mu in (0.0, 0.3, 0.6):
    found = solve_scene(chain(mu), MPI.COMM_WORLD, tolerance=1e-8)
    states[f"μ = {mu:g}"], pair = found, found.contact
    lost, pull = float(np.sum(pair.friction_force * pair.slip)), -pair.force[:, 0].sum() / 1e3
    counts = f"{pair.count(Status.STICK):7d} {pair.count(Status.SLIP):6d}"
    print(f"μ = {mu:3.1f} {pull:12.3f} {pair.pressure.max():23.1f} {counts} {lost:19.3f}")
assert states["μ = 0"].contact.count(Status.STICK) == 0
assert states["μ = 0.6"].contact.count(Status.STICK) >= states["μ = 0.3"].contact.count(Status.STICK) > 0

# %% [markdown]
# The same as maps:

# %%

pictures.plot_contact_status(states, title="Pulled with less and with more friction", width=1200)

# %% [markdown]
# *Without friction every point that touches may slide (diamonds). With friction the middle sticks, the more
# of it the larger μ is. Pull and pressure hardly change: a straight pull asks little of friction. That is
# different as soon as the chain swings.*
#
# ## To and fro: a load history
#
# The pull stays, and link 2 is shifted sideways, along z, to and fro: a sequence of load steps. Each step
# measures slip from the one before, so that the friction forces of one step are what the next one starts
# from. (Displacements are small against the links: points keep their partners.)

# %%

forth, back = np.linspace(0.0, 0.8, 5), np.linspace(0.8, -0.8, 9)
path = np.concatenate([forth, back[1:], -back[1:]])  # mm
steps = [
    LoadStep(
        f"{shift:+.1f} mm",
        supports=[Support("link 1", "grip"), Support("link 2", "grip", (0.25, 0.0, shift))],
    )
    for shift in path
]
history = solve_steps(ContactProblem(chain(0.3), MPI.COMM_WORLD, tolerance=1e-8), steps)

# %% [markdown]
# The force that shifts the link over the shift, with the bounds $\pm \mu N$ of the friction that the normal
# forces $N$ allow:

# %%

sideways = np.array([-found.contact.force[:, 2].sum() for found in history]) / 1e3  # kN
bound = np.array([found.contact.slip_bound.sum() for found in history]) / 1e3
pictures.plot_curves(
    {"force on link 2": (path, sideways)},
    reference={"μN": (path[4:13], bound[4:13]), "−μN": (path[4:13], -bound[4:13])},
    xlabel="shift of the far crown (mm)", ylabel="sideways force (kN)",
    connected=True, title="A swung chain", width=1000,
)  # fmt: skip

# %% [markdown]
# *A loop: on the way forth the links first stick and bend like springs, then slip spreads until everything
# slides. (The force then exceeds μN a little, because the crown is curved: pressure pushes back, too.) On
# the way back they stick again at once. At the same shift the forces on the way forth and on the way back
# differ: the links remember where they came from.*
#
# The area of the loop is the energy that friction takes in one cycle. It must equal what the contact points
# dissipate, $\oint F\,\mathrm{d}z = \oint \sum \tau \cdot \mathrm{d}s$ [N mm]; both integrals by the
# trapezoidal rule over the closed cycle from +0.8 mm and back to it.

# %%
cycle = range(5, len(history))
work = sum(500.0 * (sideways[k - 1] + sideways[k]) * (path[k] - path[k - 1]) for k in cycle)
pairs = [(history[k - 1].contact, history[k].contact) for k in cycle]
lost = sum(float(np.sum(0.5 * (a.friction_force + b.friction_force) * b.slip)) for a, b in pairs)
print(f"work of the swing {work:.1f} N mm, dissipated by friction {lost:.1f} N mm")
memory = sideways[16] - sideways[8]  # both at a shift of zero: on the way forth, on the way back
print(f"force at zero shift: {sideways[8]:.2f} kN on the way back, {sideways[16]:.2f} kN on the way forth")
assert abs(work / lost - 1) < 0.05
assert abs(memory) > 1.0

# %% [markdown]
# How slip spreads, in six of the steps:

# %%
chosen = {"pulled": 0, "forth": 2, "far": 4, "a step back": 5, "back": 8, "far back": 12}
maps = {f"{name}, {steps[k].name}": history[k] for name, k in chosen.items()}
pictures.plot_contact_status(maps, title="Stick and slip while the chain swings", width=1200)

# %% [markdown]
# *Slip begins at the rim and eats its way to the middle, until everything slides along z. One step back,
# and all but the rim sticks again; then slip spreads the other way.*
#
# ## In three dimensions
#
# `result_page(history[4], field="contact_pressure")` alone in a cell shows the state, to turn and to zoom.
# It is larger than all pictures of this notebook together, so this cell puts it into a file instead: one
# page that any browser opens, without a server or a network.

# %%

page = result_page(history[4], "output/notebooks/chain_links/swung.html", field="contact_pressure")
print("to open in a browser:", page)

# %% [markdown]
# ## What to try next
#
# - A swing of 0.3 mm only: part of the surface never slips (*partial slip*), and the loop becomes thin.
# - Swing along y instead of z: the links are mirror images of each other, so what should change?
# - `Coulomb(0.05)`, greased links.
# - `demos/demo_five_links.py`: a longer chain, held by contact alone.
# - Next: [03 your own UFL model](03_your_own_ufl_model.ipynb).
