"""The cards that are known, and what is done with them."""

from __future__ import annotations

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
    "SOLIDSECTION", "MATERIAL", "ORIENTATION", "AMPLITUDE", "INITIALCONDITIONS", "TRANSFORM",
    "CONTACTPAIR", "SURFACEINTERACTION", "SURFACEBEHAVIOR", "FRICTION", "CLEARANCE", "TIE", "RIGIDBODY",
    "COUPLING", "KINEMATIC", "DISTRIBUTING", "DISTRIBUTINGCOUPLING", "EQUATION", "PRE-TENSIONSECTION",
    "CYCLICSYMMETRYMODEL", "MPC",
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
    "TIMEPOINTS": "times of output",
    "RESTART": "output",
    "NODALTHICKNESS": "thickness of shells, of which there are none",
    "CONTROLS": "how the other program iterates",
    "SOLUTIONTECHNIQUE": "how the other program iterates",
    "CONTACTCONTROLS": "how the other program iterates",
    "PHYSICALCONSTANTS": "of radiation and fluids, of which there are none",
    "CONDUCTIVITY": "of heat that is conducted, which there is not",
    "SPECIFICHEAT": "of heat that is conducted, which there is not",
    "DAMPING": "of motions in time, of which there are none",
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
#: Parameters of the cards that are read; any other one is refused.
PARAMETERS: dict[str, set[str]] = {
    "NODE": {"NSET", "SYSTEM"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "ELSET", "GENERATE", "UNSORTED", "FREQUENCY"},
    "ELSET": {"ELSET", "GENERATE"},
    "SURFACE": {"NAME", "TYPE"},
    "SOLIDSECTION": {"ELSET", "MATERIAL", "ORIENTATION", "OFFSET"},  # of layers along their thickness
    "MATERIAL": {"NAME"},
    "ELASTIC": {"TYPE"},
    "PLASTIC": {"HARDENING"},
    "CYCLICHARDENING": set(),
    "HYPERFOAM": {"N"},
    "DEFORMATIONPLASTICITY": set(),
    "EXPANSION": {"TYPE", "ZERO"},
    "DENSITY": set(),
    "ORIENTATION": {"NAME", "SYSTEM", "DEFINITION"},
    "AMPLITUDE": {"NAME", "TIME", "DEFINITION", "SHIFTX", "SHIFTY", "VALUE", "USER"},
    "INITIALCONDITIONS": {"TYPE"},
    "TRANSFORM": {"NSET", "TYPE"},
    "CONTACTPAIR": {"INTERACTION", "TYPE", "ADJUST", "SMALLSLIDING"},
    "SURFACEINTERACTION": {"NAME"},
    "SURFACEBEHAVIOR": {"PRESSURE-OVERCLOSURE"},
    "FRICTION": set(),
    "CLEARANCE": {"MASTER", "SLAVE", "VALUE"},
    "TIE": {"NAME", "ADJUST", "POSITIONTOLERANCE", "CYCLICSYMMETRY"},
    "CYCLICSYMMETRYMODEL": {"N", "NGRAPH", "TIE", "ELSET"},
    "MPC": set(),
    "RIGIDBODY": {"NSET", "ELSET", "REFNODE", "ROTNODE"},
    "COUPLING": {"REFNODE", "SURFACE", "CONSTRAINTNAME", "ORIENTATION"},
    "KINEMATIC": set(),
    "DISTRIBUTING": set(),
    "DISTRIBUTINGCOUPLING": {"ELSET"},
    "EQUATION": {"REMOVE"},
    "PRE-TENSIONSECTION": {"SURFACE", "NODE"},
    "STEP": {"NLGEOM", "INC", "NAME", "PERTURBATION", "AMPLITUDE"},
    "CHANGEFRICTION": {"INTERACTION"},
    "CHANGESURFACEBEHAVIOR": {"INTERACTION"},
    "MODELCHANGE": {"TYPE", "REMOVE", "ADD"},
    "STATIC": {"DIRECT", "SOLVER"},
    "BOUNDARY": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY", "FIXED", "TYPE"},
    "CLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
    "DLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
    "DSLOAD": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
    "TEMPERATURE": {"OP", "NAME", "AMPLITUDE", "TIMEDELAY"},
}
