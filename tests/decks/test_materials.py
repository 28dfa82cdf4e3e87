"""Materials of decks: the constants are those of the programs' formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact import ThermalStrain
from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    AnisotropicElasticity,
    Hyperfoam,
    IsotropicElasticity,
    J2Plasticity,
    Material,
    MooneyRivlin,
    NeoHookeanPlasticity,
    Ogden,
    OrthotropicElasticity,
    OrthotropicPlaneStress,
    RambergOsgood,
    StVenantKirchhoff,
)
from tests.decks.texts import SECTION, deck, mesh_cards

CUBE = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 1), (1, 1, 1), "tetrahedron")})
PLATE = mesh_cards({"BAR": rectangle((0, 0), (1, 1), (1, 1))}, "CPS4")
STEEL = "*ELASTIC\n2.E5, 0.3\n"


def material(
    folder: Path, cards: str, large: bool = False, mesh: str = CUBE, section: str = SECTION
) -> Material:
    (one,) = read_deck(deck(folder, text_of(cards, large, mesh, section))).scene.bodies["BAR"].materials
    return one


def text_of(cards: str, large: bool, mesh: str, section: str, loads: str = "") -> str:
    nlgeom = ", NLGEOM" if large else ""
    end = f"*BOUNDARY\nBAR_X0, 1, 2\n*STEP{nlgeom}\n*STATIC\n{loads}*END STEP\n"
    return mesh + "*MATERIAL, NAME=STEEL\n" + cards + section + end


@pytest.mark.parametrize(
    ("cards", "large", "wanted"),
    [
        (STEEL, False, IsotropicElasticity(2e5, 0.3)),
        (STEEL, True, StVenantKirchhoff(2e5, 0.3)),
        ("*HYPERELASTIC, NEO HOOKE\n1.5, 0.02\n", True, MooneyRivlin(1.5, 0.0, 100.0)),
        ("*HYPERELASTIC, MOONEY-RIVLIN\n1.5, 0.5, 0.02\n", True, MooneyRivlin(1.5, 0.5, 100.0)),
        ("*HYPERELASTIC, OGDEN, N=2\n3., 2., 1., 4., 0.1, 0.\n", True, Ogden((3.0, 0.5), (2.0, 4.0), 20.0)),
        ("*HYPERFOAM, N=2\n3., 2., 1., 4., 0.1, 0.\n", True, Hyperfoam((3.0, 1.0), (2.0, 4.0), (0.1, 0.0))),
        ("*DEFORMATION PLASTICITY\n2.E5,.3,900.,12.,.4\n", True, RambergOsgood(2e5, 0.3, 900.0, 12.0, 0.4)),
        (
            STEEL + "*PLASTIC\n300., 0.\n400., 0.1\n450., 0.3\n",
            False,
            J2Plasticity(2e5, 0.3, 300.0, hardening_curve=((0.1, 400.0), (0.3, 450.0))),
        ),
        (STEEL + "*PLASTIC\n300., 0.\n", True, NeoHookeanPlasticity(2e5, 0.3, 300.0)),
        (
            STEEL + "*PLASTIC, HARDENING=KINEMATIC\n300., 0.\n500., 0.1\n",
            False,
            J2Plasticity(2e5, 0.3, 300.0, kinematic_curve=((0.1, 200.0),)),
        ),
        (
            STEEL
            + "*PLASTIC, HARDENING=COMBINED\n300., 0.\n500., 0.1\n*CYCLIC HARDENING\n310.,0.\n320.,0.2\n",
            True,
            NeoHookeanPlasticity(
                2e5, 0.3, 310.0, hardening_curve=((0.2, 320.0),), kinematic_curve=((0.1, 200.0),)
            ),
        ),
    ],
)
def test_constants_become_those_of_the_models(
    cards: str, large: bool, wanted: Material, tmp_path: Path
) -> None:
    assert material(tmp_path, cards, large) == wanted


@pytest.mark.parametrize(
    ("cards", "large", "wanted"),
    [
        (STEEL, True, StVenantKirchhoff(2e5, 0.3, 1e-5)),
        (STEEL + "*PLASTIC\n300., 0.\n", False, J2Plasticity(2e5, 0.3, 300.0, thermal_expansion=1e-5)),
        (STEEL + "*PLASTIC\n300., 0.\n", True, NeoHookeanPlasticity(2e5, 0.3, 300.0, thermal_expansion=1e-5)),
        ("*HYPERELASTIC, NEO HOOKE\n1., 0.02\n", True, MooneyRivlin(1.0, 0.0, 100.0, thermal_expansion=1e-5)),
    ],
)
def test_nonlinear_materials_expand_where_they_are_heated(
    cards: str, large: bool, wanted: Material, tmp_path: Path
) -> None:
    warm = "*TEMPERATURE\nBAR_X0, 50.\nBAR_X1, 50.\n"
    text = text_of(cards + "*EXPANSION\n1.E-5\n", large, CUBE, SECTION, warm)
    found = read_deck(deck(tmp_path, text))
    assert found.scene.bodies["BAR"].materials == (wanted,)
    (load,) = found.steps[0].loads
    assert load == ThermalStrain("BAR", 50.0)


def test_rubber_without_compressibility_is_that_of_calculix(tmp_path: Path) -> None:
    """Poisson's ratio 0.475: K = 2 μ (1 + ν) / (3 (1 − 2 ν)) with μ = 2 C10."""
    rubber = material(tmp_path, "*HYPERELASTIC, NEO HOOKE\n1.5, 0.\n", True)
    assert isinstance(rubber, MooneyRivlin)
    assert rubber.bulk_modulus == pytest.approx(2 * 3.0 * 1.475 / (3 * 0.05))


