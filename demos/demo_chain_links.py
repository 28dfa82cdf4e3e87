# # Two chain links: optimise the contact shape under Coulomb friction
#
# ![Von Mises stress](../docs/pictures/chain_links_stress.png)
#
# Two links of a round-steel chain hang in each other. Link 1 is held at its far crown. Link 2 is pulled at
# its far crown by a dead force and is held by nothing but contact and friction. We look for the shape of
# link 1's crown, where link 2 presses, that minimises the total potential energy
#
# $$ J(\alpha) = \tfrac12 u^T K(\alpha) u - f^T u \quad [\mathrm{N\,mm}], $$
#
# where the displacement $u$ [mm] solves the contact problem with Coulomb friction on the design
# $\alpha$ [mm]: no point of link 2 enters link 1, contact forces press, and $\|\tau\| \le \mu \lambda_N$
# with equality where the links slide. $J$ is not differentiable everywhere. The bundle method needs one
# subgradient a step, which costs one adjoint solve for all 28 variables.
#
# Run it with `make demo` (66 528 unknowns in 32 subdomains, the size of the published experiment),
# `make demo NP=2` (two MPI ranks), or `make demo SIZE=small` (less than half of the unknowns).
#
# That is the published objective. For it the seat gives way, which no designer wants. With
# `make demo OBJECTIVE=pressure` the largest contact pressure is lowered instead, with `OBJECTIVE=energy` the
# strain energy $\tfrac12 u^T K u$, the compliance of the links, of which no retreat is a part; both keep the
# volume of the link.

import argparse
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    PhaseTimer,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    box_partition,
    contact_area,
    gallery,
    materials,
    minimize,
    pictures,
    show_progress,
    theory,
    write_vtu,
)
from fenics_contact.design import (
    BundleTrust,
    LargestPressure,
    LinearConstraints,
    NonlinearConstraint,
    StrainEnergy,
    TotalPotential,
    fixed_rim,
)
from fenics_contact.output import (
    ResultSeries,
    write_design_table,
    write_optimisation_result,
    write_step,
    write_stl,
    write_xdmf,
)

comm = MPI.COMM_WORLD

# ## Size
#
# The published experiment has 48 × 8 × 20 hexahedra a link. Here they shrink towards the spots where links
# touch, so that ten cells lie across it in both directions. Contact does not see the cells' flat facets but
# the tori that they represent, which `two_links` hands over: facets are off by more than the bodies approach.

SIZES = {
    "small": gallery.LinkShape(n_around=36, n_a=6, n_b=14, grading=2.5),
    "paper": gallery.LinkShape(n_around=48, n_a=8, n_b=20, grading=2.5),
}
OBJECTIVES = {
    "potential": (TotalPotential(), "total potential (N mm)"),
    "energy": (StrainEnergy(), "strain energy (N mm)"),
    "pressure": (LargestPressure(), "largest pressure (N/mm²)"),
}


parser = argparse.ArgumentParser(description="Optimise the contact shape of two chain links.")
parser.add_argument("--size", choices=list(SIZES), default="paper")
parser.add_argument("--objective", choices=list(OBJECTIVES), default="potential")
given = parser.parse_args()
size, aim = given.size, given.objective
objective, label = OBJECTIVES[aim]
published = aim == "potential"
output = Path("output") / ("chain_links" if published else f"chain_links_{aim}")

# ## Scene
#
# Steel links of 16 mm wire and 48 mm pitch, pulled with 80 kN. Dimensions, material, load and friction
# coefficient of the published experiment are not known; these are those of a real chain at its working load.
# Nothing numerical happens here: a scene only says what there is. Contact is by nodes, as in the published
# experiment. Where pressure counts it is by mortar: an optimiser finds designs of which single nodes do not
# see the peak. The one for less pressure at nodes lowers it by 39 % there, by 22 % as mortar measures it.

force = 80e3  # N
timer = PhaseTimer()
with timer.phase("mesh"):
    links = gallery.two_links(SIZES[size])

steel = materials.IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
friction_coefficient = 0.3
scene = Scene(
    bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
    supports=[Support("link 1", "grip")],
    loads=[TotalForce("link 2", "grip", (force, 0.0, 0.0))],
    contacts=[
        ContactPair(
            slave=Surface("link 2", "contact"),
            master=Surface("link 1", "contact"),
            friction=Coulomb(friction_coefficient),
            discretisation="node" if published else "mortar",
        )
    ],
)

# What Hertz says of the spot: crowns are convex across the wire and concave along the ring. His theory is for
# half spaces without friction, which links of 16 mm wire under a spot of 6 mm are not quite.

crown = (1.0 / SIZES[size].section.crown_radius, -1.0 / SIZES[size].inner_radius)  # 1/mm
modulus = theory.contact_modulus(2.1e5, 0.3, 2.1e5, 0.3)  # N/mm²
hertz = theory.hertz_point(force, theory.relative_curvatures(crown, crown, np.pi / 2), modulus)

