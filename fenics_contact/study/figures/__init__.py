"""The figures of a study, of `Errors`, for files and notebooks.

They need matplotlib, an extra; only the report imports them.
"""

from fenics_contact.study.figures.accuracy import plot_accuracy
from fenics_contact.study.figures.convergence import plot_convergence
from fenics_contact.study.figures.parts import plot_parts
from fenics_contact.study.figures.phases import plot_phases

__all__ = ["plot_accuracy", "plot_convergence", "plot_parts", "plot_phases"]
