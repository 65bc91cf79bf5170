"""The true laws with their constants trained, the paper's oracle "sys-id" (NCLAW-eq4).

The unknowns are the logarithm of Young's modulus and that of the return map's constant, yield
stress or slope of the cone; Poisson's ratio is given. As in the authors' release log E starts at
START of its value (1e5 Pa at 1e4), yield stress and friction angle at START of theirs. In the
release these two are trained without a logarithm, and the return map has a modulus of its own,
which cannot be identified together with a yield stress. Adjoints are those of
`core.adjoint.deform`.
"""

from math import log

import numpy as np
import torch
from torch import nn
from torch.autograd import Function

from ...core import deform
from ...core.adjoint import deform as deform_adjoint
from ...core.adjoint.deform import DeformBars, DeformStep
from ...core.jit import CHUNKS
from ...core.state import NO_HISTORY, NONE, Particles
from ...materials import NoFlow
from ...materials.learned.weights import LawWeights
from .neural_laws import NoFlowModule
from .rollout import LawPair

START = 0.8


class MaterialFunction(Function):
    """F (n, d, d), constants (c,) of a law, then of a flow -> tau, or F after the return map.

    kinds: types of law and flow; with NoFlow the output is tau.
    """

    @staticmethod
    def forward(ctx, F, constants, kinds):
        """Return tau or F."""
        law, flow = ctx.records = records(constants.tolist(), kinds)
        ctx.F, like = F.contiguous().numpy(), axes(F)
        q = particles(ctx.F.copy(), np.zeros(F.shape))
        if isinstance(flow, NoFlow):
            deform.initial_stress(q, law, flow, like)
            return torch.from_numpy(q.tau)
        deform.plastic(q, law, flow, 0.0, like)
        return torch.from_numpy(q.F)

    @staticmethod
    def backward(ctx, G):
        """Return the gradients of F and of the constants."""
        (law, flow), G, zero = ctx.records, G.contiguous().numpy(), np.zeros(G.shape)
        sums = np.zeros((CHUNKS, len(law) + len(flow)))
        if isinstance(flow, NoFlow):
            bars = DeformBars(zero, G, zero, NO_HISTORY, NONE)
            deform_adjoint.initial_stress(ctx.F, NO_HISTORY, bars, law, flow, sums)
        else:
            bars = DeformBars(G.copy(), zero, zero.copy(), NO_HISTORY, NONE)
            at_rest = DeformStep(ctx.F, NO_HISTORY, zero, sums, 0.0)
            deform_adjoint.plastic(at_rest, bars, law, flow)
        return torch.from_numpy(bars.F), torch.from_numpy(sums.sum(axis=0)), None


def axes(F):
    """Return a tuple of length d."""
    return tuple(range(F.shape[-1]))


def particles(F, tau):
    """Return the `Particles` at rest, of which deformation reads F and changes F and tau."""
    still, at = np.zeros_like(F), np.zeros(F.shape[:2])
    return Particles(at, at, still, still, F, tau, at[:, 0].copy(), at[:, 0].copy(), NO_HISTORY,
                     NONE)


def records(constants, kinds):
    """Return the law and the flow of constants in a row."""
    law, flow = kinds
    moduli = len(law._fields)
    return law(*constants[:moduli]), flow(*constants[moduli:])


class IdentifiedLaw(nn.Module):
    """F (n, d, d) -> tau (n, d, d) of a law with a learned log E.

    unit: the law's record for E = 1 Pa; log_E: where it begins.
    """

    def __init__(self, unit, log_E):
        super().__init__()
        self.law, self.unit = type(unit), torch.tensor([*unit], dtype=torch.float64)
        self.log_E = nn.Parameter(torch.tensor(log_E, dtype=torch.float64))

    def extra_repr(self):
        """Return the law for E = 1 Pa."""
        return repr(self.law(*self.unit.tolist()))

    def moduli(self):
        """Return the constants of the law [Pa]."""
        return self.log_E.exp() * self.unit

    def forward(self, F):
        """Return tau (n, d, d) [Pa]."""
        return MaterialFunction.apply(F, self.moduli(), (self.law, NoFlow))

    def weights(self):
        """Return `LawWeights` without layers: the law's record."""
        return LawWeights((), self.law(*self.moduli().tolist()))


class IdentifiedFlow(nn.Module):
    """F (n, d, d) -> F after the return map of a flow whose first constant, if any, is learned.

    elastic: the `IdentifiedLaw` whose moduli it reads; flow: its record as it begins.
    """

    def __init__(self, elastic, flow):
        super().__init__()
        self.moduli, self.kinds = elastic.moduli, (elastic.law, type(flow))
        row = torch.tensor([*flow], dtype=torch.float64)
        self.log_own, self.fixed = nn.Parameter(row[:1].log()), row[1:]

    def extra_repr(self):
        """Return the flow, and those of its constants that are not learned."""
        return f"{self.kinds[1].__name__}, {self.fixed.tolist()}"

    def constants(self):
        """Return the constants of the flow."""
        return torch.cat([self.log_own.exp(), self.fixed])

    def forward(self, F):
        """Return F after the return map."""
        return MaterialFunction.apply(F, torch.cat([self.moduli(), self.constants()]), self.kinds)

    def weights(self):
        """Return `LawWeights` without layers: the flow's record."""
        return LawWeights((), self.kinds[1](*self.constants().tolist()))


def identified_laws(unit, E, flow):
    """Return the `LawPair` before training.

    unit: the record of the law for 1 Pa; E: its true modulus [Pa]; flow: the record of the return
    map as it begins.
    """
    elastic = IdentifiedLaw(unit, START * log(E))
    plastic = NoFlowModule() if isinstance(flow, NoFlow) else IdentifiedFlow(elastic, flow)
    return LawPair(elastic, plastic)
