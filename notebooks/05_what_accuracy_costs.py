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
# # What accuracy costs in time
#
# ![Error against time](../docs/pictures/notebooks/05_what_accuracy_costs.png)
#
# How fine must the mesh be, how strict the tolerance, for 1 % in the peak pressure? A *study* answers from
# measurements: it solves one scene with many settings, each in a process of its own, and compares what it
# finds with theory or, where there is none, with what the meshes converge to. This notebook reads studies
# that were stored with the project, shows how to read their figures, and runs a small one.
#
# On the command line the same is `fenics-contact accuracy hertz`, and `make studies` for all. Units: mm, N,
# N/mm²; times are wall times in seconds.

# %% [markdown]
# ## A stored study
#
# Hertz's problem: two round bodies pressed together, of which theory knows force, radius of contact and
# largest pressure, $p_0 = 3F / (2 \pi a^2)$ [N/mm²].

# %%
from pathlib import Path

from fenics_contact import study

above = (Path.cwd(), *Path.cwd().parents)
folder = next(path / "docs" / "studies" for path in above if (path / "docs" / "studies").is_dir())
hertz = study.read_study(folder / "hertz")
errors = study.Errors(hertz)
print(f"{hertz.scene.title}: {len(hertz.good)} runs on {hertz.ranks} rank(s)")

# %% [markdown]
# ## Error against time
#
# The figures need nothing but the stored numbers:

# %% tags=["cover"]

study.figures.plot_accuracy(errors)

# %% [markdown]
# *Each symbol is a run: further left is faster, further down is better. Along a line only the mesh becomes
# finer. The rings mark the Pareto front: every other run is beaten by one of them in time and in accuracy.*
#
# Two questions to ask of such a figure:
#
# 1. *Do two lines lie on each other?* Then the setting in which they differ buys nothing. A tolerance far
#    below the error of the mesh is of this kind.
# 2. *Does a line stop falling?* Then something else than the mesh limits it. Contact by nodes on meshes
#   that
#    do not match is of this kind: its forces cannot represent an even pressure, however fine the mesh is.
#
# The numbers behind the figure:

# %%
base = hertz.base
for parameters in (errors.strictest(base), base):
    name = "balanced" if parameters.balanced else f"{parameters.tolerance:g}"
    print(f"tolerance {name}: cells on the radius, seconds, error of the peak pressure")
    for run in errors.sequence(parameters):
        print(f"  {run.parameters.size:3d} {run.seconds:8.2f} {errors.of(run, 'peak pressure'):9.2%}")

# %% [markdown]
# ## Convergence
#
# Theory gives a slope, $\text{error} \sim h^p$: $p = 1$ for linear elements in energy norm, $p = 2$ for the
# energy itself. Where a singularity is in the way, at the end of a clamped edge for instance, $p$ is
# smaller, and the studies say so.

# %%
study.figures.plot_convergence(errors)

# %% [markdown]
# *The errors over the size of the cells, with measured slopes. The peak pressure is one number at one point
# and need not converge monotonically: where a study cannot extrapolate, it says why.*
#
# The rates as numbers:

# %%
for quantity in hertz.scene.quantities:
    reference = errors.references[quantity.name]
    rate = errors.rate(errors.strictest(base), quantity.name)
    found = "none" if rate is None else f"{rate:.2f}"
    theory = "-" if quantity.rate is None else f"{quantity.rate:g}"
    print(f"{quantity.name:16s} against {reference.kind:13s} rate {found:5s} theory {theory}", reference.note)

# %% [markdown]
# ## What the error consists of
#
# `state.estimate_errors()` has relative errors in energy norm: `algebraic` is a certificate, an upper
# bound of what the solver left at the slip bounds of the state; `friction` estimates what is missing to
# Coulomb's law, `discretisation` what
# the mesh cannot represent. By default the solver stops as soon as its part is a tenth of that of the
# mesh. A case with friction, the cylinders of Cattaneo and Mindlin:

# %%
study.figures.plot_parts(study.Errors(study.read_study(folder / "cattaneo_mindlin")))

