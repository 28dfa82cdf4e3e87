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
# # Inside TFETI
#
# ![Products over the number of subdomains](../docs/pictures/notebooks/06_inside_tfeti.png)
#
# How does the solver work? This notebook opens it on a case so small that every matrix can be looked at:
# torn subdomains, their rigid motions, the rows that glue them, the coarse space, the projector, the
# preconditioner, and at last contact. Each identity is checked by a number.
#
# TFETI stands for *total finite element tearing and interconnecting*: bodies are torn into subdomains, also
# from their supports, and forces between them (*multipliers*) put them together again. Then all subdomains
# float, all kernels are known in advance, and supports, gluing and contact are rows of one matrix $B$.
# Units: mm, N, N/mm².

# %% [markdown]
# ## A small scene
#
# In plane strain: a block on a block, pressed and pushed so hard that one edge lifts. The lower one is cut
# into three subdomains, the upper one into two times two.

# %%
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Scene,
    Status,
    Support,
    Surface,
    TotalForce,
    Traction,
    box_partition,
    feti,
    gallery,
    materials,
    pictures,
    qp,
    solve_scene,
)

# %%
steel = materials.PlaneStrain(young_modulus=2.1e5, poisson_ratio=0.3)  # N/mm²
lower = gallery.rectangle((0, 0), (60, 20), (24, 8))  # mm, cells
upper = gallery.rectangle((10, 20), (50, 40), (20, 10))
scene = Scene(
    bodies={"lower": Body(lower, steel), "upper": Body(upper, steel)},
    supports=[Support("lower", "y0", (0.0, 0.0))],
    loads=[TotalForce("upper", "y1", (450.0, -1000.0))],  # N a mm of thickness
    contacts=[ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(0.6), "node")],
)
partitions = {"lower": box_partition(lower, (3, 1)), "upper": box_partition(upper, (2, 2))}

# %% [markdown]
# The picture shrinks the subdomains a little, to show where they are torn.

# %%

pictures.plot_decomposition(scene, partitions, explode=0.12, width=800)

# %% [markdown]
# *Seven subdomains. A node on a cut has a copy in each of its subdomains.*
#
# ## Tearing
#
# The torn system holds each subdomain's own stiffness $K_s$ [N/mm], load $f_s$ [N], and kernel $R_s$: no
# assembly across a cut. On several processes each has its own subdomains.

# %%
from mpi4py import MPI

decomposition = feti.decompose(scene, partitions, MPI.COMM_WORLD)
torn = feti.build_torn_system(scene, decomposition)
whole = sum(body.mesh.points.size for body in scene.bodies.values())
print(f"{whole} displacements before tearing, {decomposition.torn_unknowns} after")
print(f"rows of B: {torn.n_equality} for gluing and supports, {torn.points.count} normal, as many tangential")

# %% [markdown]
# ## Kernels
#
# A subdomain that nothing holds moves freely: $K_s R_s = 0$ with three rigid motions in the plane (six in
# space). Three eigenvalues of $K_s$ are zero up to rounding, the fourth is not.

# %%
import numpy as np

part = torn.subdomains[4]
K_s, R_s = part.stiffness, part.kernel
energies = np.linalg.eigvalsh(K_s.toarray())
print("smallest eigenvalues relative to the largest:", energies[:4] / energies[-1])
print(f"‖K R‖ / ‖K‖ = {np.abs(K_s @ R_s).max() / np.abs(K_s).max():.1e}")
assert np.linalg.matrix_rank(R_s) == 3
assert np.abs(K_s @ R_s).max() < 1e-12 * np.abs(K_s).max()
assert energies[3] > 1e-4 * energies[-1]

# %% [markdown]
# The three motions of that subdomain, drawn with its cells: dashed at rest, moved in blue.

# %%
import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

