# # The contact patch test: constant stress through meshes that do not match
#
# ![Contact pressure, node to surface](../docs/pictures/patch_test_node.png)
#
# Two blocks of one material lie upon each other, pressed by $p$ [N/mm²] and free to widen. The exact
# answer is the same stress everywhere,
#
# $$ \sigma = -p \, e_z \otimes e_z, \qquad \lambda_i = p \, A_i, $$
#
# whatever the meshes. A contact discretisation passes the test if it finds this answer where the nodes of
# both surfaces do not meet. Node to surface does not: every slave node presses on the master facet under it
# as it happens to lie. The mortar method weighs the gap with a dual basis and integrates it over the segments
# that both meshes cut out of each other; it passes for every kind of cells.
#
# Run it with `make demo DEMO=patch_test`.

from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Scene,
    Support,
    Surface,
    Traction,
    gallery,
    materials,
    pictures,
    qp,
    solve_scene,
    write_result,
    write_vtu,
)

comm = MPI.COMM_WORLD
output = Path("output/patch_test")
pressure = 100.0  # N/mm²

# ## Scene
#
# Rollers on three sides of both blocks: nothing keeps them from widening.


def pressed(slave: str, master: str, discretisation: str) -> Scene:
    """Return the upper block (slave) on the lower one (master), of given cells."""
    lower = gallery.block((0, 0, 0), (10, 10, 10), (3, 4, 2), master)  # mm
    upper = gallery.block((0, 0, 10), (10, 10, 20), (5, 3, 2), slave)
    steel = materials.IsotropicElasticity(2.1e5, 0.3)
    rollers = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    supports = [Support(body, side, value) for body in ("lower", "upper") for side, value in rollers.items()]
    return Scene(
        bodies={"lower": Body(lower, steel), "upper": Body(upper, steel)},
        supports=[*supports, Support("lower", "z0", (None, None, 0.0))],
        loads=[Traction("upper", "z1", (0.0, 0.0, -pressure))],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), discretisation=discretisation)],
    )


# ## Solution
#
# The von Mises stress of the exact answer is $p$.

CELLS = [("hexahedron", "hexahedron"), ("tetrahedron", "tetrahedron"), ("tetrahedron", "hexahedron")]
errors, imbalance = {}, 0.0
for slave, master in CELLS:
    for discretisation in ("node", "mortar"):
        scene = pressed(slave, master, discretisation)
        state = solve_scene(scene, comm, solver=qp.FaceNewton(tolerance=1e-12))
        imbalance = max(imbalance, state.balance().imbalance)
        stress = np.concatenate([state.gather_von_mises(name) for name in scene.bodies])
        errors[slave, master, discretisation] = float(np.abs(stress - pressure).max() / pressure)
        if slave == master == "hexahedron":
            title = {"node": "Node to surface", "mortar": "Mortar"}[discretisation]
            pictures.plot_contact_pressure(
                state, output / f"{discretisation}.png", clim=(0, 1.5 * pressure), title=title
            )
            write_vtu(state, output, discretisation)

# ## Result
#
# The file describes the last of the scenes in full, and the errors of all.

record = {"errors": {", ".join(names): error for names, error in errors.items()}}
write_result(state, output, more=record)

if comm.rank == 0:
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"contact patch test, largest error of the stress relative to p, {ranks}")
    print("  slave        master              node     mortar")
    for slave, master in CELLS:
        node, mortar = (errors[slave, master, kind] for kind in ("node", "mortar"))
        print(f"  {slave:12s} {master:12s} {node:10.1e} {mortar:10.1e}")
    print(f"  loads, reactions and contact forces balance to {imbalance:.1e}")
    print(f"pictures and files in {output}/")

# Mortar passes, node to surface does not. Either way load, reactions and forces of contact balance, forces
# and moments, to rounding.

assert max(error for names, error in errors.items() if names[2] == "mortar") < 1e-10
assert min(error for names, error in errors.items() if names[2] == "node") > 0.01
assert imbalance < 1e-9

# ## What to try next
#
# - Curved surfaces: `demo_hertz_sphere.py`, `demo_punch_2d.py`.
# - `Tie` in place of `ContactPair`: tied meshes pass the same test.
