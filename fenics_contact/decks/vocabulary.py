"""The cards that are known, and what is done with them; all that is not known is named at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set

from fenics_contact.readers.deck_cards import Card, DeckError
from fenics_contact.readers.deck_elements import element_of
from fenics_contact.readers.deck_links import is_of_links

#: Cards of a material, behind *MATERIAL.
MATERIAL_CARDS = {
    "ELASTIC", "PLASTIC", "CYCLICHARDENING", "HYPERELASTIC", "HYPERFOAM",
    "DEFORMATIONPLASTICITY", "EXPANSION", "DENSITY", "CONDUCTIVITY",
    "SPECIFICHEAT",
}  # fmt: skip
#: Cards of nodes, elements and sets.
MESH_CARDS = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"}
#: Cards of the model that are read.
MODEL_CARDS = {
    "SOLIDSECTION", "SHELLSECTION", "NODALTHICKNESS", "MATERIAL", "ORIENTATION", "DISTRIBUTION", "AMPLITUDE",
    "BEAMSECTION", "INITIALCONDITIONS", "TRANSFORM", "CONTACTPAIR",
    "SURFACEINTERACTION", "SURFACEBEHAVIOR", "FRICTION", "CLEARANCE", "TIE", "RIGIDBODY",
    "COUPLING", "KINEMATIC", "DISTRIBUTING", "DISTRIBUTINGCOUPLING", "EQUATION", "PRE-TENSIONSECTION",
    "CYCLICSYMMETRYMODEL", "MPC", "SPRING", "MASS",
}  # fmt: skip
#: Cards of load steps that are read.
STEP_CARDS = {
    "STEP", "ENDSTEP", "STATIC", "BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "CHANGEFRICTION",
    "CHANGESURFACEBEHAVIOR", "MODELCHANGE",
}  # fmt: skip
#: Cards that ask for results.
PRINT_CARDS = {"NODEPRINT", "ELPRINT", "CONTACTPRINT", "NODEFILE", "ELFILE", "CONTACTFILE"}
#: Known cards that change nothing of what is solved here, and why.
WITHOUT_EFFECT = {
    "HEADING": "a title",
    "PREPRINT": "output",
    "PRINT": "output",
    "OUTPUT": "output",
    "NODEOUTPUT": "output",
    "ELEMENTOUTPUT": "output",
    "CONTACTOUTPUT": "output",
    "ELEMENTFILE": "output",
    "ENERGYOUTPUT": "output",
    "ENERGYPRINT": "output",
    "ELOUTPUT": "output",
    "SECTIONPRINT": "output",
    "FACEPRINT": "output",
    "MONITOR": "output",
    "FILEFORMAT": "output",
    "TIMEPOINTS": "times of output",
    "RESTART": "output",
    "DAMAGEINITIATION": "damage that is printed alone",
    "SECTIONCONTROLS": "of hourglasses, which reduced integration has there",
    "HOURGLASSSTIFFNESS": "of hourglasses, which reduced integration has there",
    "REFINEMESH": "solved on the mesh as it is given, where the other program refines it and solves again",
    "USEREFINEDMESH": "solved on the mesh as it is given",
    "DISTRIBUTIONTABLE": "names what the numbers of a *DISTRIBUTION are",
    "CONTROLS": "how the other program iterates",
    "SOLUTIONTECHNIQUE": "how the other program iterates",
    "CONTACTCONTROLS": "how the other program iterates",
    "PHYSICALCONSTANTS": "of radiation and fluids, of which there are none",
    "CONDUCTIVITY": "of heat that is conducted, which there is not",
    "SPECIFICHEAT": "of heat that is conducted, which there is not",
    "DAMPING": "of motions in time, of which there are none",
}
#: Parameters of cards that change nothing of what is solved here, and why.
IDLE_PARAMETERS = {
    ("NSET", "FREQUENCY"): "is of output, it has no effect on a set",
    ("STEP", "UNSYMM"): "has no effect here (how the other program solves)",
    ("STEP", "EXTRAPOLATION"): "has no effect here (how the other program iterates)",
    ("STEP", "CONVERTSDI"): "has no effect here (how the other program iterates)",
    ("SOLIDSECTION", "CONTROLS"): "has no effect here (hourglasses)",
    ("FRICTION", "SLIPTOLERANCE"): "has no effect here: friction sticks without slip",
    ("DSLOAD", "CONSTANTRESULTANT"): "has no effect here, where areas stay as they are",
    **{
        ("STATIC", name): "has no effect here (how the other program iterates)"
        for name in ("STABILIZE", "FACTOR", "ALLSDTOL", "CONTINUE")
    },
}
#: Every card that is known.
KNOWN = MATERIAL_CARDS | MESH_CARDS | MODEL_CARDS | STEP_CARDS | PRINT_CARDS | set(WITHOUT_EFFECT)
#: Known cards that are not read yet.
NOT_YET: set[str] = set()
#: Known procedures of other programs that have no counterpart here.
PROCEDURES = {
    "FREQUENCY", "DYNAMIC", "HEATTRANSFER", "COUPLEDTEMPERATURE-DISPLACEMENT", "BUCKLE", "MODALDYNAMIC",
    "STEADYSTATEDYNAMICS", "VISCO", "CFD", "GREEN", "SENSITIVITY", "ELECTROMAGNETICS", "COMPLEXFREQUENCY",
    "UNCOUPLEDTEMPERATURE-DISPLACEMENT", "SUBSTRUCTUREGENERATE", "CRACKPROPAGATION", "FEASIBLEDIRECTION",
}  # fmt: skip
#: Procedures of steps that conduct heat.
HEAT = {"HEATTRANSFER", "COUPLEDTEMPERATURE-DISPLACEMENT", "UNCOUPLEDTEMPERATURE-DISPLACEMENT"}
IDLE_PARAMETERS |= {
    (card, name): "has no effect here, where steps in time have an error of their own, and times go on"
    for card in HEAT
    for name in ("DELTMX", "TIMERESET", "END", "MXDEM")
}
#: Cards of the model that say how heat is conducted; others have no effect on it.
HEAT_MODEL = MESH_CARDS | {
    "SOLIDSECTION", "MATERIAL", "ORIENTATION", "DISTRIBUTION", "INITIALCONDITIONS", "CONTACTPAIR",
    "SURFACEINTERACTION", "SURFACEBEHAVIOR", "TIE", "CYCLICSYMMETRYMODEL", "CONDUCTIVITY", "SPECIFICHEAT",
    "DENSITY",
}  # fmt: skip
#: Cards that are of heat alone.
HEAT_ALONE = {"DFLUX", "FILM", "RADIATE", "CFLUX", "GAPCONDUCTANCE", "GAPHEATGENERATION"}
#: Cards of steps that conduct heat, and of what they have.
HEAT_CARDS = HEAT | HEAT_ALONE | {"HEADING", "STEP", "ENDSTEP", "BOUNDARY", "AMPLITUDE", "PHYSICALCONSTANTS"}
#: Parameters of the cards that are read; any other one is refused.
PARAMETERS: dict[str, set[str]] = {
    "NODE": {"NSET", "SYSTEM"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "ELSET", "GENERATE", "UNSORTED", "FREQUENCY"},
    "ELSET": {"ELSET", "GENERATE"},
    "SURFACE": {"NAME", "TYPE"},
    "SOLIDSECTION": {"ELSET", "MATERIAL", "ORIENTATION", "OFFSET", "CONTROLS"},  # OFFSET of layers
    "SHELLSECTION": {"ELSET", "MATERIAL", "ORIENTATION", "OFFSET", "NODALTHICKNESS", "COMPOSITE"},
    "BEAMSECTION": {"ELSET", "MATERIAL", "ORIENTATION", "SECTION", "OFFSET1", "OFFSET2"},
    "NODALTHICKNESS": set(),
    "MATERIAL": {"NAME"},
    "ELASTIC": {"TYPE"},
    "PLASTIC": {"HARDENING"},
    "CYCLICHARDENING": set(),
    "HYPERFOAM": {"N"},
    "DEFORMATIONPLASTICITY": set(),
    "EXPANSION": {"TYPE", "ZERO"},
    "DENSITY": set(),
    "ORIENTATION": {"NAME", "SYSTEM", "DEFINITION"},
    "DISTRIBUTION": {"NAME", "LOCATION", "TABLE"},
    "AMPLITUDE": {"NAME", "TIME", "DEFINITION", "SHIFTX", "SHIFTY", "VALUE", "USER"},
    "INITIALCONDITIONS": {"TYPE"},
    "TRANSFORM": {"NSET", "TYPE"},
    "CONTACTPAIR": {"INTERACTION", "TYPE", "ADJUST", "SMALLSLIDING"},
    "SURFACEINTERACTION": {"NAME"},
    "SURFACEBEHAVIOR": {"PRESSURE-OVERCLOSURE"},
    "FRICTION": {"SLIPTOLERANCE"},
    "CLEARANCE": {"MASTER", "SLAVE", "VALUE"},
    "TIE": {"NAME", "ADJUST", "POSITIONTOLERANCE", "CYCLICSYMMETRY"},
    "CYCLICSYMMETRYMODEL": {"N", "NGRAPH", "TIE", "ELSET"},
    "MPC": set(),
    "SPRING": {"ELSET", "NONLINEAR"},
    "MASS": {"ELSET"},
    "RIGIDBODY": {"NSET", "ELSET", "REFNODE", "ROTNODE"},
    "COUPLING": {"REFNODE", "SURFACE", "CONSTRAINTNAME", "ORIENTATION"},
    "KINEMATIC": set(),
    "DISTRIBUTING": {"CYCLICSYMMETRY"},
    "DISTRIBUTINGCOUPLING": {"ELSET"},
    "EQUATION": {"REMOVE"},
    "PRE-TENSIONSECTION": {"SURFACE", "NODE"},
    "STEP": {"NLGEOM", "INC", "NAME", "PERTURBATION", "AMPLITUDE", "UNSYMM", "EXTRAPOLATION", "CONVERTSDI"},
    "CHANGEFRICTION": {"INTERACTION"},
    "CHANGESURFACEBEHAVIOR": {"INTERACTION"},
    "MODELCHANGE": {"TYPE", "REMOVE", "ADD"},
    "STATIC": {"DIRECT", "SOLVER", "STABILIZE", "FACTOR", "ALLSDTOL", "CONTINUE"},
    "BOUNDARY": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY", "FIXED", "TYPE"},
    "CLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
    "DLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
    "DSLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY", "CONSTANTRESULTANT", "FOLLOWER"},
    "TEMPERATURE": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY", "LINTEMP", "FILE", "BSTEP"},
    **{name: {"STEADYSTATE", "DIRECT", "SOLVER", "DELTMX", "TIMERESET", "END", "MXDEM"} for name in HEAT},
    "CONDUCTIVITY": {"TYPE"},
    "SPECIFICHEAT": set(),
    "GAPCONDUCTANCE": {"PRESSURE"},
    "GAPHEATGENERATION": set(),
    "PHYSICALCONSTANTS": {"ABSOLUTEZERO", "STEFANBOLTZMANN"},
    **{name: {"OP", "AMPLITUDE", "TIMEDELAY"} for name in ("CFLUX", "DFLUX", "FILM", "RADIATE")},
}
#: Cards that change what is solved, by what they are of.
STRUCTURES = {
    "SHELLGENERALSECTION": "shells of given stiffness are not solved here: give *SHELL SECTION",
    "MEMBRANESECTION": "membranes are not solved here: mesh the part with solid elements",
    "BEAMGENERALSECTION": "beams of given stiffness, pipes and boxes are not solved here: mesh the part with "
    "solid elements",
    "DASHPOT": "dashpots are not solved here, where nothing moves in time: leave them out",
    "GAP": "gaps between nodes are not read: give a *CONTACT PAIR",
    "USERMATERIAL": "materials of user routines are not read: take one of the guide, or write it in Python",
    "DEPVAR": "it belongs to materials of user routines, which are not read",
    "SUBMODEL": "submodels are not read: give displacements by *BOUNDARY",
    "VIEWFACTOR": "cavities, whose surfaces see each other, are not solved: give temperatures around (R1)",
    "CREEP": "creep is not solved here: it goes on in time",
    **{
        name: "heat is conducted in decks with *HEAT TRANSFER: give temperatures by *TEMPERATURE"
        for name in sorted(HEAT_ALONE)
    },
}


def refuse_unknown(cards: Sequence[Card], known: Set[str] = KNOWN | PROCEDURES) -> None:
    """Refuse unknown cards, types of elements and parameters, all in one error, each with its line."""
    found = list(_unknown(cards, known))
    if not found:
        return
    (card, words), *others = found
    if others:
        listed = [f"*{each.written} (line {each.line} of {each.file}): {what}" for each, what in others]
        words += "; not known either are\n  " + "\n  ".join(listed)
    raise card.error(words)


def _unknown(cards: Sequence[Card], known: Set[str]) -> Iterator[tuple[Card, str]]:
    """Yield each card, type of elements and parameter that is not known, once."""
    seen = set[str]()
    for card in cards:
        for words in _of_card(card, known):
            key = f"{card.name} {words}"
            if key not in seen:
                seen.add(key)
                yield card, words


def _of_card(card: Card, known: Set[str]) -> Iterator[str]:
    if card.name not in known:
        unknown = "this card is not known: the guide lists those that are; leave it out if it has no effect"
        yield STRUCTURES.get(card.name, unknown)
        return
    if card.name == "RESTART" and "READ" in card.parameters:
        yield "restart files are not supported: supply all steps"
    for strange in sorted(set(card.parameters) - PARAMETERS.get(card.name, set(card.parameters))):
        there = ", ".join(sorted(PARAMETERS[card.name])) or "none"
        yield f"the parameter {strange} is not read: {there} can be"
    if card.name in NOT_YET:
        yield "this card is known, but not read yet: leave it out, or describe it in Python"
    if card.name == "ELEMENT" and card.name_of("TYPE") and not is_of_links(card):
        try:
            element_of(card)
        except DeckError as error:
            yield str(error).partition(f"*{card.written}: ")[2]
