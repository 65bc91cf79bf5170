"""Export of trained laws to other programs: layers and constants as plain arrays, formulas as text,
and pairs of inputs and outputs to test an implementation by.

A reader needs no code of this package: the formula of each kind is part of the export;
docs/reference/studies.md lists the names.
"""

import json
from itertools import product
from pathlib import Path

import numpy as np

from ..explicit import deform_body, initial_stress
from ..materials import (
    DruckerPrager,
    FixedCorotated,
    Fluid,
    FluidProjection,
    Hencky,
    NoFlow,
    VonMises,
)
from ..materials.learned import (
    contraction,
    energetic,
    learned_flow,
    learned_law,
    response,
    spline,
)
from ..materials.learned.contraction import Contraction
from ..materials.learned.energetic import Energetic
from ..materials.learned.invariants import invariants, spectrum
from ..materials.learned.stretch_network import ReleasedStretchStress, StretchStress
from ..materials.learned.weights import PARTS, dim_of
from ..store.atomic import write_bytes
from ..store.weights_file import pack
from .bodies import deformation_gradients, kirchhoff_stresses, material_points

FORMAT = "mpm_ref law 1"
THETA = "theta = sum_i log s_i"
SPREAD, RANDOM, SEED = 0.1, 24, 0       # of the components of F - I in questions; how many; draw
OF_F = ("F = U diag(s) V^T, det U = det V = +1, s descending, the last with the sign of det F; "
        "R = U V^T")
LAYERS = "a <- a W_l + b_l, {} between layers"
GELU = LAYERS.format("gelu(z) = z (1 + erf(z / sqrt 2)) / 2")
ELU = LAYERS.format("elu(z) = z where z > 0, else exp(z) - 1")
SOFTPLUS = LAYERS.format("softplus(z) = log(1 + exp z)")
TURNED = f"{GELU}; Y = the last a, row by row; T = (Y + Y^T) / 2"
STRETCHES = f"{ELU}, y = the last a; tau = U diag(unit y s) U^T"
SPLINES = ("tau = U diag(y s) U^T, y_i = f(s_i) + sum over j != i of g(s_i s_j) s_j + h(J) J/s_i; "
           "tables[0], [1], [2] are f, g, h [Pa]: piece p, of as many breaks below x, is the sum "
           "over m of tables[., p, m] (x - origins[p])^(3 - m)")
KNOWN = "the law of that name in mpm_ref/materials, with these constants"
ANSWERS = {     # kind -> formula from its inputs to its output
    response.Stress: f"{TURNED}; tau = unit R T F^T",
    response.SymmetricStress: f"{TURNED}; tau = unit R T R^T",
    response.PlainStress: f"{TURNED}; tau = unit Y F^T",
    response.Correction: f"{TURNED}; F = F_trial + alpha R T, R of F_trial",
    response.PlainCorrection: f"{TURNED}; F = F_trial + alpha Y",
    ReleasedStretchStress: f"{STRETCHES}; where two stretches are equal, tau depends on "
                           "the axes that a decomposition picks",
    StretchStress: f"{STRETCHES}; y is the mean over all orders in which s is read, each "
                   "y_i at the place of its s_i",
    spline.SplineStress: SPLINES,
    spline.ReleasedSplineStress: SPLINES,
    Energetic: f"{SOFTPLUS}; g_k = d a_last / d (number k that is read), J = det F, b = F F^T; "
               "tau = unit (g_0 2 (b - I) + g_1 (2 (tr(b) b - b b) - 4 I) + g_2 2 J (J - 1) I + "
               "g_3 (J - 1) I)",
    Contraction: f"{GELU}; (a, b) = softplus of the last a, softplus(z) = log(1 + exp z); of "
                 "F_trial: theta = sum_i log s_i, e_i = log s_i - theta / 3; F = U diag(exp(exp(-a)"
                 " e_i + theta' / 3)) V^T, theta' = exp(-b) theta where theta > 0, else theta",
    NoFlow: "F = F_trial",
    **dict.fromkeys((FixedCorotated, Hencky, Fluid, DruckerPrager, VonMises, FluidProjection),
                    KNOWN),
}


def export_tables(laws):
    """Return {"format", "dim", "decomposition", "about", "elastic", "plastic", "check"} of
    `LearnedLaws`: texts, numbers, arrays, and tables of them.
    """
    d = dim_of(laws)
    return {"format": FORMAT, "dim": d, "decomposition": OF_F, "about": laws.about,
            **{part: part_of(getattr(laws, part), d) for part in PARTS},
            "check": check_pairs(laws, questions(d))}


