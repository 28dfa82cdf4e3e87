"""Semismooth Newton on faces: guess which constraints hold, solve the linear face, correct the guess."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp.certify import certify
from fenics_contact.qp.face import Face, classify
from fenics_contact.qp.face_system import FaceSystem, FaceSystems
from fenics_contact.qp.pcg import FaceStep, projected_cg
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.residual import Residuals, contact_step, measure
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import DualSolution, SolverStep
from fenics_contact.qp.start import Start


@dataclass(frozen=True)
class FaceNewton:
    tolerance: float = 1e-6
    max_steps: int = 100
    max_products: int = 5000
    forcing: float = 0.1
    loosest: float = 0.1
    rho: float = 1.0
    adapt: bool = True

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        history: list[SolverStep] = []
        systems = FaceSystems(problem, start.operator)
        rho = self.rho*contact_step(problem.layout, problem.diagonal)
        lam, product, residual, residuals = start.multiplier, start.product, start.residual, start.residuals
        face = None
        for k in range(self.max_steps):
            psi = law.bound(lam)
            new = classify(problem.layout, psi, lam, residual, rho)
            if face is not None and self.adapt:
                flip = new.slip & face.slip & (np.einsum('ia,ia->i', new.direction, face.direction) < 0)
                rho[problem.layout.tangential[flip]] *= 0.3
                if flip.any():
                    new = classify(problem.layout, psi, lam, residual, rho)
            changes = -1 if face is None else round(float(global_sum(problem.comm, face.changes(new))[0]))
            face = new
            system = systems.build(face)
            entered = system.enter(lam)
            move = entered - lam
            if problem.norm(move) > 0:
                product = product + start.operator(move)
            lam = entered
            g = system.gradient(lam, product - problem.rhs)
            w = self.weights(problem, face, residuals, rho)
            tol = max(min(self.loosest, self.forcing * residuals.worst), 0.3 * self.tolerance)
            out = projected_cg(system, g, w, tol, self.max_products - start.operator.products)
            lam = lam + face.prolong(out.step)
            product = product + out.product
            flexed = product - problem.rhs
            alpha = system.coarse.coefficients(system.gradient(lam, flexed))
            residual = flexed - problem.coarse.transpose(alpha)
            residuals = measure(problem, law.feasible(lam), lam, product, residual)
            n = [round(float(v)) for v in global_sum(problem.comm, face.closed.sum(), face.stick.sum(), face.slip.sum())]
            history.append(SolverStep("face Newton", k, start.operator.products, residuals, *n, f"{out.iterations} its, {changes} changes, {out.stop.value}, rank {system.coarse.gram.rank}/{system.coarse.m}"))
            if residuals.within(self.tolerance):
                c = certify(problem, start.operator, law, lam, residual)
                if c.residuals.within(self.tolerance):
                    return c.solution(problem, history, start.operator.products, start.memory)
                product, residual, residuals = c.product, c.residual, c.residuals
        raise ConvergenceError("no", history)

    def weights(self, problem, face, residuals, rho):
        n_e = len(problem.layout.equality)
        w = np.empty(face.n_face)
        gs, fs = residuals.gluing_scale, residuals.force_scale
        w[:n_e] = 1 / gs if gs > 0 else 1.0
        rest = abs(face.restriction[:, n_e:])
        r = (rest.T @ rho) / np.maximum(np.asarray(rest.sum(axis=0)).ravel(), 1e-300)
        w[n_e:] = r / fs if fs > 0 else 1 / gs
        return w * face.damping**2
