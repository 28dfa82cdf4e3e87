"""Contact mechanics with friction, and contact shape optimisation, on FEniCSx by Total FETI.

What a script needs is here; nothing is loaded before it is used:

Scenes: Scene, Body, BodyMesh, Surface, Support, Roller, RigidSurface, HoldCurrent, ContactPair, Tie,
    CyclicSymmetry, AutomaticContact, LoadStep, Preload, Section, ElasticFoundation, Spring, LinearConstraint,
    ConstraintTerm, box_partition

Laws of surfaces: Coulomb, Tresca, FrictionTable, FrictionCurve, SlipTable, LinearClosure, ExponentialClosure,
    ClosureTable, ClosureLaw, FluidPressure, Wear, WearTable, WearCurve

Rigid obstacles: RigidPlane, RigidSphere, RigidCylinder, DistanceObstacle, MovingObstacle,
    RigidTool, ToolMotion

Loads: Traction, Pressure, TotalForce, PointForce, BodyForce, gravity, centrifugal, point_mass,
    ThermalStrain, InitialStress

Values of loads: SampledField, read_field, Ufl

Equilibrium: solve_scene, solve_nested, solve_steps, ContactProblem, LoadSequence, AutomaticSteps,
    TangentNewton, FixedPoint, Tolerance, wear_to, WearLimits

To an accuracy: solve_to, solve_steps_to, minimize_to, Limits, Level, AccurateResult, AccurateDesign,
    TransferredState, quantity, goal_error, GoalError, ErrorEstimate

Results: State, LinearState, DeformedState, NewtonSteps, Status, contact_area,
    contact_width

Shape optimisation: ShapeProblem, SurfaceDesign, minimize

Functions for other tools: SceneResponse, DesignResponse

Files: read_mesh, read_cad, read_scene_file, write_result, write_vtu, result_page

Long runs: show_progress, Checkpoint, CheckpointError, interruptible, Interrupted, PhaseTimer,
    clean_environment, once_a_machine

Tests of material models: check_hyperelastic, check_history_material

Public modules with more: `materials`, `heat` (through bodies and contacts), `fatigue` (of contact edges),
`gallery` (meshes of simple bodies), `readers` (gmsh, CAD, dolfinx, meshio), `decks` (of CalculiX and Abaqus),
`mesh`, `shapes` (true surfaces), `design` (objectives, constraints, optimisers), `results` (what states
consist of), `pictures`, `output` (files), `study` (what accuracy costs), `errors`, `theory` (contacts known
by formula), `qp` (dual solvers) and `feti` (subdomains).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fenics_contact._base import requirements
from fenics_contact._base.late_names import homes

if TYPE_CHECKING:
    from fenics_contact._adaptive.equilibrium import solve_to as solve_to
    from fenics_contact._adaptive.estimates import ErrorEstimate as ErrorEstimate
    from fenics_contact._adaptive.goal_errors import GoalError as GoalError
    from fenics_contact._adaptive.goal_errors import goal_error as goal_error
    from fenics_contact._adaptive.levels import AccurateResult as AccurateResult
    from fenics_contact._adaptive.levels import Level as Level
    from fenics_contact._adaptive.levels import Limits as Limits
    from fenics_contact._adaptive.load_steps import solve_steps_to as solve_steps_to
    from fenics_contact._adaptive.minimised import AccurateDesign as AccurateDesign
    from fenics_contact._adaptive.minimised import minimize_to as minimize_to
    from fenics_contact._adaptive.nested import solve_nested as solve_nested
    from fenics_contact._adaptive.quantities import quantity as quantity
    from fenics_contact._base.checkpoint import Checkpoint as Checkpoint
    from fenics_contact._base.checkpoint import Interrupted as Interrupted
    from fenics_contact._base.checkpoint import interruptible as interruptible
    from fenics_contact._base.files import CheckpointError as CheckpointError
    from fenics_contact._base.launching import clean_environment as clean_environment
    from fenics_contact._base.progress import PhaseTimer as PhaseTimer
    from fenics_contact._base.progress import show_progress as show_progress
    from fenics_contact._base.shared import once_a_machine as once_a_machine
    from fenics_contact._equilibrium.carried import TransferredState as TransferredState
    from fenics_contact._equilibrium.problem import ContactProblem as ContactProblem
    from fenics_contact._equilibrium.problem import solve_scene as solve_scene
    from fenics_contact._equilibrium.steps import LoadSequence as LoadSequence
    from fenics_contact._equilibrium.steps import solve_steps as solve_steps
    from fenics_contact._fem.model_checks import check_history_material as check_history_material
    from fenics_contact._fem.model_checks import check_hyperelastic as check_hyperelastic
    from fenics_contact._large_deformations.load_steps import AutomaticSteps as AutomaticSteps
    from fenics_contact._large_deformations.newton import TangentNewton as TangentNewton
    from fenics_contact._optimize.bundle_trust import minimize as minimize
    from fenics_contact._page.entry import result_page as result_page
    from fenics_contact._responses import DesignResponse as DesignResponse
    from fenics_contact._responses import SceneResponse as SceneResponse
    from fenics_contact._scene.automatic import AutomaticContact as AutomaticContact
    from fenics_contact._scene.body import Body as Body
    from fenics_contact._scene.constraints import ConstraintTerm as ConstraintTerm
    from fenics_contact._scene.constraints import LinearConstraint as LinearConstraint
    from fenics_contact._scene.fields import SampledField as SampledField
    from fenics_contact._scene.fields import Ufl as Ufl
    from fenics_contact._scene.fields import read_field as read_field
    from fenics_contact._scene.fluid import FluidPressure as FluidPressure
    from fenics_contact._scene.foundations import ElasticFoundation as ElasticFoundation
    from fenics_contact._scene.loads import BodyForce as BodyForce
    from fenics_contact._scene.loads import InitialStress as InitialStress
    from fenics_contact._scene.loads import PointForce as PointForce
    from fenics_contact._scene.loads import Pressure as Pressure
    from fenics_contact._scene.loads import ThermalStrain as ThermalStrain
    from fenics_contact._scene.loads import TotalForce as TotalForce
    from fenics_contact._scene.loads import Traction as Traction
    from fenics_contact._scene.loads import centrifugal as centrifugal
    from fenics_contact._scene.loads import gravity as gravity
    from fenics_contact._scene.loads import point_mass as point_mass
    from fenics_contact._scene.obstacles import DistanceObstacle as DistanceObstacle
    from fenics_contact._scene.obstacles import MovingObstacle as MovingObstacle
    from fenics_contact._scene.obstacles import RigidCylinder as RigidCylinder
    from fenics_contact._scene.obstacles import RigidPlane as RigidPlane
    from fenics_contact._scene.obstacles import RigidSphere as RigidSphere
    from fenics_contact._scene.obstacles import RigidTool as RigidTool
    from fenics_contact._scene.pairs import ContactPair as ContactPair
    from fenics_contact._scene.pairs import Coulomb as Coulomb
    from fenics_contact._scene.pairs import Surface as Surface
    from fenics_contact._scene.pairs import Tie as Tie
    from fenics_contact._scene.pairs import Tresca as Tresca
    from fenics_contact._scene.preloads import Preload as Preload
    from fenics_contact._scene.preloads import Section as Section
    from fenics_contact._scene.scene import LoadStep as LoadStep
    from fenics_contact._scene.scene import Scene as Scene
    from fenics_contact._scene.sectors import CyclicSymmetry as CyclicSymmetry
    from fenics_contact._scene.springs import Spring as Spring
    from fenics_contact._scene.supports import HoldCurrent as HoldCurrent
    from fenics_contact._scene.supports import RigidSurface as RigidSurface
    from fenics_contact._scene.supports import Roller as Roller
    from fenics_contact._scene.supports import Support as Support
    from fenics_contact._scene.supports import ToolMotion as ToolMotion
    from fenics_contact._scene.surface_laws import ClosureLaw as ClosureLaw
    from fenics_contact._scene.surface_laws import ClosureTable as ClosureTable
    from fenics_contact._scene.surface_laws import ExponentialClosure as ExponentialClosure
    from fenics_contact._scene.surface_laws import FrictionCurve as FrictionCurve
    from fenics_contact._scene.surface_laws import FrictionTable as FrictionTable
    from fenics_contact._scene.surface_laws import LinearClosure as LinearClosure
    from fenics_contact._scene.surface_laws import SlipTable as SlipTable
    from fenics_contact._scene.wear import Wear as Wear
    from fenics_contact._scene.wear import WearCurve as WearCurve
    from fenics_contact._scene.wear import WearTable as WearTable
    from fenics_contact._scene_file.entry import read_scene_file as read_scene_file
    from fenics_contact._wear.cycles import WearLimits as WearLimits
    from fenics_contact._wear.cycles import wear_to as wear_to
    from fenics_contact.design.design import SurfaceDesign as SurfaceDesign
    from fenics_contact.design.problem import ShapeProblem as ShapeProblem
    from fenics_contact.mesh.body_mesh import BodyMesh as BodyMesh
    from fenics_contact.mesh.partition import box_partition as box_partition
    from fenics_contact.output.paraview import write_vtu as write_vtu
    from fenics_contact.output.result import write_result as write_result
    from fenics_contact.qp.fixed_point import FixedPoint as FixedPoint
    from fenics_contact.readers.cad import read_cad as read_cad
    from fenics_contact.readers.meshio import read_mesh as read_mesh
    from fenics_contact.results.area import contact_area as contact_area
    from fenics_contact.results.area import contact_width as contact_width
    from fenics_contact.results.contact import Status as Status
    from fenics_contact.results.deformed_state import DeformedState as DeformedState
    from fenics_contact.results.deformed_state import NewtonSteps as NewtonSteps
    from fenics_contact.results.linear_state import LinearState as LinearState
    from fenics_contact.results.state import State as State
    from fenics_contact.results.state import Tolerance as Tolerance

if not requirements.for_the_program():  # which reports what is missing as its other errors
    requirements.check()  # that they exist; nothing is loaded or started before it is used

__version__ = "0.3.0"

#: Public modules.
_ROOMS = (
    "decks design errors fatigue feti gallery heat materials mesh output pictures qp readers results shapes "
    "study theory"
).split()

#: Modules of the names that users take from here.
_HOME = homes(__name__)

__all__ = [*_HOME, *_ROOMS, "__version__"]


def __getattr__(name: str) -> Any:
    """Load a public name, or a public module, on first use."""
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
    elif name in _ROOMS:
        return import_module(f"{__name__}.{name}")
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
