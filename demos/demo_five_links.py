# # Five chain links, three of them held by nothing but contact
#
# ![Von Mises stress in five links](../docs/pictures/five_links_stress.png)
#
# Five links of a round-steel chain hang in each other, each turned by 90° against the one before. Link 1 is
# held at its far crown, link 5 is pulled at its own by a dead force $F$ [N]. Links 2 to 5 have no support at
# all: contact and Coulomb friction hold them, at four spots:
#
# $$ g \ge 0, \quad \lambda_N \ge 0, \quad g\,\lambda_N = 0, \qquad \|\tau\| \le \mu\,\lambda_N . $$
#
# with the gap $g$ [mm], the normal force $\lambda_N$ and the friction force $\tau$ [N] of every contact
# point. Without contact the stiffness of this chain is singular: 24 rigid motions. The equilibrium is
# statically determined, so we know what has to come out: every contact carries $F$.
#
# Run it with `make demo DEMO=five_links`, on two ranks with `make demo DEMO=five_links NP=2`.

from pathlib import Path

import numpy as np
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
    show_progress,
    solve_scene,
    write_result,
    write_vtu,
)

comm = MPI.COMM_WORLD
output = Path("output/five_links")

# ## Geometry
#
# Wire of 16 mm, pitch 48 mm. `chain` turns the links and moves each along the axis until its crown touches
# the one before. Links need not be alike.

links = gallery.chain([gallery.LinkShape(n_around=36, n_a=5, n_b=14)] * 5)
names = [f"link {number}" for number in range(1, len(links.links) + 1)]

# ## Scene
#
# The inner sides of a link's crowns are called "contact" (towards the next link) and "grip". The meshes of
# two surfaces that touch do not match: the mortar method keeps weighted means of the gap positive.

steel = materials.IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
pull = 40e3  # N
scene = Scene(
    bodies={name: Body(link.mesh, steel) for name, link in zip(names, links.links, strict=True)},
    supports=[Support(names[0], "grip")],
    loads=[TotalForce(names[-1], "contact", (pull, 0.0, 0.0))],
    contacts=[
        ContactPair(
            slave=Surface(names[j], "grip"),
            master=Surface(names[i], "contact"),
            friction=Coulomb(0.3),
            discretisation="mortar",
        )
        for i, j in links.pairs
    ],
)
if comm.rank == 0:
    print(scene.plan(ranks=comm.size))

# ## Equilibrium
#
# The package cuts the links into subdomains. Before it solves, it checks that contact and friction can hold
# every link against the load; a chain that is pushed instead of pulled is refused with the motion that
# nothing resists.

partitions = scene.partition(comm.size)
with show_progress(comm):
    state = solve_scene(scene, comm, partitions=partitions, tolerance=1e-6)

# ## Result
#
# The force on the slave at each of the four contacts, and how far the links move.

contact = state.contact
forces = np.array([pair.force for pair in state.resultants().contacts])
moved = [state.gather_displacement(name)[:, 0].mean() for name in names]
record = {"forces": -forces[:, 0], "displacements": moved}
write_result(state, output, more=record)
balance = state.balance()

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    counts = state.counts
    print(f"five links: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains, {ranks}")
    for pair, (i, j) in enumerate(links.pairs):
        status = contact.status[contact.on_pair(pair)]
        kinds = f"{np.sum(status == Status.STICK)} stick, {np.sum(status == Status.SLIP)} slip"
        print(f"  {names[i]} to {names[j]}   force {-forces[pair, 0]:11.4f} N   {kinds}")
    print(f"  mean displacement of the links  {', '.join(f'{u:.4f}' for u in moved)} mm")
    print(balance)

# ## Pictures and files for ParaView
#
# On this coarse mesh seven nodes a contact are closed: enough for forces and displacements, few for a picture
# of the pressure.

write_vtu(state, output, "chain")
pictures.plot_decomposition(scene, partitions, output / "decomposition.png", comm=comm)
pictures.plot_stress(state, output / "stress.png", clim=(0, 1000), reach=14.0, title="Five links")
pictures.plot_contact_pressure(state, output / "pressure.png", pair=1, title="Link 3 on link 2")

if comm.rank == 0:
    print(f"pictures and files in {output}/")

# Every contact transmits the whole force, along the chain and nowhere else. The chain is periodic: inner
# links follow one another at equal distances. The support holds what pulls, forces and moments, to rounding.

assert np.abs(forces - [-pull, 0.0, 0.0]).max() < 1e-4 * pull
steps = np.diff(moved)
assert np.abs(steps[1:3] / steps[1:3].mean() - 1).max() < 0.01
assert steps.min() > 0
assert balance.imbalance < 1e-9

# ## What to try next
#
# - A thinner link among thick ones: `chain([thick, thick, thin, thick, thick])` with
#   `thin = LinkShape(thickness=14.0, width=14.0, ...)`.
# - `TotalForce(..., (-pull, 0.0, 0.0))`: read the message.
# - Twist: add a `Traction` on the last link that turns it about the axis; how much does friction hold?
