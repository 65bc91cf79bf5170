"""Energy that laws dissipate or create: the work of deformation on material points.

    w = integral of P : dF from F to F_trial,    P = tau F^-T

is the work of a step per rest volume, before the return map. For a law with an energy it is the
difference of psi, to the error of the quadrature (Simpson's, along the straight line), and over any
number of steps

    sum of w = psi(end) - psi(start) + D,    D = sum of psi(F_trial) - psi(F) over the returns

Thermodynamics requires D >= 0. So from rest, where psi is least, no path gains energy; on a closed
path, whose total deformation returns to its start, W = sum of w < 0 means that a law creates
energy. This test needs no psi, so that it applies to any law, as does

    D of a return = integral of P : dF from F back to F_trial = integral of tau : l_p
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..explicit import deform_body, initial_stress
from ..materials import NoFlow
from .bodies import deformation_gradients, kirchhoff_stresses, material_points

SIMPSON = ((0.0, 1.0 / 6.0), (0.5, 4.0 / 6.0), (1.0, 1.0 / 6.0))    # places and weights


class Balance(NamedTuple):
    """The work and dissipation of paths, per rest volume."""

    work: np.ndarray        # (n,) sum of w [J/m^3]
    exchanged: np.ndarray       # (n,) sum of |w| [J/m^3]
    taken: np.ndarray       # (n,) sum of D of the returns [J/m^3]
    least: np.ndarray       # (n,) the least of these D [J/m^3]

    @property
    def share(self):
        """W over the energy exchanged (n,), in [-1, 1]; 0 where none was."""
        return np.divide(self.work, self.exchanged, out=np.zeros_like(self.work),
                         where=self.exchanged != 0.0)


def loops(n, size, steps, rng):
    """Return closed paths (steps + 1, n, 3, 3) of the whole deformation, ellipses in random
    directions of all nine components:

        G(t) = I + size (A sin(2 pi t) + B (1 - cos(2 pi t))/2),    |A| = |B| = 1
    """
    A, B = (a / np.linalg.norm(a, axis=(1, 2), keepdims=True)
            for a in rng.normal(size=(2, n, 3, 3)))
    t = 2.0 * np.pi * np.linspace(0.0, 1.0, steps + 1)[:, None, None, None]
    return np.eye(3) + size * (np.sin(t) * A + 0.5 * (1.0 - np.cos(t)) * B)


def balance(law, flow, G):
    """Return the `Balance` of points that start at rest and follow G (k + 1, n, 3, 3), from I
    on.
    """
    F, costs, taken = np.tile(np.eye(3), (G.shape[1], 1, 1)), [], []
    for before, after in pairwise(G):
        trial = after @ np.linalg.inv(before) @ F
        costs.append(work(law, F, trial))
        F = returned(law, flow, trial)
        taken.append(work(law, F, trial))
    costs, taken = np.array(costs), np.array(taken)
    return Balance(costs.sum(axis=0), abs(costs).sum(axis=0), taken.sum(axis=0), taken.min(axis=0))


def work(law, F, after):
    """Return w (n,) [J/m^3] from F to `after`, both (n, 3, 3), by an elastic law."""
    return sum(share * np.einsum("pij,pij->p", first_piola(law, F + place * (after - F)), after - F)
               for place, share in SIMPSON)


def first_piola(law, F):
    """Return P (n, 3, 3) [Pa] of F (n, 3, 3)."""
    body = material_points(law, NoFlow(), F)
    initial_stress(body)
    return kirchhoff_stresses(body) @ np.linalg.inv(F).swapaxes(1, 2)


def returned(law, flow, trial):
    """Return F (n, 3, 3) after the return of trial ones."""
    if isinstance(flow, NoFlow):
        return trial
    body = material_points(law, flow, trial)
    deform_body(body, 0.0)
    return deformation_gradients(body)