def test_stiffnesses_and_engineering_constants_are_one_material(tmp_path: Path) -> None:
    axes = "*ORIENTATION, NAME=OR\n0., 1., 0., -1., 0., 0.\n"
    section = axes + SECTION.replace("MATERIAL", "ORIENTATION=OR, MATERIAL")
    constants = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n9., 5., 3., 0.2, 0.25, 0.1, 2., 1.5,\n1.2\n"
    known = material(tmp_path, constants, section=section)
    assert isinstance(known, OrthotropicElasticity)
    assert known.young_moduli == (9.0, 5.0, 3.0)
    assert known.orientation[0] == pytest.approx((0.0, 1.0, 0.0))
    plain = OrthotropicElasticity((9.0, 5.0, 3.0), (0.2, 0.25, 0.1), (2.0, 1.5, 1.2)).stiffness_matrix
    numbers = [plain[0, 0], plain[0, 1], plain[1, 1], plain[0, 2], plain[1, 2], plain[2, 2], 2.0, 1.5, 1.2]
    text = ", ".join(f"{n:.15g}" for n in numbers[:8]) + f"\n{numbers[8]}\n"
    other = material(tmp_path, f"*ELASTIC, TYPE=ORTHO\n{text}", section=section)
    assert isinstance(other, OrthotropicElasticity)
    np.testing.assert_allclose(other.stiffness_matrix, known.stiffness_matrix, rtol=1e-9, atol=1e-12)
    flat = material(tmp_path, constants, mesh=PLATE, section=section)
    assert flat == OrthotropicPlaneStress((9.0, 5.0), 0.2, 2.0, float(np.pi / 2))


def test_21_stiffnesses_are_in_their_places(tmp_path: Path) -> None:
    """D1111, D1122, D2222, D1133, ...: the upper triangle column by column of 11, 22, 33, 12, 13, 23."""
    names = ("11", "22", "33", "12", "13", "23")
    moduli = {(a, b): 1e4 * (a == b) + 10.0 * int(a) + int(b) for a in names for b in names if a <= b}
    ordered = [moduli[tuple(sorted((a, b)))] for k, b in enumerate(names) for a in names[: k + 1]]
    lines = ["".join(f"{n}, " for n in ordered[k : k + 8]) for k in (0, 8, 16)]
    cards = "*ELASTIC, TYPE=ANISO\n" + "\n".join(lines) + "\n*EXPANSION, TYPE=ANISO\n1., 2., 3., 4., 5., 6.\n"
    found = material(tmp_path, cards.replace("1., 2., 3.", "1.E-3, 2., 3."))
    assert isinstance(found, AnisotropicElasticity)
    assert found.thermal_expansion == (1e-3, 2.0, 3.0, 6.0, 5.0, 4.0)
    ours = ("11", "22", "33", "23", "13", "12")
    wanted = [[moduli[tuple(sorted((a, b)))] for b in ours] for a in ours]
    np.testing.assert_array_equal(found.stiffness_matrix, wanted)


@pytest.mark.parametrize(
    ("cards", "large", "message"),
    [
        ("*ELASTIC, TYPE=ANISO\n1., 2., 1.\n", False, r"moduli must give a positive energy"),
        ("*DENSITY\n1.\n", False, r"needs \*ELASTIC or \*HYPERELASTIC behind it, has \*DENSITY"),
        ("*HYPERELASTIC, YEOH\n1., 0.\n", True, r"YEOH is not supported"),
        ("*HYPERFOAM\n1., 2., 0.1\n", False, r"needs NLGEOM in its \*STEP"),
        ("*HYPERFOAM\n1., 2., 0.6\n", True, r"poisson_ratios must lie between 0 and 0.5"),
        ("*HYPERELASTIC, OGDEN, N=2\n3., 2., 1., 4., 0.1, 0.2\n", True, r"compressibility terms D2, D3"),
        (STEEL + "*PLASTIC\n3., -0.1\n4., 0.2\n", False, r"plastic strains must not be below zero"),
        (
            STEEL + "*PLASTIC\n3., 0.\n4., 0.2\n5., 0.1\n",
            False,
            r"hardening_curve must have ascending strains",
        ),
        (STEEL + "*PLASTIC\n3., 0., 20.\n4., 0., 70.\n", False, r"that depends on the temperature is not"),
        (STEEL + "*PLASTIC\n", False, r"needs a table of stress and plastic strain, it has no data line"),
        (STEEL + "*PLASTIC, HARDENING=USER\n3., 0.\n", False, r"HARDENING must be ISOTROPIC, KINEMATIC or"),
        (STEEL + "*PLASTIC, HARDENING=COMBINED\n3., 0.\n", False, r"and \*CYCLIC HARDENING need each other"),
        (
            "*ELASTIC, TYPE=ORTHO\n1., 0., 1., 0., 0., 1., 1., 1.,\n1.\n",
            True,
            r"TYPE=ORTHO with NLGEOM is not",
        ),
    ],
)
def test_a_material_without_counterpart_is_refused(
    cards: str, large: bool, message: str, tmp_path: Path
) -> None:
    with pytest.raises(DeckError, match=message):
        material(tmp_path, cards, large)
