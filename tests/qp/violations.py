"""Violations of the law of friction, written out point by point."""

from __future__ import annotations

import numpy as np


def coulomb_violations(layout, lam, r, friction_coefficient):
    """Violations of the law, written out point by point: gap, force, complementarity, disc, direction."""
    normal, gap = lam[layout.tangential_frictional], r[layout.tangential_frictional]
    tau, slip = lam[layout.tangential], -r[layout.tangential]
    bound, speed = friction_coefficient * normal, np.linalg.norm(slip, axis=1)
    return {
        "penetration": max(-gap.min(), 0.0) / np.abs(gap).max(),
        "tension": max(-normal.min(), 0.0) / normal.max(),
        "complementarity": np.abs(gap * normal).max() / (np.abs(gap).max() * normal.max()),
        "disc": max((np.linalg.norm(tau, axis=1) - bound).max(), 0.0) / normal.max(),
        "dissipation": np.abs(np.einsum("ia,ia->i", tau, slip) - bound * speed).max()
        / (normal.max() * speed.max()),
    }