names = "translation in x", "translation in y", "rotation"
figure, panels = plt.subplots(1, 3, figsize=(10, 3.2), sharex=True, sharey=True, layout="constrained")
for axes, motion, name in zip(panels, R_s.T, names, strict=True):
    moved = upper.points.copy()
    moved[part.mesh.nodes] += 2.0 * motion.reshape(-1, 2)
    for points, colour, style in ((upper.points, "0.6", "--"), (moved, "tab:blue", "-")):
        cells = PolyCollection(points[upper.cells[part.mesh.cells]], fc="none", ec=colour, ls=style)
        axes.add_collection(cells)
    axes.set(title=name, aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    axes.autoscale_view()

# %% [markdown]
# *The kernel of one subdomain of the upper body: none of these motions costs energy. What the subdomain
# does is known up to them; the multipliers have to settle the rest.*
#
# ## Gluing
#
# A row of $B$ says that a component of the displacement must not jump: $B_E u = c$. A node with $m$ copies
# needs $m - 1$ rows. Where four subdomains meet these are three. They are made orthonormal: each weighs the
# mean of some copies against the next one.

# %%
B = torn.B.tocsr()
tearing, gluing = decomposition.tearing, decomposition.gluing
(cross,) = np.flatnonzero(tearing.multiplicity == 4)
rows = np.flatnonzero(gluing.dof == 2 * cross)  # those of its x component
block = B[rows][:, np.unique(B[rows].indices)].toarray()
print("rows of the node where four subdomains meet, a column a copy:")
print(np.round(block, 3) + 0.0)
B_E = B[: torn.n_gluing]
print(f"largest entry of B_E B_Eᵀ − I: {np.abs((B_E @ B_E.T).toarray() - np.eye(torn.n_gluing)).max():.1e}")
assert np.allclose((B_E @ B_E.T).toarray(), np.eye(torn.n_gluing), atol=1e-12)

# %% [markdown]
# ## The dual problem
#
# Equilibrium of the torn subdomains is $K u = f - B^T \lambda$. It can be solved for $u$ if the forces on
# each subdomain balance, $R^T (f - B^T \lambda) = 0$, and then up to rigid motions:
# $u = K^+ (f - B^T \lambda) + R \alpha$. With
#
# $$ F = B K^+ B^T\ [\mathrm{mm/N}], \qquad G = R^T B^T, \qquad e = R^T f\ [\mathrm{N}], \qquad
#    d = B K^+ f - c\ [\mathrm{mm}] $$
#
# what remains is a problem for the multipliers $\lambda$ [N] alone: minimise
# $\tfrac12 \lambda^T F \lambda - \lambda^T d$ under $G \lambda = e$.

# %%
import scipy.sparse as sp

dual = feti.DualSystem(torn)
K = sp.block_diag([part.stiffness for part in torn.subdomains], format="csr")
R, G = dual.kernel.tocsr(), dual.problem.coarse.matrix.toarray()
force = K @ np.random.default_rng(1).standard_normal(K.shape[0])  # some force in equilibrium, K v
left_over = np.linalg.norm(K @ dual.inverse(force) - force) / np.linalg.norm(force)
print(f"‖K K⁺ K v − K v‖ / ‖K v‖ = {left_over:.1e}, ‖K R‖ / ‖K‖ = {abs(K @ R).max() / abs(K).max():.1e}")
print(f"G has {G.shape[0]} rows, three a subdomain, and rank {np.linalg.matrix_rank(G)}")
assert left_over < 1e-12
assert np.allclose(G, (B @ R).T.toarray(), atol=1e-12)
assert np.linalg.matrix_rank(G) == 21

# %% [markdown]
# ## The natural coarse space
#
# $G$ has a row for each rigid motion: a tiny problem, and the only place where every subdomain hears of
# every other in one step. Which of them meet shows in $G G^T$. The projector $P = I - G^T (G G^T)^{-1} G$
# takes the unbalanced part out of any multiplier.

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", width_ratios=(1.9, 1))
left.spy(B, markersize=1.2, aspect="auto")
left.set(title="B: gluing and supports, then contact", xlabel="torn displacement", ylabel="row")
left.axhline(torn.n_equality - 0.5, color="tab:orange")
size = np.abs(G @ G.T)
right.imshow(np.log10(np.where(size > 1e-12, size, np.nan)), cmap="viridis")
ticks = range(0, 21, 3)  # the first motion of each subdomain
_ = right.set(title="G Gᵀ", xlabel="rigid motion", ylabel="rigid motion", xticks=ticks, yticks=ticks)

# %% [markdown]
# *Left B, below the orange line the rows of contact, which couple the two bodies. Right the small matrix of
# the coarse problem, three rows and columns a subdomain; white where subdomains do not touch. Motion 0–2
# and 9–11 stand for the bodies as wholes: gluing does not depend on them, only supports and contact do.*
#
# The properties of the projector, with dense matrices made column by column:

# %%
unit = np.eye(B.shape[0])
F, P = (np.array([apply(column) for column in unit]).T for apply in (dual.apply, dual.problem.coarse.project))
M = np.array([dual.problem.preconditioner(column) for column in unit]).T
for name, size in {"P P − P": P @ P - P, "P − Pᵀ": P - P.T, "P Gᵀ": P @ G.T}.items():
    print(f"largest entry of {name:8s} {np.abs(size).max():.1e}")
    assert np.abs(size).max() < 1e-12
print(f"P leaves {round(np.trace(P))} of {len(P)} dimensions: {len(P)} − {len(G)}")
assert round(np.trace(P)) == len(P) - len(G)
assert np.abs(F - F.T).max() < 1e-12 * np.abs(F).max()
assert np.linalg.eigvalsh(F)[0] > -1e-12 * np.abs(F).max()

# %% [markdown]
# ## Conditioning
#
# Conjugate gradients need about $\sqrt\kappa$ steps, where $\kappa$ is the largest eigenvalue over the
# smallest. The Dirichlet preconditioner $M$ approximates $F^{-1}$ by the stiffness that each subdomain
# shows at its boundary. Here are the eigenvalues on the range of $P$, where the iteration lives:

# %%


def spectrum(A):
    values = np.sort(np.linalg.eigvals(A).real)[len(G) :]  # zeros belong to the range of Gᵀ
    return values / values[0]


spectra = {"P F P": spectrum(P @ F @ P), "P M P F P": spectrum(P @ M @ P @ F @ P)}
for name, values in spectra.items():
    print(f"condition number of {name:10s} {values[-1]:6.1f}")
curves = {name: (np.arange(1, len(values) + 1), values) for name, values in spectra.items()}
labels = {"xlabel": "number of the eigenvalue", "ylabel": "eigenvalue / smallest"}
assert spectra["P M P F P"][-1] < 0.3 * spectra["P F P"][-1]
pictures.plot_curves(curves, **labels, logarithmic=True, title="What conjugate gradients see", width=900)

# %% [markdown]
# *With the preconditioner nearly all eigenvalues are one.*
#
# ## What scaling means
#
# Now without contact, and larger: a square plate of $n \times n$ subdomains, each with 4 × 4 cells, held on
# its left edge and loaded on its right one. More subdomains of the same size: a larger problem on more
# processes. Count the products with $F$, where all the work is.

# %%
from dataclasses import replace


def products(material, n, cells=4, preconditioned=True):
    mesh = gallery.rectangle((0, 0), (10.0 * n, 10.0 * n), (cells * n, cells * n))
    supports, loads = [Support("plate", "x0", (0.0, 0.0))], [Traction("plate", "x1", (0.0, -1.0))]
    plate = Scene({"plate": Body(mesh, material)}, supports, loads)
    cut = {"plate": box_partition(mesh, (n, n))}
    problem = feti.DualSystem(
        feti.build_torn_system(plate, feti.decompose(plate, cut, MPI.COMM_WORLD))
    ).problem
    problem = problem if preconditioned else replace(problem, preconditioner=None)
    return qp.solve(problem, None, qp.ProjectedCG(tolerance=1e-8)).products


# %% [markdown]
# What would it be without the coarse space? A subdomain without kernel has none: we lay the material on a
# very soft elastic bed, as the pile of [notebook 03](03_your_own_ufl_model.ipynb). The solution hardly
# changes, but nothing floats any more, and $G$ is empty.

# %%
import ufl


class Bedded(materials.PlaneStrain):
    def stiffness(self, u, v, parameters):
        return super().stiffness(u, v, parameters) + 1e-2 * ufl.inner(u, v)  # N/mm⁴

    def kernel(self, points):
        return np.zeros((*points.shape, 0))


# %% [markdown]
# All three for 4 to 144 subdomains:

# %% tags=["cover"]
counts = np.array([2, 3, 4, 6, 8, 12])
needed = {
    "coarse space and preconditioner": [products(steel, n) for n in counts],
    "coarse space only": [products(steel, n, preconditioned=False) for n in counts],
    "preconditioner only": [products(Bedded(2.1e5, 0.3), n) for n in counts],
}
for name, found in needed.items():
    print(f"{name:32s}", *(f"{number:5d}" for number in found))
assert max(needed["coarse space and preconditioner"]) < 20
assert needed["preconditioner only"][-1] > 5 * needed["coarse space and preconditioner"][-1]
labels = {"xlabel": "subdomains", "ylabel": "products with F", "title": "More subdomains of one size"}
curves = {name: (counts**2, found) for name, found in needed.items()}
pictures.plot_curves(curves, **labels, connected=True, logarithmic=True, width=1000)

# %% [markdown]
# *With the coarse space the number of products is bounded, whatever the number of subdomains is: this is
# what makes the method scale. Without it, news passes from one subdomain to its neighbours in each step,
# and the number of products grows with the number of subdomains in a row, even faster than it.*
#
# The other question is how large a subdomain may be, $H/h$ cells along its side. Theory promises
# $\kappa \le C\, H/h$ with the coarse space alone (Farhat, Mandel and Roux 1994), and with the
# preconditioner no more than a power of a logarithm, $\kappa \le C\, (1 + \log (H/h))^3$ (Mandel and Tezaur
# 1996).

# %%
cells = np.array([2, 4, 8, 16, 32])
larger = {
    "preconditioned": [products(steel, 4, cells=n) for n in cells],
    "not preconditioned": [products(steel, 4, cells=n, preconditioned=False) for n in cells],
}
for name, found in larger.items():
    print(f"{name:20s}", *(f"{number:5d}" for number in found))
assert larger["preconditioned"][-1] < 2.5 * larger["preconditioned"][0]
assert larger["not preconditioned"][-1] > 2.5 * larger["preconditioned"][-1]
curves = {name: (cells, found) for name, found in larger.items()}
labels = {"xlabel": "cells along a subdomain, H/h", "ylabel": "products with F", "title": "Larger subdomains"}
pictures.plot_curves(curves, **labels, connected=True, width=900)

# %% [markdown]
# *From 2 to 32 cells a side the preconditioned iteration needs twice as many products, on a mesh with 256
# times as many cells.*
#
# ## Contact rows and the active set
#
# Back to the two blocks. Rows of contact are inequalities: $\lambda_N \ge 0$ [N] and
# $|\tau| \le \mu \lambda_N$. Each Newton step guesses the *face*: which points are closed, which of them
# stick or slip. On a face the problem is linear and solved as above, and its solution says what was wrong
# with the guess.

# %%

state = solve_scene(scene, MPI.COMM_WORLD, partitions=partitions, tolerance=1e-10)
print("step  products  closed  stick  slip  residual")
for step in state.solution.history:
    counts = f"{step.products:9d} {step.closed:7d} {step.stick:6d} {step.slip:5d}"
    print(f"{step.iteration:4d} {counts}   {step.residuals.natural:.1e}")
assert step.stick == state.contact.count(Status.STICK) > 0
assert step.slip == state.contact.count(Status.SLIP) > 0
assert state.contact.count(Status.OPEN) > 0

# %% [markdown]
# The first steps find the face; once it no longer changes, the residual drops as fast as one likes. The
# answer as a picture:

# %%

pictures.plot_contact_pressure(state, width=900)

# %% [markdown]
# *Above the pressure, zero where the block has lifted; below the friction traction between its bounds ± μ
# p.*
#
# ## The way back, and the check of checks
#
# From $\lambda$ follows the residual of all rows, from that $\alpha$, and $u$. Then everything must fit:
# the torn subdomains are in equilibrium, copies agree, contact is complementary, and, as in any convex
# problem, primal and dual energy are the same: with the slip bounds of the solution,
# $\tfrac12 u^T K u - f^T u + \sum \mu \lambda_N |s| = -\tfrac12 \lambda^T F \lambda + \dots$ [N mm].

# %%
u, lam, contact = state.torn_displacement, state.solution.multiplier, state.contact
load, norm = torn.load, np.linalg.norm
checks = {
    "equilibrium, ‖K u − f + Bᵀλ‖ / ‖f‖": norm(K @ u - load + B.T @ lam) / norm(load),
    "balance, ‖G λ − e‖ / ‖e‖": norm(G @ lam - R.T @ load) / norm(R.T @ load),
    "largest jump between copies / displacement": abs(B_E @ u).max() / abs(u).max(),
    "|Σ force × gap| / energy": abs(contact.normal_force @ contact.gap) / state.energies.strain,
    "gap between primal and dual energy": abs(state.energies.primal / state.energies.dual - 1),
}
for name, size in checks.items():
    print(f"{name:44s} {size:.1e}")
    assert size < 1e-8
print(f"energy {state.energies.primal:.6f} N mm")

# %% [markdown]
# ## What to try next
#
# - `LocalKind.EXPLICIT` in `DualSystem(torn, kind=...)`: the dense matrices $B_s K_s^+ B_s^T$, faster for
#   small subdomains; every number above stays.
# - A stiff body on a soft one (`PlaneStrain(2.1e3, 0.3)`): the preconditioner weighs copies by their
#   stiffness.
# - `benchmarks/`: the same counts with contact in space, with times and memory.
#
# ## References
#
# - C. Farhat, J. Mandel and F.-X. Roux, Optimal convergence properties of the FETI domain decomposition
#   method, Comput. Methods Appl. Mech. Eng. 115 (1994) 365–385.
# - J. Mandel and R. Tezaur, Convergence of a substructuring method with Lagrange multipliers, Numer. Math.
#   73 (1996) 473–487.
# - Z. Dostál, D. Horák and R. Kučera, Total FETI: an easier implementable variant of the FETI method for
#   numerical solution of elliptic PDE, Commun. Numer. Methods Eng. 22 (2006) 1155–1162.
# - T. Brzobohatý, Z. Dostál, T. Kozubek, P. Kovář and A. Markopoulos, Cholesky decomposition with fixing
#   nodes to stable computation of a generalized inverse of the stiffness matrix of a floating structure,
#   Int. J. Numer. Methods Eng. 88 (2011) 493–509.
