"""Solvers for the dual problem of contact: quadratic, with equilibrium, bounds and friction discs."""