# Each link is cut into 8 × 1 × 2 boxes. Every box floats; multipliers glue it to its neighbours.

partitions = {name: box_partition(body.mesh, (8, 1, 2)) for name, body in scene.bodies.items()}

# ## Design
#
# A net of 7 × 4 control points moves the inner side of link 1's crown along its normals, by at most 0.25 mm.
# The rest of the mesh follows smoothly; away from the crown it stays.

design = SurfaceDesign("link 1", links.first.crown, net=(7, 4))
problem = ShapeProblem(ContactProblem(scene, comm, partitions=partitions), design, objective)
start = np.zeros(problem.size)

# The link may not lose volume. The published experiment bounds the volume's linearisation, which is almost
# the volume: $V'(0)\,\alpha \ge 0$. The other objectives keep the volume itself, and the ends of the net
# around the wire stay: a groove with a step at its ends has its peak there, an edge that the mesh of the
# optimisation is too coarse to see. (Without that the peak falls by 40 %, but on a mesh twice as fine it is
# as high as that of the untouched crown.)

volume, volume_gradient = problem.volume(start)
constraints = (
    [LinearConstraints(-volume_gradient[None, :], [0.0])]
    if published
    else [
        NonlinearConstraint(problem.volume, lower=volume, upper=volume, name="volume"),
        fixed_rim(design, (1, 0)),
    ]
)

# ## Optimisation
#
# Every better design becomes a member of a series: ParaView plays `designs.pvd` as a film.

series = ResultSeries(output, "designs", comm)
with show_progress(comm):
    result = minimize(
        problem,
        start,
        BundleTrust(tolerance=1e-4 if published else 1e-3),
        bounds=(np.full(problem.size, -0.25), np.full(problem.size, 0.25)),
        constraints=constraints,
        callback=series.follow(problem),
    )
before, after = problem.first, problem.best
assert np.array_equal(after.alpha, result.x)

# ## Pictures
#
# The same colours before and after, so that they can be compared.

points = {"before": before, "after": after}
peak = max(float(point.state.contact.pressure.max()) for point in points.values())
with show_progress(comm), timer.phase("pictures"):
    pictures.plot_decomposition(scene, partitions, output / "decomposition.png", comm=comm)
    for name, point in points.items():
        title = name.capitalize()
        pictures.plot_stress(
            point.state, output / f"stress_{name}.png", clim=(0, 1500), reach=12.0, title=title
        )
        pictures.plot_contact_pressure(
            point.state, output / f"pressure_{name}.png", clim=(0, peak), title=title
        )

# The control points and the surface that they move, how the first state was found, and what the new shape
# does to contact and outlines.
#
# ![Contact pressure and outlines before and after](../docs/pictures/chain_links_before_after.png)
#
# With `OBJECTIVE=pressure` the crown becomes a groove along link 2's wire:
#
# ![The same for the largest pressure](../docs/pictures/chain_links_less_pressure.png)

with show_progress(comm), timer.phase("pictures"):
    pictures.plot_control_net(problem, result.x, output / "control_net.png")
    pictures.plot_convergence(result.history, output / "convergence.png", label=label, comm=comm)
    steps = before.state.solution.history
    products, natural = zip(*((step.products, step.residuals.natural) for step in steps), strict=True)
    pictures.plot_curves(
        {"natural residual": (products, natural)},
        output / "residuals.png",
        xlabel="products with F",
        ylabel="relative residual",
        connected=True,
        logarithmic="y",
        title="First state",
        comm=comm,
    )
    ends = (before.state, after.state) if aim == "pressure" else (before, after)  # named in any case
    pictures.plot_before_after(*ends, output / "before_after.png", label=label)

# ## Files for ParaView, CAD and printers
#
# The crown as a table in the parameters of the net and as a B-spline surface, link 1 as triangles.

with timer.phase("files"):
    write_design_table(problem, result.x, output / "crown.csv", lines=(57, 25))
    write_step(problem, result.x, output / "crown.step", solid=False)
    write_stl(problem, result.x, output / "link_1.stl")
    for name, point in points.items():
        write_vtu(point.state, output, name)
        write_xdmf(point.state, output / f"{name}.xdmf")

# ## Result
#
# A lower total potential is not yet a better shape: where the seat gives way, link 2 sinks in and its dead
# force gains force × way, whatever the shape. How far it may travel unloaded until it touches is that
# retreat; the rest of the drop is the better shape's. It is negative for the published objective: the seat is
# 0.25 mm deeper, as much as the bounds allow, and a little softer. The drop is printed with the published
# one, which belongs to other dimensions, load and bounds. For less pressure the crown becomes a groove that
# fits link 2 more closely. The file holds the scene, the history, the best design and its state; what is
# added here is under `more`.

