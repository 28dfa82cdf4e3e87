"""Multipliers of one torn system on the rows of another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._pairing.points import ContactPoints
from fenics_contact.feti.ties import matched, same_points
from fenics_contact.feti.torn import TornSystem


def carried_over(before: TornSystem, multiplier: np.ndarray, after: TornSystem) -> np.ndarray:
    """Return a start for the system after, owned: gluing forces, and contact forces in the new frames.

    Contact points are identified by pair and slave node; a new point starts open. Collective.
    """
    if before.decomposition.gluing is after.decomposition.gluing:
        start = np.zeros(len(after.numbering.owned))
        # Ties of a moved scene may have other points; gluing rows are unchanged.
        same = before.n_equality == after.n_equality
        gluing_old = before.numbering.owned < (before.n_equality if same else before.n_gluing)
        gluing_new = after.numbering.owned < (after.n_equality if same else after.n_gluing)
        start[gluing_new] = multiplier[gluing_old]
    else:
        start = _held_otherwise(before, multiplier, after)
    normal = before.numbering.gather(multiplier, before.normal_rows)
    tau = before.numbering.gather(multiplier, before.tangential_rows.ravel()).reshape(
        -1, before.components - 1
    )
    friction = np.zeros((before.points.count, before.components))
    if len(before.frictional):
        friction[before.frictional] = np.einsum("na,nad->nd", tau, before.points.tangents[before.frictional])
    put_contact(after, start, *(on_contacts(before, each, after) for each in (normal, friction)))
    return start


def on_contacts(before: TornSystem, values: np.ndarray, after: TornSystem) -> np.ndarray:
    """Return values of contact points, (n, ...), at those of the system after, zero at new ones.

    Points are identified by pair and slave node.
    """
    return matched(values, same_points(_renumbered(before, after), after.points))


def _held_otherwise(before: TornSystem, multiplier: np.ndarray, after: TornSystem) -> np.ndarray:
    """Return forces of gluing rows and ties where supports hold other components, owned. Collective.

    What supports carried that are released is left out: the rows b of gluing, b · 1 = 0, take none of it.
    """
    held = before.numbering.owned < before.n_gluing
    start = after.gluing_of(before.force(np.where(held, multiplier, 0.0)))
    for joint in after.groups.joints:
        for earlier in before.groups.of(type(joint)):
            kept = joint.carried(earlier, before.gathered(multiplier, earlier))
            _put(after, start, after.groups.rows_of(joint), kept)
    return start


def _renumbered(before: TornSystem, after: TornSystem) -> ContactPoints:
    """Return the contact points of a system, numbered as those of another one that may have other pairs."""
    old, new = ([(pair.slave, pair.master) for pair in each.scene.contacts] for each in (before, after))
    if len(old) == len(new):
        return before.points
    number = np.array([new.index(pair) if pair in new else len(new) + k for k, pair in enumerate(old)])
    pair = number[before.points.pair] if len(old) else before.points.pair
    return replace(before.points, pair=pair)


def put_contact(torn: TornSystem, vector: np.ndarray, normal: np.ndarray, friction: np.ndarray) -> None:
    """Write contact forces into an owned vector."""
    _put(torn, vector, torn.normal_rows, normal)
    if len(torn.frictional):
        turned = np.einsum("nad,nd->na", torn.points.tangents[torn.frictional], friction[torn.frictional])
        # Along tangents that supports hold at rest friction is rounding, which would turn slipping discs.
        slips = torn.groups.slips
        still = slips.held(torn.decomposition.fixed) & slips.resting
        turned[still.reshape(turned.shape)] = 0.0
        _put(torn, vector, torn.tangential_rows.ravel(), turned.ravel())


def _put(torn: TornSystem, vector: np.ndarray, rows: np.ndarray, values: np.ndarray) -> None:
    position = torn.numbering.owned_index(rows)
    vector[position[position >= 0]] = values[position >= 0]
