"""Materials of a deck."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from fenics_contact.decks.vocabulary import MATERIAL_CARDS, WITHOUT_EFFECT
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.anisotropic import AnisotropicElasticity
from fenics_contact.materials.elastic import IsotropicElasticity, Material, PlaneStrain, PlaneStress
from fenics_contact.materials.foam import Hyperfoam
from fenics_contact.materials.hardening import Points
from fenics_contact.materials.hyperelastic import MooneyRivlin, Ogden, StVenantKirchhoff
from fenics_contact.materials.neo_hookean_metal import NeoHookeanPlasticity
from fenics_contact.materials.orthotropic import OrthotropicElasticity, OrthotropicPlaneStress, material_axes
from fenics_contact.materials.plastic import J2Plasticity
from fenics_contact.materials.ramberg_osgood import RambergOsgood
from fenics_contact.materials.temperature_dependent import ByTemperature, TemperatureDependentElasticity
from fenics_contact.readers.deck_cards import Card


@dataclass(eq=False)
class MaterialCards:
    """The cards of one material, by their keywords."""

    card: Card
    parts: dict[str, Card] = field(default_factory=dict)

    @property
    def density(self) -> float:
        """Mass per volume, zero if none is given."""
        card = self.parts.get("DENSITY")
        return 0.0 if card is None else card.floats(0)[0]


def read_materials(cards: Sequence[Card]) -> tuple[dict[str, MaterialCards], dict[str, Card]]:
    """Return materials and orientations by name. Cards of a material follow its *MATERIAL."""
    found: dict[str, MaterialCards] = {}
    axes: dict[str, Card] = {}
    now: MaterialCards | None = None
    for card in cards:
        if card.name == "MATERIAL":
            now = found[card.required("NAME")] = MaterialCards(card)
        elif card.name == "ORIENTATION":
            axes[card.required("NAME")] = card
        elif card.name in MATERIAL_CARDS:
            if now is None:
                raise card.error("must follow a *MATERIAL, none is before it: add one with NAME=")
            now.parts[card.name] = card
        elif card.name not in WITHOUT_EFFECT:
            now = None
    return found, axes


#: Axes of a material as rows.
Axes: TypeAlias = tuple[tuple[float, float, float], ...]


def axes_of(card: Card | None) -> Axes:
    """Return the axes of a rectangular orientation as rows."""
    if card is None:
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if card.name_of("SYSTEM") not in ("", "RECTANGULAR", "R"):
        raise card.error(f"SYSTEM={card.name_of('SYSTEM')} is not supported: give rectangular axes")
    if card.name_of("DEFINITION") not in ("", "COORDINATES"):
        raise card.error("DEFINITION must be COORDINATES: give axes by the coordinates of two points")
    numbers = card.floats(0) if card.lines else []
    if len(numbers) < 6 or len(card.lines) > 2:
        raise card.error("needs a line with two points of three coordinates each, and at most another", 0)
    try:
        rows = material_axes(numbers[:3], numbers[3:6])
    except InvalidInputError as error:
        raise card.error(str(error), 0) from error
    return _turned(rows, card) if len(card.lines) > 1 else rows


def _turned(rows: Axes, card: Card) -> Axes:
    """Return axes that the second line of an orientation turns about one of them, by degrees."""
    number, angle = [*card.floats(1), 0.0][:2]
    if number not in (1, 2, 3):
        raise card.error(f"needs an axis, 1, 2 or 3, and an angle, got {card.lines[1].strip()!r}", 1)
    first, second = ((int(number) + k) % 3 for k in (0, 1))
    axes, turn = np.array(rows), np.radians(angle)
    turned = axes.copy()
    turned[first] = np.cos(turn) * axes[first] + np.sin(turn) * axes[second]
    turned[second] = np.cos(turn) * axes[second] - np.sin(turn) * axes[first]
    return tuple((float(x), float(y), float(z)) for x, y, z in turned)


def row_at(card: Card, width: int, temperature: float, what: str) -> list[float]:
    """Return the numbers of a table of rows with a temperature behind each, at one temperature.

    Linear between rows, constant beyond them.
    """
    table = table_of(card, width)
    if not len(table):
        raise card.error(f"needs {what}, it has no data line: add it")
    table = table[np.argsort(table[:, -1], kind="stable")]
    return [float(np.interp(temperature, table[:, -1], table[:, k])) for k in range(width)]


def table_of(card: Card, width: int) -> np.ndarray:
    """Return the rows of a table, (n, width + 1), each over as many lines of eight numbers as it needs."""
    lines = [card.floats(k) for k in range(len(card.lines))]
    per = -(-(width + 1) // 8)
    joined = [[n for line in lines[k : k + per] for n in line] for k in range(0, len(lines), per)]
    return np.array([[*row, *[0.0] * (width + 1)][: width + 1] for row in joined]).reshape(-1, width + 1)


def depends_on_temperature(card: Card, width: int) -> bool:
    """Return whether a table has rows for several temperatures that differ."""
    table = table_of(card, width)
    return bool(len(table) > 1 and np.ptp(table[:, :width], axis=0).any())


@dataclass(frozen=True)
class Conditions:
    """What materials are built for.

    `temperature`: the one temperature of all steps, None where it varies; `thickness`: that of a plane body
    where the deck has several, else None; `dilatation`: whether cells are linear hexahedra or quadrilaterals,
    whose changes of volume are means; `expands`: whether the body is heated and some material of it expands:
    others then do so by zero.
    """

    kind: str
    large: bool
    temperature: float | None
    heated: bool
    dilatation: bool
    thickness: float | None = None
    initial: float | None = None
    expands: bool = False


def build_material(cards: MaterialCards, axes: Card | None, of: Conditions) -> Material:
    """Return a material of a deck."""
    parts = cards.parts
    try:
        stiff = [
            name
            for name in ("PLASTIC", *WITHOUT_ELASTIC, "NLGEOM")
            if name in parts or name == "NLGEOM" * of.large
        ]
        if of.thickness is not None and stiff:
            raise cards.card.error(f"plane bodies of several thicknesses with {stiff[0]} are not supported")
        for name, build in WITHOUT_ELASTIC.items():
            if name in parts:
                return build(parts, of)
        if "ELASTIC" not in parts:
            given = ", ".join("*" + part.written for part in parts.values()) or "nothing"
            raise cards.card.error(f"needs *ELASTIC or *HYPERELASTIC behind it, has {given}")
        kind = parts["ELASTIC"].name_of("TYPE") or "ISO"
        if kind in ("ISO", "ISOTROPIC"):
            return _isotropic(parts, of)
        if kind in ("ANISO", "ANISOTROPIC"):
            kind = "ANISO"
        if "PLASTIC" in parts or of.large:
            what = "*PLASTIC" if "PLASTIC" in parts else "NLGEOM"
            raise parts["ELASTIC"].error(f"TYPE={kind} with {what} is not supported: give ISO")
        return (_anisotropic if kind == "ANISO" else _orthotropic)(parts, kind, axes, of)
    except InvalidInputError as error:
        if getattr(error, "card", ""):
            raise
        raise cards.card.error(str(error)) from error


def _row(card: Card, width: int, of: Conditions, what: str) -> list[float]:
    if of.temperature is None and depends_on_temperature(card, width):
        raise card.error("constants of this material must not depend on the temperature: give their mean")
    return row_at(card, width, of.temperature or 0.0, what)


def _expansion(parts: Mapping[str, Card], of: Conditions, count: int) -> tuple[float, ...]:
    """Return the coefficients of expansion, without any nothing, or zeros where other materials expand."""
    if "EXPANSION" not in parts:
        return (0.0,) * count if of.expands else ()
    card = parts["EXPANSION"]
    kind = card.name_of("TYPE") or "ISO"
    width = {"ISO": 1, "ORTHO": 3, "ANISO": 6, "ANISOTROPIC": 6}.get(kind, 0)
    if not 0 < width <= count:
        raise card.error(f"TYPE={kind} must be ISO, ORTHO or ANISO as *ELASTIC has: correct it")
    if of.temperature is None and depends_on_temperature(card, width):
        raise card.error("the expansion of this material must not depend on the temperature: give its mean")
    values = tuple(row_at(card, width, of.temperature or 0.0, "an expansion"))
    if count == 6:
        along = values[:3] if width > 1 else values * 3
        return (*along, *(values[k] for k in (5, 4, 3))) if width == 6 else (*along, 0.0, 0.0, 0.0)
    return values if len(values) == count else values * count


def _follows_temperature(parts: Mapping[str, Card], of: Conditions) -> bool:
    """Return whether isotropic constants of a linear material change with the temperatures of the deck."""
    if of.temperature is not None or of.large or "PLASTIC" in parts or of.kind == "plane stress":
        return False
    widths = {"ELASTIC": 2, "EXPANSION": 1}
    plain = (parts["EXPANSION"].name_of("TYPE") or "ISO") == "ISO" if "EXPANSION" in parts else True
    return plain and any(
        name in parts and depends_on_temperature(parts[name], width) for name, width in widths.items()
    )


def _by_temperature(parts: Mapping[str, Card], of: Conditions) -> Material:
    """Return isotropic elasticity whose constants follow the temperature."""
    card = parts["ELASTIC"]
    if of.initial is None or of.thickness is not None:
        what = "several initial temperatures" if of.initial is None else "several thicknesses"
        raise card.error(f"constants that depend on the temperature are not supported with {what}")
    young, poisson = (_curve_of(card, 2, column) for column in range(2))
    expansion: ByTemperature | None = 0.0 if of.expands else None
    zero = 0.0
    if "EXPANSION" in parts:
        expansion, zero = _curve_of(parts["EXPANSION"], 1, 0), parts["EXPANSION"].number_of("ZERO")
    return TemperatureDependentElasticity(young, poisson, expansion, of.initial, zero)


def _curve_of(card: Card, width: int, column: int) -> ByTemperature:
    """Return a column of a table with a temperature behind each row, a number if it is the same in all."""
    table = table_of(card, width)
    if not np.ptp(table[:, column]):
        return float(table[0, column])
    table = table[np.argsort(table[:, -1], kind="stable")]
    return tuple((float(row[-1]), float(row[column])) for row in table)


def _isotropic(parts: Mapping[str, Card], of: Conditions) -> Material:
    if _follows_temperature(parts, of):
        return _by_temperature(parts, of)
    young, poisson = _row(parts["ELASTIC"], 2, of, "Young's modulus and Poisson's ratio")
    if "PLASTIC" in parts:
        return _plastic(parts, young, poisson, of)
    if of.large:
        if of.kind == "plane stress":
            raise parts["ELASTIC"].error("plane stress with NLGEOM is not supported: take solid elements")
        return StVenantKirchhoff(young, poisson, **_heated(parts, of))
    expansion = next(iter(_expansion(parts, of, 1)), None)
    if of.kind in ("plane strain", "plane stress"):
        kind = PlaneStrain if of.kind == "plane strain" else PlaneStress
        return kind(young, poisson, expansion, of.thickness)
    return IsotropicElasticity(young, poisson, expansion)


def _plastic(parts: Mapping[str, Card], young: float, poisson: float, of: Conditions) -> Material:
    """Return a metal; tables are of true stress over logarithmic plastic strain where strains are large."""
    card = parts["PLASTIC"]
    if of.kind == "plane stress":
        raise card.error("plane stress with plasticity is not supported: take solid or plane strain elements")
    kind = card.name_of("HARDENING") or "ISOTROPIC"
    if kind not in ("ISOTROPIC", "KINEMATIC", "COMBINED"):
        raise card.error(f"HARDENING must be ISOTROPIC, KINEMATIC or COMBINED, got {kind}: give one of them")
    if (kind == "COMBINED") != ("CYCLICHARDENING" in parts):
        raise card.error(
            f"HARDENING=COMBINED and *CYCLIC HARDENING need each other, got {kind}: give both or neither"
        )
    first, rest = _curve(card)
    own: dict[str, Any] = {"hardening_curve": rest}
    if kind != "ISOTROPIC":
        own = {"kinematic_curve": tuple((strain, stress - first) for strain, stress in rest)}
    if kind == "COMBINED":
        first, own["hardening_curve"] = _curve(parts["CYCLICHARDENING"])
    further = own | _heated(parts, of)
    if of.large:
        return NeoHookeanPlasticity(young, poisson, first, **further)
    return J2Plasticity(young, poisson, first, mean_dilatation=of.dilatation, **further)


def _heated(parts: Mapping[str, Card], of: Conditions) -> dict[str, Any]:
    """Return the expansion of a nonlinear material, which costs forms of its own, where it is heated."""
    alpha = _expansion(parts, of, 1) if of.heated else ()
    return {"thermal_expansion": alpha[0]} if alpha else {}


def _curve(card: Card) -> tuple[float, Points]:
    """Return the yield stress of a table, and the points of its curve beyond it."""
    rows = np.array([[*card.floats(k), 0.0, 0.0, 0.0][:3] for k in range(len(card.lines))]).reshape(-1, 3)
    if not len(rows):
        raise card.error("needs a table of stress and plastic strain, it has no data line: add it")
    if np.ptp(rows[:, 2]) > 0.0:
        raise card.error("a yield stress that depends on the temperature is not read: give one temperature")
    if rows[0, 1] < 0.0:
        raise card.error(f"plastic strains must not be below zero, the first is {rows[0, 1]:g}", 0)
    if rows[0, 1] > 0.0:  # the stress is the same before the first strain of the table
        rows = np.vstack([[rows[0, 0], 0.0, 0.0], rows])
    return float(rows[0, 0]), tuple((float(strain), float(stress)) for stress, strain, _ in rows[1:])


def _orthotropic(parts: Mapping[str, Card], kind: str, axes: Card | None, of: Conditions) -> Material:
    card = parts["ELASTIC"]
    if kind in ("ENGINEERINGCONSTANTS", "ENGINEERING CONSTANTS"):
        e1, e2, e3, n12, n13, n23, g12, g13, g23 = _row(card, 9, of, "nine constants")
    elif kind in ("ORTHO", "ORTHOTROPIC"):
        d11, d12, d22, d13, d23, d33, g12, g13, g23 = _row(card, 9, of, "nine stiffnesses")
        c = _compliance(card, np.array([[d11, d12, d13], [d12, d22, d23], [d13, d23, d33]]))
        e1, e2, e3 = (float(v) for v in 1.0 / np.diag(c))
        n12, n13, n23 = float(-c[0, 1] * e1), float(-c[0, 2] * e1), float(-c[1, 2] * e2)
    else:
        raise card.error(f"TYPE={kind} is not read: give ISO, ORTHO, ENGINEERING CONSTANTS or ANISO")
    alpha = _expansion(parts, of, 3)
    rows = axes_of(axes)
    if of.kind == "plane stress":
        if abs(rows[2][2]) < 1.0 - 1e-9:
            raise card.error("axes of a plane material must lie in the plane: correct *ORIENTATION")
        angle = float(np.arctan2(rows[0][1], rows[0][0]))
        plane = (alpha[0], alpha[1]) if alpha else None
        return OrthotropicPlaneStress((e1, e2), n12, g12, angle, plane, of.thickness)
    if of.kind == "plane strain":
        raise card.error(f"TYPE={kind} in plane strain is not supported: take solid elements")
    return OrthotropicElasticity((e1, e2, e3), (n12, n13, n23), (g12, g13, g23), rows, alpha or None)  # type: ignore[arg-type]


def _compliance(card: Card, moduli: np.ndarray, least: float = 1e-12) -> np.ndarray:
    """Return the inverse of stiffnesses, (3, 3), which must store energy in every stretch."""
    size = np.linalg.eigvalsh(moduli)
    if not size[0] > least * size[-1]:
        raise card.error(f"stiffnesses must be positive definite, got the smallest eigenvalue {size[0]:.3g}")
    return np.asarray(np.linalg.inv(moduli))


def _order(card: Card) -> int:
    """Return the number of terms of a material."""
    order = card.number_of("N", 1.0)
    if order not in range(1, 10):
        raise card.error(f"N must be a number of terms from 1 to 9, got {order:g}: correct it")
    return int(order)


#: Place of 11, 22, 33, 12, 13, 23, the order of the deck, among xx, yy, zz, yz, xz, xy.
_IN_VOIGT = np.array([0, 1, 2, 5, 4, 3])


def _anisotropic(parts: Mapping[str, Card], kind: str, axes: Card | None, of: Conditions) -> Material:
    card = parts["ELASTIC"]
    if of.kind in ("plane stress", "plane strain"):
        raise card.error(f"TYPE={kind} in {of.kind} is not supported: take solid elements")
    values = _row(card, 21, of, "21 stiffnesses")
    moduli = np.zeros((6, 6))
    column, row = np.tril_indices(6)  # the upper triangle column by column
    moduli[_IN_VOIGT[row], _IN_VOIGT[column]] = moduli[_IN_VOIGT[column], _IN_VOIGT[row]] = values
    return AnisotropicElasticity(moduli, axes_of(axes), _expansion(parts, of, 6) or None)  # type: ignore[arg-type]


def _hyperelastic(parts: Mapping[str, Card], of: Conditions) -> Material:
    card = parts["HYPERELASTIC"]
    if not of.large:
        raise card.error("needs NLGEOM in its *STEP, as rubber is for large deformations: add it")
    if of.kind == "plane stress":
        raise card.error("plane stress with rubber is not supported: take solid or plane strain elements")
    flags, order = set(card.parameters), _order(card)
    if flags & {"NEOHOOKE"}:
        c10, d1 = _row(card, 2, of, "C10 and D1")
        c01 = 0.0
    elif flags & {"MOONEY-RIVLIN"}:
        c10, c01, d1 = _row(card, 3, of, "C10, C01 and D1")
    elif flags & {"OGDEN"}:
        values = _row(card, 3 * order, of, "μ, α and D of each term")
        pairs, volumes = np.array(values[: 2 * order]).reshape(-1, 2), values[2 * order :]
        if any(volumes[1:]):
            raise card.error("compressibility terms D2, D3, ... are not supported: set them to 0")
        if not pairs[:, 1].all():
            raise card.error("exponents α must not be zero, got one that is: leave the term out")
        moduli = tuple(float(2 * mu / alpha) for mu, alpha in pairs)
        bulk = _bulk(volumes[0], float(sum(pairs[:, 0])))
        exponents, own = tuple(map(float, pairs[:, 1])), _heated(parts, of)
        return Ogden(moduli, exponents, bulk, mean_dilatation=of.dilatation, **own)
    else:
        model = ", ".join(sorted(flags)) or "POLYNOMIAL"
        raise card.error(f"{model} is not supported: give NEO HOOKE, MOONEY-RIVLIN or OGDEN")
    bulk = _bulk(d1, 2.0 * (c10 + c01))
    return MooneyRivlin(c10, c01, bulk, mean_dilatation=of.dilatation, **_heated(parts, of))


def _foam(parts: Mapping[str, Card], of: Conditions) -> Material:
    card = parts["HYPERFOAM"]
    _require_large_solid(card, of)
    order = _order(card)
    values = _row(card, 3 * order, of, "μ and α, and behind them ν, of each term")
    pairs = np.array(values[: 2 * order]).reshape(-1, 2)
    moduli, exponents = (tuple(map(float, column)) for column in pairs.T)
    return Hyperfoam(moduli, exponents, tuple(values[2 * order :]), **_heated(parts, of))


def _deformation(parts: Mapping[str, Card], of: Conditions) -> Material:
    card = parts["DEFORMATIONPLASTICITY"]
    _require_large_solid(card, of)
    numbers = _row(card, 5, of, "E, ν, the yield stress, the exponent and the offset")
    young, poisson, stress, exponent, offset = numbers
    return RambergOsgood(young, poisson, stress, exponent, offset, **_heated(parts, of))


def _require_large_solid(card: Card, of: Conditions) -> None:
    if not of.large:
        raise card.error("needs NLGEOM in its *STEP, as it is for large deformations: add it")
    if of.kind == "plane stress":
        raise card.error("is not supported in plane stress: take solid or plane strain elements")


#: Cards of materials that need no *ELASTIC.
WITHOUT_ELASTIC = {"HYPERELASTIC": _hyperelastic, "HYPERFOAM": _foam, "DEFORMATIONPLASTICITY": _deformation}


def _bulk(d1: float, shear: float, poisson: float = 0.475) -> float:
    """Return the bulk modulus 2/D1; where D1 is zero that of CalculiX, with Poisson's ratio 0.475."""
    return 2.0 / d1 if d1 > 0 else 2.0 * shear * (1 + poisson) / (3.0 * (1 - 2 * poisson))
