# # A round punch on a block: Hertz's contact in the plane
#
# ![Von Mises stress](../docs/pictures/punch_2d_stress.png)
#
# A round punch of radius $R$ [mm] is pressed on a block by the force $F$ [N/mm], both long across the plane.
# While the contact is small compared with both bodies, Hertz knows its half width $a$ [mm], the pressure $p$
# and its peak $p_0$ [MPa] without friction:
#
# $$ a = \sqrt{\frac{4 F R}{\pi E^*}}, \qquad p(x) = p_0 \sqrt{1 - x^2/a^2}, \qquad
#    p_0 = \sqrt{\frac{F E^*}{\pi R}}, \qquad
#    \frac{1}{E^*} = \frac{1 - \nu_1^2}{E_1} + \frac{1 - \nu_2^2}{E_2}. $$
#
# Run it with `make demo DEMO=punch_2d`, on two ranks with `make demo DEMO=punch_2d NP=2`.

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
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
from fenics_contact.output import write_xdmf

comm = MPI.COMM_WORLD
output = Path("output/punch_2d")

# ## Bodies
#
# A steel punch and an aluminium block. Both meshes are fine where they will touch and coarse elsewhere. Their
# nodes do not match: the mortar discretisation takes that without a ripple in the pressure.

radius, width, height = 50.0, 60.0, 50.0  # mm
punch = gallery.half_disc(radius, 28, symmetry="", grading=4.0)
away = np.geomspace(3.0, width, 22)
across = np.concatenate([-away[::-1], np.linspace(-3.0, 3.0, 41)[1:-1], away])
down = np.concatenate([[0.0], np.geomspace(0.15, height, 30)])
block = gallery.rectangle_lattice([across, -down[::-1]])

steel = materials.PlaneStrain(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
aluminium = materials.PlaneStrain(young_modulus=7.0e4, poisson_ratio=0.33)

# ## Scene
#
# The punch's flat top goes down by 0.06 mm. The force comes out of the calculation. How much way a force
# takes depends on the size of the bodies, in the plane even its order of magnitude; the pressure under it
# does not.

scene = Scene(
    bodies={"punch": Body(punch, steel), "block": Body(block, aluminium)},
    supports=[Support("block", "y0", (0.0, 0.0)), Support("punch", "top", (0.0, -0.06))],
    contacts=[ContactPair(Surface("block", "y1"), Surface("punch", "contact"), discretisation="mortar")],
)
partitions = scene.partition(comm.size)
with show_progress(comm):
    state = solve_scene(scene, comm, partitions=partitions, tolerance=1e-6)

# ## Hertz
#
# For $p = p_0 \sqrt{1 - x^2/a^2}$ the second moment of the pressure is $F a^2 / 4$: that measures $a$ without
# counting cells.

contact = state.contact
place = scene.points[contact.points.slave, 0]
force = contact.normal_force.sum()  # N/mm
stiffness = 1 / sum((1 - m.poisson_ratio**2) / m.young_modulus for m in (steel, aluminium))
half_width = np.sqrt(4 * force * radius / (np.pi * stiffness))
peak = np.sqrt(force * stiffness / (np.pi * radius))

found_half_width = 2 * np.sqrt(contact.normal_force @ place**2 / force)
found_peak = contact.pressure.max()

# ## Pictures

x = np.linspace(-half_width, half_width, 401)
near = np.abs(place) < 1.6 * half_width
order = np.argsort(place[near])
pictures.plot_curves(
    {"computed": (place[near][order], contact.pressure[near][order])},
    output / "hertz.png",
    xlabel="x (mm)",
    ylabel="contact pressure (MPa)",
    reference={"Hertz": (x, peak * np.sqrt(np.maximum(0.0, 1 - (x / half_width) ** 2)))},
    title=f"Pressure under a round punch, F = {force:.0f} N/mm",
    comm=comm,
)
pictures.plot_stress(state, output / "stress.png", scale=1.0, title="Punch on a block")
pictures.plot_contact_pressure(state, output / "pressure.png", title="Punch on a block")
pictures.plot_decomposition(scene, partitions, output / "decomposition.png", comm=comm)

# ## Files for ParaView

write_vtu(state, output, "punch")
write_xdmf(state, output / "punch.xdmf")

# ## Result

errors = {"half_width": found_half_width / half_width - 1, "peak_pressure": found_peak / peak - 1}
record = {
    "force": force,
    "half_width": found_half_width,
    "half_width_hertz": half_width,
    "peak_pressure": found_peak,
    "peak_pressure_hertz": peak,
    "errors": errors,
}
write_result(state, output, more=record)
imbalance = state.balance().imbalance

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    counts = state.counts
    print(f"punch: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains, {ranks}")
    print(f"  force          {force:10.2f} N/mm")
    print("                   computed      Hertz      error")
    print(f"  half width     {found_half_width:10.4f} {half_width:10.4f} {errors['half_width']:10.2%}   mm")
    print(f"  peak pressure  {found_peak:10.2f} {peak:10.2f} {errors['peak_pressure']:10.2%}   MPa")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# Half width and peak must be Hertz's to 1 %, and what holds the block must balance what presses the punch.

assert max(abs(error) for error in errors.values()) < 0.01
assert imbalance < 1e-9

# ## What to try next
#
# - `discretisation="node"`: nodes that do not match make the pressure uneven.
# - A rigid punch: `RigidSphere((0.0, 50.0), 50.0)` as the master, the base of the block pushed up.
# - A flat punch, `rectangle((-5.0, 0.0), (5.0, 20.0), (20, 40))`: the pressure peaks at its edges.
