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
# # Shape optimisation, step by step
#
# ![How the crown of a chain link moves](../docs/pictures/notebooks/04_shape_optimisation.png)
#
# Where two chain links touch, a few square millimetres carry the whole load. Can a slightly other shape of
# the crown spread it? This notebook takes a shape optimisation apart: design, mesh motion, state, adjoint,
# subgradient, and the bundle method that uses them. `make demo` runs all of it at full size in one go.
#
# It builds on [02 Two chain links](02_chain_links_and_friction.ipynb). Units: mm, N, N/mm².

# %% [markdown]
# ## The problem
#
# Design variables $\alpha$ [mm] move the surface of link 1's crown. For each design the links find an
# equilibrium $u(\alpha)$ [mm] with contact forces $\lambda_N(\alpha)$ [N], under Coulomb friction. We want
# the largest nodal contact force to be small:
#
# $$ \min_\alpha\ J(\alpha) = \max_i \lambda_{N,i}(\alpha)\ [\mathrm{N}], \qquad
#    |\alpha_k| \le 0.3\ \mathrm{mm}, \qquad V'(0)\,\alpha \ge 0\ [\mathrm{mm^3}]. $$
#
# The link may not lose volume (to first order). $J$ is not differentiable everywhere, for two reasons: the
# maximum passes from one point to another, and points begin to touch, to stick or to slip. So the method
# must be one for nonsmooth functions.
#
# ## State
#
# The links of notebook 02; link 2 now is pulled by a force of 60 kN and held by contact and friction alone.

# %%
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TotalForce,
    gallery,
    materials,
    minimize,
    pictures,
)
from fenics_contact.design import BundleTrust, ContactForces, LinearConstraints

# %% [markdown]
# The crowns may touch; the far crown of link 1 is held, that of link 2 pulled.