# %% [markdown]
# *Above the parts, below their shares; left over the mesh with the balanced tolerance, right over the
# tolerance. The crosses are true errors, against a solution with a residual of $10^{-11}$ on the same
# mesh.*
#
# No certificate may lie below its cross. In Hertz's study:

# %%
ratios = [
    run.parts["algebraic"] / run.true_errors["algebraic"]
    for run in hertz.good
    if run.parts["algebraic"] and run.true_errors
]
print(f"certificate over true error: {min(ratios):.2f} to {max(ratios):.2f} in {len(ratios)} runs")
assert min(ratios) >= 1.0 - 1e-2  # the exact solution is known to some digits only

# %% [markdown]
# ## Answers
#
# What an accuracy takes: the fastest run that reaches it. A run counts only if all runs that are finer and
# stricter reach the accuracy, too: an error that passes through zero is no merit.

# %%

print(study.accuracy_table(errors, targets=(0.05, 0.01)))

# %% [markdown]
# What a setting costs, compared with a run that differs in this setting alone, on the finest mesh that both
# have. Ratios above one are dearer:

# %%
for line in study.cost_table(errors).splitlines():
    print("|".join(line.split("|")[:9]))

# %% [markdown]
# ## A study of one's own
#
# A scene is a function from settings to a `Problem`, with quantities to measure and what theory knows of
# them. Every run has a process of its own, which reads the scene from a file. Here a plate with pressure on
# its upper edge is pressed on a rigid floor; it becomes shorter by $p L (1 - \nu^2) / E$ [mm] where its
# sides are guided in plane stress, exactly, on every mesh.

# %%
BUILD = """
from fenics_contact import (
    Body, ContactPair, RigidPlane, Scene, Support, Surface, Traction, gallery, materials
)
from fenics_contact.study import BALANCED, Parameters, Problem, Quantity, StudyScene, Sweep


def build(parameters, comm):
    mesh = gallery.rectangle((0.0, 0.0), (1.0, 1.0), (parameters.size, parameters.size), parameters.cell)
    sides = [Support("plate", side, (0.0, None)) for side in ("x0", "x1")]
    floor = ContactPair(Surface("plate", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)))
    load = Traction("plate", "y1", (0.0, -10.0))  # N/mm²
    return Problem(Scene({"plate": Body(mesh, materials.PlaneStress(1000.0, 0.3))}, sides, [load], [floor]))
"""

# %% [markdown]
# What is measured, with its exact value, and which settings are tried:

# %%
STUDY = """
def shortening(outcome):
    return -float(outcome.state.gather_displacement("plate")[:, 1].min())

exact = 10.0 * (1 - 0.3**2) / 1000.0  # mm
sweep = Sweep(Parameters(4, "quadrilateral"), sizes=(2, 4, 8), tolerances=(1e-8, BALANCED))
study = StudyScene(
    "plate", "A plate on a floor", build, (Quantity("shortening", "mm", shortening, exact),), sweep, sweep
)
"""

# %% [markdown]
# Six runs in six processes, each once:

# %%
output = Path("output/notebooks/plate")
output.mkdir(parents=True, exist_ok=True)
(output / "plate.py").write_text(BUILD + STUDY)
plate = study.run_study(str(output / "plate.py"), output / "runs", settings=study.Settings(repeats=1))
print(study.write_report(output, plate).split("\n\n")[1])

# %% [markdown]
# The mesh represents this solution exactly: only the tolerance is left to err.

# %%
worst = max(
    study.Errors(plate).of(run, "shortening") for run in plate.good if run.parameters.tolerance == 1e-8
)
print(f"largest error at a tolerance of 1e-8: {worst:.1e}")
assert len(plate.good) == len(plate.runs) == 6
assert worst < 1e-6

# %% [markdown]
# ## What to try next
#
# - `fenics-contact accuracy hertz --quick`, about a minute; `--ranks 2` on two ranks.
# - `--sizes 4 8 --tolerances 1e-3 1e-6 balanced` for one question only.
# - Stop a study with Ctrl-C and start it again: what was measured is not measured twice.
# - Next: [06 Inside TFETI](06_inside_tfeti.ipynb).