drop = (before.value - after.value) / abs(before.value) * 100
volume_final = problem.volume(result.x)[0]
pull = np.array([1.0, 0.0, 0.0])
retreat, peak_pressure, area, strain_energy, potential = (
    {name: measure(point.state) for name, point in points.items()}
    for measure in (
        lambda state: state.contact.travel(pull),
        lambda state: float(state.contact.pressure.max()),
        contact_area,
        lambda state: state.energies.strain,
        lambda state: state.energies.total_potential,
    )
)
by_retreat = force * (retreat["after"] - retreat["before"])
by_shape = potential["before"] - potential["after"] - by_retreat
seconds = {**timer.seconds, **problem.seconds}
counts = after.state.counts
record = {
    "size": size,
    "strain_energy_initial": strain_energy["before"],
    "strain_energy_final": strain_energy["after"],
    "f_products_first_state": before.state.solution.products,
    "peak_pressure_initial": peak_pressure["before"],
    "peak_pressure_final": peak_pressure["after"],
    "contact_area_initial": area["before"],
    "contact_area_final": area["after"],
    "hertz_peak_pressure": hertz.peak_pressure,
    "hertz_contact_area": hertz.area,
    "retreat_initial": retreat["before"],
    "retreat_final": retreat["after"],
    "drop_by_retreat": by_retreat,
    "drop_by_shape": by_shape,
    "volume_initial": volume,
    "volume_final": volume_final,
    "weak_contacts": after.weak.contacts,
    "weak_discs": after.weak.discs,
    "points_on_facet_edges": after.weak.edges,
    "weak_choice": after.weak.choice.name,
    "seconds_beside": timer.seconds,
}
write_optimisation_result(result, problem, output, more=record)
imbalance = max(point.state.balance().imbalance for point in points.values())

# Every rank has the same numbers; one prints them.

if comm.rank == 0:
    contact = after.state.contact
    status = ", ".join(f"{contact.count(kind)} {kind.name.lower()}" for kind in Status)
    ranks = "1 rank" if comm.size == 1 else f"{comm.size} ranks"
    print(f"two chain links: {counts['torn_unknowns']} unknowns in {counts['subdomains']} subdomains,")
    print(f"{problem.size} design variables, {ranks}")
    print("                          before          after         change")
    for word, unit, found in (
        ("strain energy", "N mm", strain_energy),
        ("potential", "N mm", potential),
        ("peak pressure", "MPa", peak_pressure),
        ("contact area", "mm²", area),
    ):
        change = found["after"] / found["before"] - 1
        print(f"  {word:14s}{found['before']:14.1f} {found['after']:14.1f} {change:+14.1%} {unit}")
    print(f"  Hertz (before): {hertz.peak_pressure:.1f} MPa on {hertz.area:.1f} mm²")
    print(f"  objective       {aim:>14s}       lower by {drop:.2f} %" + " (published: 12.39 %)" * published)
    print(f"  retreat         {retreat['after']:14.4f} mm    gains {by_retreat:.1f} N mm of potential")
    if published:
        print(f"  by shape        {by_shape:14.1f} N mm, {by_shape / abs(potential['before']):.2%} of it")
    print(f"  volume          {volume_final / volume - 1:+14.1e}")
    print(f"  Hertz' radius                                 {hertz.semi_axes[0]:14.3f} mm")
    print(f"  iterations      {result.iterations:14d}       {result.evaluations} evaluations")
    print(f"  F-products      {problem.products:14d}       first state: {before.state.solution.products}")
    print(f"  contact points  {contact.points.count:14d}       {status}")
    print(f"  forces balance  {imbalance:14.1e}       loads, reactions and contact forces")
    for phase, spent in sorted(seconds.items(), key=lambda item: -item[1]):
        print(f"  {phase:15s} {spent:14.2f} s")
    print(f"  {'all phases':15s} {sum(seconds.values()):14.2f} s")
    print(f"pictures and files in {output}/")

# The objective must fall, and the link must not have lost volume (beyond the linearisation, where that bounds
# it). A shape for less pressure has a peak lower by 30 % at least. The grip of link 1 holds what pulls
# link 2, forces and moments, to rounding.

assert after.value < before.value
assert volume_final > volume * (1 - (1e-4 if published else 1e-6))
assert aim != "pressure" or peak_pressure["after"] < 0.7 * peak_pressure["before"]
assert imbalance < 1e-9

# ## What to try next
#
# - `Coulomb(0.1)`: most of the contact slips.
# - Another objective, for example `LargestStress("link 1")` or a sum of several, from
#   `fenics_contact.design`.
# - `checkpoint=Checkpoint(output / "run.npz")` in `minimize` (from `fenics_contact.design`): a run that is
#   interrupted goes on from there when it is started again. Within `with interruptible(comm):` (from
#   `fenics_contact`) Ctrl-C lets the evaluation under way come to its end first.
# - `tolerance=design.AdaptiveTolerance()` in `ShapeProblem`: states are solved no more accurately than the
#   optimiser needs, which saves a third of the products.
# - A finer net, or `LinkShape(cell="tetrahedron")`.
# - `result_page(after.state, output / "links.html")` (from `fenics_contact`): a page on which the mouse
#   turns the links; `after.state.to_pyvista()` for pictures of your own.
