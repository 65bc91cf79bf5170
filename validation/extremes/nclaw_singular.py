"""What learned laws answer to deformation gradients that are degenerate or inverted, apart from any
run.

Answers turn with the body where R of F = R S is determined (NCLAW-eq22 to NCLAW-eq37). It is not
where two stretches have no sum, s_i + s_j = 0 (`core.spectral.UNDETERMINED`): of rank 1 or less, or
inverted with s_2 = -s_1.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.core.spectral import UNDETERMINED
from mpm_ref.explicit import deform_body, initial_stress
from mpm_ref.materials.learned.invariants import spectrum
from mpm_ref.materials.learned.strain_range import excess, strain_measures
from mpm_ref.nclaw.bodies import deformation_gradients, kirchhoff_stresses, material_points
from mpm_ref.nclaw.strain_watch import MAX_EXCESS
from mpm_ref.scene import build

from ..common.registry import experiment
from ..nclaw.environments import environment
from .nclaw_runs import laws

SAME = 1e-13        # of an answer, times how near R is to undetermined: as good as the same
FEW = 1e-3          # of 1/round-off, up to which R is determined
DRAWS = 20          # of each kind, turned at random
KINDS = {           # singular values, times a random rotation on either side
    "rest": (1.0, 1.0, 1.0), "swollen": (1.1, 1.1, 1.1), "pressed": (0.5, 0.5, 0.5),
    "flat": (1.0, 1.0, 0.0), "nearly flat": (1.0, 1.0, 1e-9), "a line": (1.0, 0.0, 0.0),
    "nearly a line": (1.0, 1e-9, 1e-9), "a point": (0.0, 0.0, 0.0), "tiny": (1e-9, 1e-9, 1e-9),
    "inverted": (1.0, 0.9, -0.1), "mirrored": (1.1, 1.0, -0.9), "all inverted": (1.0, 1.0, -1.0),
    "large": (10.0, 1.0, 0.1), "huge": (1e3, 1e3, 1e3), "enormous": (1e6, 1.0, 1e-6)}
COLUMNS = ("law", "F", "determined", "finite", "turns", "returned_turns", "stress", "true_stress",
           "moved", "true_moved", "beyond")


class Answers(NamedTuple):
    """What a law and a flow answer to F (n, d, d)."""

    tau: np.ndarray     # (n, d, d) [Pa]
    F: np.ndarray       # (n, d, d) what is left of a trial F


def turns(rng, n):
    """Random rotations (n, 3, 3)."""
    Q = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    return Q * np.sign(np.linalg.det(Q))[:, None, None]


def asked(s, rng):
    """F (DRAWS, 3, 3) of singular values s."""
    return turns(rng, DRAWS) @ np.diag(s) @ turns(rng, DRAWS)


def answered(of, F):
    """`Answers` of (law, flow)."""
    with np.errstate(all="ignore"):
        body, again = material_points(*of, F), material_points(*of, F)
        initial_stress(body)
        deform_body(again, 1.0)
        return Answers(kirchhoff_stresses(body).copy(), deformation_gradients(again).copy())


def off(found, expected, unit):
    """Largest difference of matrices (n, d, d) at each point (n,), of the largest entry there, or
    of a unit if that is larger; infinite for what is not finite.
    """
    size = np.maximum(np.abs(expected).max(axis=(1, 2)), unit)
    apart = np.abs(found - expected).max(axis=(1, 2)) / size
    return np.where(np.isfinite(apart), apart, np.inf)


def turned(of, F, rng):
    """How far the answers at Q F are from those at F, turned: of the stress, and of the flow. Where
    R is determined that is over what round-off in F makes of R, s_0/(s_1 + s_2).
    """
    Q, here = turns(rng, len(F)), answered(of, F)
    there = answered(of, Q @ F)
    with np.errstate(invalid="ignore"):
        apart = (off(there.tau, Q @ here.tau @ Q.swapaxes(1, 2), of[0].wave),
                 off(there.F, Q @ here.F, 1.0))
    near = np.maximum(nearness(F), 1.0) if determined(F) else 1.0
    return tuple(float((a / near).max()) for a in apart)


def nearness(F):
    """s_0/(s_1 + s_2) (n,), infinite where R is not determined; 1/2 at rest."""
    s = spectrum(F).s
    with np.errstate(divide="ignore", invalid="ignore"):
        near = s[:, 0] / (s[:, 1] + s[:, 2])
    return np.where(near < FEW / UNDETERMINED, near, np.inf)


def determined(F):
    """Whether R is determined at all points, by more than round-off."""
    return bool(np.isfinite(nearness(F)).all())


def size(a):
    """Largest norm of matrices (n, d, d)."""
    return float(np.linalg.norm(a, axis=(1, 2)).max())


def row(of, true, F, bounds, rng):
    """What stands in the table about a kind of F: of (law, flow), learned and true."""
    own, theirs = answered(of, F), answered(true, F)
    finite = bool(np.isfinite(own.tau).all() and np.isfinite(own.F).all())
    return (int(determined(F)), int(finite), *turned(of, F, rng), size(own.tau), size(theirs.tau),
            size(own.F - F), size(theirs.F - F), float(excess(strain_measures(F), bounds).max()))


@experiment("extremes.nclaw.singular", title="NCLaw: degenerate and inverted deformation gradients",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 40})
def singular(run):
    """Answers must be finite, turn with the body, and be known to be guesses."""
    for law in laws(run):
        made = law.make(build(environment(law.environment)).bodies[0])
        own = build(environment(law.environment)).bodies[0]
        rows = {name: row((made.law, made.flow), (own.law, own.flow), asked(s, run.rng),
                          law.bounds, run.rng) for name, s in KINDS.items()}
        record_answers(run, law.name, {name: dict(zip(COLUMNS[2:], one, strict=True))
                                       for name, one in rows.items()})
        run.table(f"answers-{law.name}", COLUMNS[1:], [(name, *one) for name, one in rows.items()])


def record_answers(run, name, found):
    """Record which answers are finite, which turn, and whether the watch knows them for guesses."""
    scale = f"{len(found)} kinds of F, {DRAWS} of each"
    sound = [one["finite"] for one in found.values()]
    run.record(f"extremes.nclaw.singular.{name}.finite", float(np.mean(sound)), paper=1.0,
               comparator="=", scale=scale, note="share of kinds; not: "
               + (", ".join(kind for kind, one in found.items() if not one["finite"]) or "none"))
    for words, some, rule in (
            ("turns", {k: o for k, o in found.items() if o["determined"]},
             {"comparator": "<=", "bound": SAME}),
            ("turns_undetermined", {k: o for k, o in found.items() if not o["determined"]},
             {"comparator": "info"})):
        worst = max(some, key=lambda kind: max(some[kind]["turns"], some[kind]["returned_turns"]))
        run.record(f"extremes.nclaw.singular.{name}.{words}",
                   max(some[worst]["turns"], some[worst]["returned_turns"]), scale=scale,
                   note=f"largest difference between what is answered to Q F, and the answer to F "
                        f"turned, of the answer: {worst}", **rule)
    guesses = {kind: one for kind, one in found.items() if one["beyond"] > MAX_EXCESS}
    worst = max(guesses, key=lambda kind: guesses[kind]["stress"])
    run.record(f"extremes.nclaw.singular.{name}.guesses", len(guesses), unit="kinds",
               comparator="info", scale=scale, note="out of the bounds of strains; the largest "
               f"stress is {guesses[worst]['stress']:.3g} Pa, the true one "
               f"{guesses[worst]['true_stress']:.3g} Pa: {worst}")
