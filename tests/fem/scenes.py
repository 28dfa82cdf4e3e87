"""Linear scenes, cuts of their bodies, and how far a state is from the monolithic answer."""

from __future__ import annotations

import numpy as np

from fenics_contact import Body, BodyForce, Scene, State, Support, Traction, box_partition
from fenics_contact.gallery import block
from fenics_contact.mesh import bisection_partition
from tests.fem import monolithic
from tests.feti.scenes import RUBBER, STEEL, skewed

#: Number of subdomains -> boxes of the 8 x 8 x 4 cells of the block.
BOXES = {2: (2, 1, 1), 4: (2, 2, 1), 8: (2, 2, 2), 16: (4, 2, 2), 32: (4, 4, 2)}
#: What "equal" means, relative to the largest displacement.
TOLERANCE = 1e-8

Partitions = dict[str, np.ndarray]


def loaded_block(cell: str, value: tuple[float | None, ...] = (0.0, 0.0, 0.0)) -> Scene:
    """A bent block held below, pulled on top and drawn aside by a body force."""
    mesh = skewed(block((0, 0, 0), (1.0, 1.2, 0.6), (8, 8, 4), cell))
    x, y, z = value
    return Scene(
        {"block": Body(mesh, STEEL)},
        supports=[Support("block", "z0", (x, y, z))],
        loads=[Traction("block", "z1", (0.3, 0.1, 1.0)), BodyForce("block", (0.0, 0.5, -2.0))],
    )


def cut(scene: Scene, subdomains: int) -> Partitions:
    return {"block": box_partition(scene.bodies["block"].mesh, BOXES[subdomains])}


def two_materials() -> tuple[Scene, Partitions]:
    """Rubber in tetrahedra beside steel in hexahedra, each held and loaded on its own; cut in 3 and 2."""
    soft = skewed(block((3, 0, 0), (4, 1, 2), (3, 3, 4), "tetrahedron"), 0.01)
    stiff = skewed(block((0, 0, 0), (1, 2, 1), (3, 4, 3)))
    scene = Scene(
        {"soft": Body(soft, RUBBER), "stiff": Body(stiff, STEEL)},
        supports=[
            Support("soft", "z0", (0.1, -0.2, 0.05)),
            Support("soft", "z1", (None, 0.3, None)),
            Support("stiff", "x0", (0.0, None, None)),
            Support("stiff", "z0", (None, 0.02, 0.0)),
        ],
        loads=[
            Traction("stiff", "z1", (0.0, 0.5, -1.0)),
            Traction("soft", "x1", (0.01, 0.0, 0.0)),
            BodyForce("stiff", (1.0, 0.0, 0.0)),
        ],
    )
    return scene, {"soft": bisection_partition(soft, 3), "stiff": box_partition(stiff, (1, 2, 1))}


def error(state: State, body: str, expected: np.ndarray | None = None) -> float:
    """Largest difference to the monolithic displacement, relative to its largest. Collective.

    Args:
        state: The state.
        body: Which of its bodies.
        expected: The monolithic displacement, where it is known already.
    """
    expected = monolithic.displacement(state.scene, body) if expected is None else expected
    size = np.abs(expected).max()
    assert size > 1e-3
    return float(np.abs(state.gather_displacement(body) - expected).max() / size)
