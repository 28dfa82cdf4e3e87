"""Quantities that are resultants: the force of a contact pair, of a support; and the area that sticks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NoReturn

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, unit_vector
from fenics_contact._pairing.points import NodeNumbers
from fenics_contact._scene.local_axes import free_part
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import Partials, Weighable, require_linear
from fenics_contact.design.objectives import on_rows, require_pair
from fenics_contact.design.sensitivity import forces_by_places
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.averages import at_copies
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.area import contact_area, stick_area
from fenics_contact.results.forces import support_shares
from fenics_contact.results.state import State


@dataclass(frozen=True)
@checked()
class PairForce(Weighable):
    """J = d · Σ (n_i λ_i − t_i τ_i), the force of a contact pair on its slave along a direction, [force].

    Without derivatives by the shape.
    """

    can_be_infinite = False

    pair: int
    direction: GivenVector

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the force; raises InvalidInputError if there is no such pair."""
        require_pair(state.scene, "PairForce", self.pair)
        mine = state.contact.on_pair(self.pair)
        return float((state.contact.force[mine] @ self._along(state)).sum())

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂λ_i = d·n_i, ∂J/∂τ_i = −d·t_i; raises as `value` does."""
        _require_fixed_shape(self, forms)
        value, points, along = self.value(state, forms), state.contact.points, self._along(state)
        normal, tangential = np.zeros(points.count), np.zeros((points.count, points.tangents.shape[1]))
        mine = state.contact.on_pair(self.pair)
        normal[mine] = points.normal[mine] @ along
        tangential[mine] = -points.tangents[mine] @ along
        turned = forces_by_places(state, self.pair, along)
        return Partials.of(state, value, by_multiplier=on_rows(state, normal, tangential), **turned)

    def _along(self, state: State) -> np.ndarray:
        return np.array(unit_vector("PairForce.direction", self.direction, state.scene.components))


@dataclass(frozen=True)
@checked()
class SupportForce(Weighable):
    """J = d · R, the force that the supports of a surface exert on a body along a direction, [force].

    With the part V of the virtual displacement d that the supports hold it is R·d = V·(−Bᵀλ), less what
    contacts and ties exert there: a linear function of the multipliers. Without derivatives by the shape.
    """

    can_be_infinite = False

    body: str
    surface: str
    direction: GivenVector

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the force. Collective."""
        along, reactions = self._along(state), state.reactions()
        return float(sum(reactions[number].force @ along for number in self._numbers(state)))

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by the multipliers. Collective; raises as `value` does."""
        _require_fixed_shape(self, forms)
        value, torn = self.value(state, forms), state.torn
        held = self._held(state)
        normal = -np.einsum("nd,nd->n", torn.points.normal, torn.points.relative(held))
        tangential = np.einsum("nad,nd->na", torn.points.tangents, torn.points.relative(held))
        by_multiplier = on_rows(state, normal, tangential) - torn.jump(at_copies(torn.decomposition, held))
        return Partials.of(state, value, by_multiplier=by_multiplier + _of_joints(torn, held))

    def _numbers(self, state: State) -> list[int]:
        scene = state.scene
        found = [k for k, s in enumerate(scene.supports) if (s.body, s.surface) == (self.body, self.surface)]
        if not found:
            known = sorted({f"{support.body} {support.surface}" for support in scene.supports})
            raise InvalidInputError(
                f"SupportForce needs a supported surface, got {f'{self.body} {self.surface}'!r}: the scene's "
                f"supports hold {', '.join(map(repr, known)) or 'none'}"
            )
        if scene.bodies[self.body].is_rigid:
            raise InvalidInputError(
                f"SupportForce needs a support of a body that deforms, {self.body!r} is a rigid tool: take "
                "the force of its contact pair"
            )
        return found

    def _along(self, state: State) -> np.ndarray:
        return np.array(unit_vector("SupportForce.direction", self.direction, state.scene.components))

    def _held(self, state: State) -> np.ndarray:
        """Return the virtual displacement d of all nodes as far as these supports hold it, (n_nodes, dim)."""
        decomposition, along = state.torn.decomposition, self._along(state)
        shares = support_shares(state.scene, NodeNumbers.of(state.scene))
        total = np.zeros((decomposition.tearing.n_nodes, len(along)))
        for share in (shares[k] for k in self._numbers(state)):
            part = share.components * along
            part[share.nodes] = np.einsum("nde,d->ne", share.matrices, along)
            total += part
        every = np.arange(len(total))
        return np.asarray(total - free_part(total, every, decomposition.fixed, decomposition.axes))


def _of_joints(torn: TornSystem, held: np.ndarray) -> np.ndarray:
    """Return the derivative by the multipliers of joints of what these exert on held nodes, owned."""
    result = np.zeros(torn.groups.total)
    for joint in torn.groups.joints:
        acting = np.where(joint.held(torn.decomposition.fixed), 0.0, joint.measured(held))
        result[torn.groups.rows_of(joint)] = acting
    return result[torn.numbering.owned]


def _require_fixed_shape(objective: object, forms: ShapeForms) -> None:
    if not forms.nothing_moves:
        raise InvalidInputError(
            f"{type(objective).__name__} has no derivative by the shape: take ContactForces, Movement or an "
            "energy as the objective of a design"
        )


class _AreaOfStatuses(Weighable):
    """An area that changes by the statuses of points, not smoothly: it has no derivatives."""

    can_be_infinite = False

    #: Why there is no adjoint.
    without_adjoint: ClassVar[str] = "an area changes by the statuses of points, not smoothly"
    #: What has derivatives in its place, in words.
    instead: ClassVar[str]

    def partials(self, state: State, forms: ShapeForms) -> NoReturn:
        """Raise InvalidInputError."""
        raise InvalidInputError(
            f"{type(self).__name__} has no derivatives: {self.without_adjoint}; take {self.instead}"
        )


@dataclass(frozen=True)
@checked()
class TouchingArea(_AreaOfStatuses):
    """J, the area in which surfaces touch, see `fenics_contact.contact_area`; no derivatives."""

    pair: int | None = None

    instead: ClassVar[str] = "ContactArea, an effective area that is smooth"

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the area. Collective."""
        if self.pair is not None:
            require_pair(state.scene, "TouchingArea", self.pair)
        every = range(len(state.scene.contacts)) if self.pair is None else [self.pair]
        return sum(contact_area(state, number) for number in every)


@dataclass(frozen=True)
@checked()
class StickArea(_AreaOfStatuses):
    """J, the area of a pair that sticks, see `fenics_contact.results.area.stick_area`; no derivatives."""

    pair: int

    instead: ClassVar[str] = "FrictionWork, which tends to zero as slip does"

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the area. Collective; raises InvalidInputError if the pair has no friction."""
        require_linear(state, self)
        require_pair(state.scene, "StickArea", self.pair)
        if not state.scene.contacts[self.pair].has_friction:
            raise InvalidInputError(
                f"StickArea needs friction, contact pair {self.pair} has none: give it Coulomb or Tresca "
                "friction, or take TouchingArea"
            )
        return stick_area(state, self.pair)