def part_of(weights, d):
    """Return the table of a law: kind, inputs, formula, constants and layers."""
    kind = weights.kind
    constants = kind._asdict()
    if type(kind) in spline.READINGS:
        constants = learned_law(weights)._asdict()
    else:
        for k, (W, b) in enumerate(weights.layers):
            constants |= {f"W{k}": W, f"b{k}": b}
    return {"kind": type(kind).__name__, "answers": ANSWERS[type(kind)],
            "reads": input_labels(weights, d), **constants}


def questions(d):
    """Return the deformation gradients (n, d, d): rest, a turn, stretched, sheared, compressed;
    then random ones, each turned at random.
    """
    rng = np.random.default_rng(SEED)
    rest, turn = np.eye(d), np.eye(d)
    turn[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    stretched, sheared = rest.copy(), rest.copy()
    stretched[0, 0] += SPREAD
    sheared[0, 1] += SPREAD
    drawn = rest + SPREAD * rng.normal(size=(RANDOM, d, d))
    turns = np.linalg.qr(rng.normal(size=(RANDOM, d, d)))[0]
    turns[np.linalg.det(turns) < 0.0, :, 0] *= -1.0
    return np.array([rest, turn, stretched, sheared, (1.0 - SPREAD) * rest, *(turns @ drawn)])


def check_pairs(laws, F):
    """Return F (n, d, d) with the outputs of both laws and the inputs of their first layers."""
    law, flow = learned_law(laws.elastic), learned_flow(laws.plastic)
    elastic, plastic = material_points(law, NoFlow(), F), material_points(law, flow, F)
    initial_stress(elastic)
    deform_body(plastic, 1.0)
    return {"F": F, "elastic_read": input_values(laws.elastic, F),
            "tau": kirchhoff_stresses(elastic), "plastic_read": input_values(laws.plastic, F),
            "returned": F if isinstance(flow, NoFlow) else deformation_gradients(plastic)}


def flatten_tables(tables, path=""):
    """Return {name: text, number or array} of nested tables, names joined by "_"; lists of words
    become arrays, `about` JSON.
    """
    result = {}
    for key, value in tables.items():
        name = f"{path}_{key}" if path else key
        if key == "about":
            value = json.dumps(value)
        nested = isinstance(value, dict)
        result |= flatten_tables(value, name) if nested else {name: np.asarray(value)}
    return result


def write(path, tables):
    """Write the tables of `export_tables`, JSON or npz as the name says, whole or not at all.

    Raises OSError where the system refuses.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        content = json.dumps(tables, indent=1, default=lambda a: a.tolist()).encode()
    else:
        content = pack(flatten_tables(tables))
    write_bytes(path, content)


def input_labels(weights, d):
    """Return labels for the inputs of the first layer of `LawWeights` in d dimensions; none without
    a network.
    """
    kind = weights.kind
    if isinstance(kind, Energetic):
        return ["|F|^2 - 3 - 2 log J", "|cof F|^2 - 3 - 4 log J", "(J - 1)^2", "J - 1 - log J"]
    if isinstance(kind, Contraction):
        parts = "|log s - theta / 3|", "max(theta, 0)", "max(-theta, 0)"
        return [f"log(1 + {part} / strain), {THETA}" for part in parts]
    if isinstance(kind, StretchStress | ReleasedStretchStress):
        return stretch_labels(d)
    if not weights.layers or len(weights.layers) == 1:
        return []
    if reads_gradient(weights, d):
        return [f"F_{index}" for index in component_labels(d)]
    return [*stretch_labels(d), *(f"(F^T F)_{index}" for index in component_labels(d)), "det F - 1"]


def stretch_labels(d):
    """Return labels for the stretches, in descending order, without their value at rest."""
    return [f"s_{i} - 1" for i in range(d)]


def component_labels(d):
    """Return labels for the components of a matrix, row by row, without those of I."""
    return [f"{i}{j} - 1" if i == j else f"{i}{j}" for i, j in product(range(d), repeat=2)]


def reads_gradient(weights, d):
    """Return whether a network reads F - I, and no invariants."""
    return len(weights.layers[0][0]) == d * d


def input_values(weights, F):
    """Return the numbers (n, inputs) that the first layer of `LawWeights` reads at F (n, d, d)."""
    n, d, _ = F.shape
    kind, factors = weights.kind, spectrum(F)
    if not input_labels(weights, d):
        return np.empty((n, 0))
    if isinstance(kind, Energetic):
        return energetic.measures_of(F)
    if isinstance(kind, Contraction):
        return contraction.strains_of(factors, kind)
    if isinstance(kind, StretchStress | ReleasedStretchStress):
        return factors.s - 1.0
    if reads_gradient(weights, d):
        return (F - np.eye(d)).reshape(n, -1)
    return invariants(F, factors)