# %%
links = gallery.two_links(gallery.LinkShape(inner_radius=9.6, n_around=72, n_a=3, n_b=10))
steel = materials.IsotropicElasticity(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
crowns = Surface("link 2", "contact"), Surface("link 1", "contact")
scene = Scene(
    bodies={"link 1": Body(links.first.mesh, steel), "link 2": Body(links.second.mesh, steel)},
    supports=[Support("link 1", "grip")],
    loads=[TotalForce("link 2", "grip", (60e3, 0.0, 0.0))],  # N
    contacts=[ContactPair(*crowns, Coulomb(0.3), discretisation="node")],
)

# %% [markdown]
# ## Objective
#
# A function of the contact forces, with its derivatives by $\lambda_N$ and $\tau$. Of the maximum any
# derivative of a largest entry is a subgradient: 1 for that point, 0 for all others.

# %%
import numpy as np


def largest_force(contact):
    i = int(np.argmax(contact.normal_force))
    by_normal = np.zeros(contact.points.count)
    by_normal[i] = 1.0
    return float(contact.normal_force[i]), by_normal, np.zeros((contact.points.count, 2))


objective = ContactForces(largest_force)

# %% [markdown]
# ## Design and mesh motion
#
# A net of 5 × 3 control points lies on the crown. Control point $k$ moves the surface along its normals by
# $\alpha_k B_k(s, t)$, with Bernstein polynomials $B_k$. The inner nodes of the mesh follow
# smoothly, those of small cells most of all, and stay where they are farther away. Topology and
# partition stay, so that each new design is a small change of the one before.

# %%
from mpi4py import MPI

design = SurfaceDesign("link 1", links.first.crown, net=(5, 3))
problem = ShapeProblem(ContactProblem(scene, MPI.COMM_WORLD, tolerance=1e-8), design, objective)
print(f"{problem.size} design variables; the B_k sum up to one: {np.ptp(design.basis.sum(axis=1)):.1e} off")

# %% [markdown]
# What does a single control point do? Number 4 of 15 moves outwards by 0.3 mm:

# %%


def show(alpha, title):
    return pictures.plot_control_net(problem, alpha, title=title, width=1000)


show(0.3 * np.eye(15)[4], "One control point")

# %% [markdown]
# *Left the crown with its net of control points, right the crown moved (magnified). A Bernstein polynomial
# is broad: one control point moves a large part of the surface, by at most a part of its own movement.*
#
# The links have two planes of symmetry. We let the design keep them: six variables $\beta$ remain, and
# $\alpha = S \beta$ with a matrix of zeros and ones; subgradients go back by $S^T$.

# %%
number = np.arange(15).reshape(5, 3)
classes = np.minimum(number, number[::-1])  # mirrored along the ring
classes = np.minimum(classes, classes[:, ::-1])  # and across the wire
S = (classes.reshape(-1, 1) == np.unique(classes)).astype(float)


def J(beta):
    value, gradient = problem(S @ beta)
    return value, S.T @ gradient


print(S.shape, "from 6 variables to 15 control points")

# %% [markdown]
# ## State, adjoint, subgradient
#
# One call evaluates a design: mesh, state, adjoint, subgradient. The adjoint is *one* linear system with
# the transposed matrix of the state at its solution (who touches, who sticks, who slips is kept), whatever
# the number of variables. With the adjoint $w$ (newtons of $J$ a newton of load) the derivative by
# $\alpha_k$ is
# $\partial J / \partial \alpha_k + \langle w, \text{change of the equilibrium along } V_k \rangle$, where
# $V_k$ is the mesh motion of control point $k$ and UFL differentiates the forms.

# %%
start = np.zeros(6)
begin = problem.evaluate(S @ start)
first, state = S.T @ begin.gradient, begin.state
print(f"J = {begin.value:.1f} N, largest pressure {state.contact.pressure.max():.0f} N/mm²")
print("subgradient [N/mm]:", np.round(first, 1))
print(f"F-products: {state.solution.products} for the state, {begin.adjoint_iterations} for the adjoint")
assert np.linalg.norm(first) > 1e3  # a zero would pass every check below

# %% [markdown]
# ## Is it right?
#
# The acid test of every derivative: difference quotients. Along a direction $d$,
# $(J(\beta + h d) - J(\beta - h d)) / 2h$ must tend to $g \cdot d$ until rounding and the tolerance of the
# states take over. At a design with no symmetry of its own values:

# %%
rng = np.random.default_rng(1)
here, d = 0.05 * rng.standard_normal(6), rng.standard_normal(6)
slope = float(J(here)[1] @ d)
errors = []
for h in (1e-2, 1e-3, 1e-4):
    quotient = (problem.value_of(S @ (here + h * d)) - problem.value_of(S @ (here - h * d))) / (2 * h)
    errors.append(abs(quotient / slope - 1))
    print(f"h = {h:.0e} mm: quotient {quotient:.3f}, subgradient {slope:.3f} N/mm, {errors[-1]:.1e} apart")
assert abs(slope) > 100
assert min(errors) < 1e-4

# %% [markdown]
# ## Where it cannot be right
#
# At a kink there is no gradient, and a difference quotient depends on the side. The reference design has
# one. By symmetry two contact points carry the same largest force there, and a direction that breaks the
# symmetry raises one and lowers the other. Nodes on the symmetry planes, moreover, meet edges between
# facets, where the closest point on a faceted surface has a kink, too (`weak.edges` counts them).

# %%
skew, h = rng.standard_normal(15), 1e-3
forwards = (problem.value_of(h * skew) - begin.value) / h
backwards = (begin.value - problem.value_of(-h * skew)) / h
print(f"from ahead {forwards:.1f}, from behind {backwards:.1f}, subgradient {begin.gradient @ skew:.1f} N/mm")
print(f"two largest forces {np.sort(state.contact.normal_force)[-2:]} N, {begin.weak.edges} nodes on edges")
assert abs(forwards - backwards) > 10.0

# %% [markdown]
# The two one-sided slopes differ, however small $h$ is: that is the kink, not an error. What the adjoint
# returns there belongs to one branch. A *subgradient* is all that a bundle method asks for; a method for
# smooth functions, such as BFGS, could stop at such a place although it is no minimum. (Of several points
# on their switches one branch may give none: a `ShapeProblem` itself, handed to `minimize`, says so, and
# the method looks near such designs.)
#
# ## Cutting planes
#
# A bundle method keeps values and subgradients of all points it has seen. Each gives a plane (in one
# dimension a tangent), and their maximum is a model of $J$ that has kinks, too. Along the steepest descent
# from the start:

# %%

e = -first / np.linalg.norm(first)
steps = np.linspace(0.0, 0.6, 13)
along = [problem.value_of(S @ (t * e)) for t in steps]
tangents = {}
for t in (0.0, 0.2, 0.4):
    value, gradient = J(t * e)
    reach = np.array([max(0.0, t - 0.2), t + 0.2])
    tangents[f"plane from {t:g} mm"] = (reach, value + (gradient @ e) * (reach - t))
pictures.plot_curves(
    {"J": (steps, along)}, reference=tangents, connected=True, width=1000,
    xlabel="distance along −g (mm)", ylabel="largest contact force (N)", title="A walk downhill",
)  # fmt: skip

# %% [markdown]
# *The largest force falls, then another point takes over: a kink, and it rises steeply. Steepest descent
# would hop to and fro across the kink. The planes from both sides (dark) together know where it is.*
#
# ## The bundle method at work
#
# Each step minimises the maximum of all planes plus a term that keeps it near the best point so far, a
# small quadratic programme. If $J$ falls as the model promised, at least in part, the step is *serious* and
# becomes the new centre. If not, it is a *null step*: the centre stays, but the new plane has made the
# model better.

# %%

volume, by_alpha = problem.volume(np.zeros(15))
keep_volume = LinearConstraints(-(S.T @ by_alpha)[None], [0.0])


def report(record, best):
    promised = f", decrease promised {record.predicted_decrease:7.1f} N" if record.evaluations > 1 else ""
    print(f"{record.evaluations:3d} {record.kind.value:8s} J = {record.value:8.1f} N{promised}")


box = (np.full(6, -0.3), np.full(6, 0.3))  # mm
result = minimize(J, start, BundleTrust(tolerance=1e-3), bounds=box, constraints=keep_volume, callback=report)

# %% [markdown]
# It stops when the model can promise no further decrease:

# %%
drop = 1 - result.value / begin.value
change = problem.volume(S @ result.x)[0] / volume - 1
print(f"{result.reason.name.lower()}: {result.reason.value}")
print(f"largest force {begin.value:.0f} N -> {result.value:.0f} N, {100 * drop:.0f} % less")
print(f"volume changed by {100 * change:+.4f} %")
assert result.reason.success
assert drop > 0.25
assert change > -1e-4

# %% [markdown]
# The same as a picture:

# %%

words = {"label": "largest contact force (N)", "title": "Bundle method"}
pictures.plot_convergence(result.history, **words, logarithmic=True, width=1000)

# %% [markdown]
# *Serious steps on the line, null steps beside it. The first null step, too long, is far off (the scale is
# logarithmic); its plane keeps all later ones from going there again.*
#
# ## Before and after
#
# The pressure in the same colours:

# %%

peak = float(state.contact.pressure.max())
pictures.plot_contact_pressure(state, clim=(0.0, peak), reach=6.5, title="Before", width=1000)

# %% [markdown]
# *Before: most of the load in the middle.*

# %%
after = problem.state_of(S @ result.x)
lower = 1 - after.contact.pressure.max() / peak
print(f"largest pressure {100 * lower:.0f} % lower")
assert lower > 0.25
pictures.plot_contact_pressure(after, clim=(0.0, peak), reach=6.5, title="After", width=1000)

# %% [markdown]
# *After: the same load on a larger area, of a more even pressure. And the shape that does it:*

# %% tags=["cover"]
show(S @ result.x, "Optimised crown")

# %% [markdown]
# *The middle of the crown goes in, its sides come out: link 1 nestles to link 2, by less than a third of a
# millimetre. Many variables are at their bounds: there is more to gain, where more may be moved.*
#
# ## What to try next
#
# - All 15 variables without symmetry: more kinks, more null steps, and the result is symmetric only nearly.
# - `TotalPotential()` as objective, as in the published experiment (`make demo`).
# - A smooth relative of the maximum, $\left(\sum_i \lambda_{N,i}^8\right)^{1/8}$: fewer null steps.
# - `checkpoint=Checkpoint("run.npz")` in `minimize`: an interrupted run goes on where it was.
# - Next: [05 What accuracy costs](05_what_accuracy_costs.ipynb).
