"""The bodies of Hertz, graded towards the contact.

A box of cells in the middle (the core) is surrounded on its round sides by a shell whose layers end on the
true sphere or cylinder. Cells are well shaped everywhere, also on the rim, unlike in a single box mapped to a
ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import check_count, check_grading, check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.blocks import box_lattice, box_sides, graded, require_room
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.shapes.simple import Circle, Cylinder, Sphere, SurfaceShape

CORE = 0.5
"""Size of the core over the radius."""


@dataclass(frozen=True)
class RoundFrame:
    """Cube coordinates (u, v, w) of a round body.

    `flat`: directions along which the body is straight: (1,) for a cylinder along y, () for a ball.
    """

    radius: float
    flat: tuple[int, ...]
    dim: int = 3

    @property
    def shape(self) -> SurfaceShape:
        """The round surface, lifted by the radius."""
        centre = (0.0, 0.0, self.radius)
        return Cylinder(centre, (0.0, 1.0, 0.0), self.radius) if self.flat else Sphere(centre, self.radius)

    def sphere(self, cube: np.ndarray) -> np.ndarray:
        """Map cube coordinates, (n, dim), to the round surface: angles, not lengths, follow them."""
        reach = self._reach(cube)
        bent = cube.copy()
        bent[:, self.flat] = 0.0
        rays = np.tan(np.pi / 4.0 * bent / np.maximum(reach, np.finfo(float).tiny))
        length = np.linalg.norm(rays, axis=1, keepdims=True)
        length[length == 0.0] = 1.0  # the centre of the body, which has no direction
        return self._straight(cube, self.radius * rays / length)

    def core(self, cube: np.ndarray) -> np.ndarray:
        """Map cube coordinates to the core, half way between a cube and a ball of its size."""
        square = self._straight(cube, self.radius * cube)
        ball = self._straight(cube, self._reach(cube) * self.sphere(cube))
        return self._straight(cube, CORE * 0.5 * (square + ball))

    def _reach(self, cube: np.ndarray) -> np.ndarray:
        round_ = [d for d in range(self.dim) if d not in self.flat]
        return np.asarray(np.abs(cube[:, round_]).max(axis=1, keepdims=True))

    def _straight(self, cube: np.ndarray, points: np.ndarray) -> np.ndarray:
        points = points.copy()
        points[:, self.flat] = cube[:, self.flat]
        return points


def hemisphere(radius: float, n: int, *, symmetry: str = "xy", grading: float = 3.0) -> BodyMesh:
    """Mesh the lower half of a ball on the plane z = 0; surfaces contact, side, top and the cuts x0, y0.

    Doubling ``n`` halves every cell in the body's own coordinates, so that errors fall at clean rates.

    Args:
        radius: Radius, [length]; the flat top lies at z = radius.
        n: Cells from the pole to the edge of the contact surface, and through the shell.
        symmetry: Planes of symmetry the body is cut at: "xy" keeps x >= 0 and y >= 0, "x" keeps x >= 0, ""
            keeps all.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the pole; 0 for
            uniform.

    Returns:
        Hexahedra with surfaces "contact" (the ball around the pole, up to 45 degrees in x and y), "side" (the
        rest of it), "top", and "x0", "y0" on the planes of symmetry. No grid.

    Raises:
        InvalidInputError: If the radius, a count, the grading or the symmetry cannot be used.
    """
    _check(radius, n, grading, symmetry, ("xy", "x", ""))
    ticks = [_lateral(n, grading, "x" in symmetry), _lateral(n, grading, "y" in symmetry)]
    core = box_lattice([*ticks, np.linspace(-1.0, 0.0, (n + 1) // 2 + 1)])
    round_sides = {"z0", "x1", "y1"} | ({"x0", "y0"} - {f"{d}0" for d in symmetry})
    return _wrap(core, sorted(round_sides), RoundFrame(radius, ()), n, grading)


def half_cylinder(
    radius: float, length: float, n: int, n_length: int = 1, *, symmetry: str = "x", grading: float = 3.0
) -> BodyMesh:
    """Mesh the lower half of a cylinder along y on the plane z = 0; surfaces contact, side, top, y0, y1, x0.

    Args:
        radius: Radius, [length]; the flat top lies at z = radius.
        length: The body reaches from y = 0 to y = length, [length].
        n: Cells from the line of contact to the edge of the contact surface, and through the shell.
        n_length: Cells along the axis.
        symmetry: "x" keeps x >= 0, "" keeps all.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the line of contact;
            0 for uniform.

    Returns:
        Hexahedra with surfaces "contact" (the cylinder up to 45 degrees from the line of contact), "side"
        (the rest of it), "top", the ends "y0" and "y1", and "x0" on the plane of symmetry. No grid.

    Raises:
        InvalidInputError: If the radius, the length, a count, the grading or the symmetry cannot be used.
    """
    _check(radius, n, grading, symmetry, ("x", ""))
    check_count(n_length, "n_length")
    check_numbers(length=length)
    if length <= 0.0:
        raise InvalidInputError(f"length must be positive, got {length}: give the size along the axis")
    along = np.linspace(0.0, length, n_length + 1)
    upwards = np.linspace(-1.0, 0.0, (n + 1) // 2 + 1)
    core = box_lattice([_lateral(n, grading, "x" in symmetry), along, upwards])
    round_sides = ["x1", "z0"] if symmetry else ["x0", "x1", "z0"]
    return _wrap(core, round_sides, RoundFrame(radius, (1,)), n, grading)


def _wrap(core: BodyMesh, round_sides: list[str], frame: RoundFrame, layers: int, grading: float) -> BodyMesh:
    """Map a box in cube coordinates to the core and add the shell on its round sides."""
    facets = np.concatenate([core.surfaces[side] for side in round_sides])
    require_room(layers, len(facets), 1)
    below = np.concatenate([np.full(core.surfaces[side].shape[0], side == "z0") for side in round_sides])
    skin, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    inner, outer = frame.core(core.points), frame.sphere(core.points[skin])
    share = 1.0 - graded(layers, grading)[-2::-1, None, None]  # thinnest layers outside; 1 on the surface
    shell = (1.0 - share) * inner[skin] + share * outer
    points = np.concatenate([inner, shell.reshape(-1, 3)])
    rows = np.vstack([skin, core.n_nodes + np.arange(layers * skin.size).reshape(layers, skin.size)])
    stacked = np.concatenate([rows[:-1, local], rows[1:, local]], axis=-1).reshape(-1, 8)
    cells = np.concatenate([core.cells, stacked])
    curved = rows[-1][local]
    surfaces = {"contact": curved[below], "side": curved[~below], **_flat_sides(points, cells, curved)}
    shape = frame.shape
    return BodyMesh(
        points + np.array([0.0, 0.0, frame.radius]), cells, surfaces, shapes={"contact": shape, "side": shape}
    )


def _flat_sides(points: np.ndarray, cells: np.ndarray, curved: np.ndarray) -> dict[str, np.ndarray]:
    """Name the boundary faces that are not curved by the direction they face, the upper one "top"."""
    on_curve = np.zeros(points.shape[0], dtype=bool)
    on_curve[curved] = True
    sides = {side: facets[~on_curve[facets].all(axis=1)] for side, facets in box_sides(points, cells).items()}
    sides["top"] = sides.pop("z1")
    return {side: facets for side, facets in sides.items() if facets.shape[0]}


def _lateral(n: int, grading: float, symmetric: bool) -> np.ndarray:
    return graded(n, grading) if symmetric else mirrored_ticks(n, grading)


def mirrored_ticks(n: int, grading: float) -> np.ndarray:
    """Divide [−1, 1] into 2 n intervals that grow from the middle to both ends."""
    ticks = graded(n, grading)
    return np.concatenate([-ticks[:0:-1], ticks])


def _check(radius: float, n: int, grading: float, symmetry: str, known: tuple[str, ...]) -> None:
    check_count(n, "n", 2)
    check_numbers(radius=radius)
    check_grading(grading)
    if not 0.0 < radius < np.inf:
        raise InvalidInputError(f"radius must be positive, got {radius}: give the radius of the body")
    if not isinstance(symmetry, str) or symmetry not in known:
        raise InvalidInputError(f"symmetry must be one of {known}, got {symmetry!r}: name the planes")


def half_disc(radius: float, n: int, *, symmetry: str = "x", grading: float = 3.0) -> BodyMesh:
    """Mesh the lower half of a disc on the line y = 0; surfaces contact, side, top and the cut x0.

    It is the end of a `half_cylinder`, which has the same cells.

    Args:
        radius: Radius, [length]; the flat top lies at y = radius.
        n: Cells from the point of contact to the edge of the contact surface, and through the shell.
        symmetry: "x" keeps x >= 0, "" keeps all.
        grading: Logarithm of the ratio of the largest to the smallest cell on the way to the point of
            contact; 0 for uniform.

    Returns:
        Quadrilaterals with surfaces "contact" (the arc up to 45 degrees from the point of contact), "side"
        (the rest of it), "top", and "x0" on the plane of symmetry. No grid.

    Raises:
        InvalidInputError: If the radius, a count, the grading or the symmetry cannot be used.
    """
    solid = half_cylinder(radius, radius, n, symmetry=symmetry, grading=grading)
    nodes, local = np.unique(solid.surfaces["y0"], return_inverse=True)
    cells = local.reshape(-1, 4)  # their outward normal, -y, makes x and z a right-handed pair
    edges, _ = boundary_faces(cells, dim=2)
    surfaces = {}
    for name in ("contact", "side", "top", "x0"):
        if name in solid.surfaces:
            inside = np.isin(nodes, solid.surfaces[name])
            surfaces[name] = edges[inside[edges].all(axis=1)]
    disc = Circle((0.0, radius), radius)
    shapes = {name: disc for name in ("contact", "side")}
    return BodyMesh(solid.points[nodes][:, [0, 2]], cells, surfaces, shapes=shapes)
