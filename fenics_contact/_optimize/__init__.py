"""Minimise a nonsmooth function, of which one subgradient at a point is known, over constraints."""
