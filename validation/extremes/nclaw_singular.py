"""Evaluate learned laws, outside of any run, at degenerate and inverted deformation gradients.

Stress and returned F rotate with the body where R of F = R S is determined (NCLAW-eq22 to
NCLAW-eq37). R is undetermined where two stretches have no sum, s_i + s_j = 0
(`core.spectral.UNDETERMINED`): F is of rank 1 or less, or inverted with s_2 = -s_1.
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

EQUAL_WITHIN = 1e-13        # of a value, times the condition of R
LARGEST_CONDITION = 1e-3    # of 1/round-off, up to which R is determined
DRAWS = 20          # of each kind, with random rotations
KINDS = {           # singular values, times a random rotation on either side
    "rest": (1.0, 1.0, 1.0), "swollen": (1.1, 1.1, 1.1), "pressed": (0.5, 0.5, 0.5),
    "flat": (1.0, 1.0, 0.0), "nearly flat": (1.0, 1.0, 1e-9), "a line": (1.0, 0.0, 0.0),
    "nearly a line": (1.0, 1e-9, 1e-9), "a point": (0.0, 0.0, 0.0), "tiny": (1e-9, 1e-9, 1e-9),
    "inverted": (1.0, 0.9, -0.1), "mirrored": (1.1, 1.0, -0.9), "all inverted": (1.0, 1.0, -1.0),
    "large": (10.0, 1.0, 0.1), "huge": (1e3, 1e3, 1e3), "enormous": (1e6, 1.0, 1e-6)}
COLUMNS = ("law", "F", "determined", "finite", "turns", "returned_turns", "stress", "true_stress",
           "moved", "true_moved", "beyond")


class LawAnswers(NamedTuple):
    """Stress and returned F of a law and a flow at F (n, d, d)."""

    tau: np.ndarray     # (n, d, d) [Pa]
    F: np.ndarray       # (n, d, d) after the return of a trial F


def random_rotations(rng, n):
    """Return random rotations (n, 3, 3)."""
    Q = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    return Q * np.sign(np.linalg.det(Q))[:, None, None]


def random_gradients(s, rng):
    """Return random F (DRAWS, 3, 3) of singular values s."""
    return random_rotations(rng, DRAWS) @ np.diag(s) @ random_rotations(rng, DRAWS)


def evaluate_laws(law_and_flow, F):
    """Return the `LawAnswers` of (law, flow)."""
    with np.errstate(all="ignore"):
        stressed, returned = material_points(*law_and_flow, F), material_points(*law_and_flow, F)
        initial_stress(stressed)
        deform_body(returned, 1.0)
        return LawAnswers(kirchhoff_stresses(stressed).copy(),
                          deformation_gradients(returned).copy())


def relative_difference(value, expected, unit):
    """Return the largest difference of matrices (n, d, d) at each point (n,), over the largest
    entry there, or over a unit if that is larger; infinite where a value is not finite.
    """
    scale = np.maximum(np.abs(expected).max(axis=(1, 2)), unit)
    difference = np.abs(value - expected).max(axis=(1, 2)) / scale
    return np.where(np.isfinite(difference), difference, np.inf)


def rotation_error(law_and_flow, F, rng):
    """Return the differences of stress and returned F at Q F from those at F, rotated by Q. Where R
    is determined they are over the amplification of round-off in F by R, s_0/(s_1 + s_2).
    """
    Q, unrotated = random_rotations(rng, len(F)), evaluate_laws(law_and_flow, F)
    rotated = evaluate_laws(law_and_flow, Q @ F)
    with np.errstate(invalid="ignore"):
        differences = (
            relative_difference(rotated.tau, Q @ unrotated.tau @ Q.swapaxes(1, 2),
                                law_and_flow[0].wave),
            relative_difference(rotated.F, Q @ unrotated.F, 1.0))
    condition = np.maximum(polar_condition(F), 1.0) if polar_is_determined(F) else 1.0
    return tuple(float((a / condition).max()) for a in differences)


def polar_condition(F):
    """Return s_0/(s_1 + s_2) (n,), infinite where R is not determined; 1/2 at rest."""
    s = spectrum(F).s
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = s[:, 0] / (s[:, 1] + s[:, 2])
    return np.where(condition < LARGEST_CONDITION / UNDETERMINED, condition, np.inf)


def polar_is_determined(F):
    """Return whether R is determined at all points, by more than round-off."""
    return bool(np.isfinite(polar_condition(F)).all())


def largest_norm(a):
    """Return the largest norm of matrices (n, d, d)."""
    return float(np.linalg.norm(a, axis=(1, 2)).max())


def answer_row(learned, true, F, bounds, rng):
    """Return the table's row on one kind of F, for learned and true (law, flow)."""
    answers, expected = evaluate_laws(learned, F), evaluate_laws(true, F)
    finite = bool(np.isfinite(answers.tau).all() and np.isfinite(answers.F).all())
    return (int(polar_is_determined(F)), int(finite), *rotation_error(learned, F, rng),
            largest_norm(answers.tau), largest_norm(expected.tau), largest_norm(answers.F - F),
            largest_norm(expected.F - F), float(excess(strain_measures(F), bounds).max()))


@experiment("extremes.nclaw.singular", title="NCLaw: degenerate and inverted deformation gradients",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 40})
def singular(run):
    """Check that answers are finite, rotate with the body, and are flagged out of bounds."""
    for law in laws(run):
        body = law.make(build(environment(law.environment)).bodies[0])
        true = build(environment(law.environment)).bodies[0]
        rows = {name: answer_row((body.law, body.flow), (true.law, true.flow),
                                 random_gradients(s, run.rng), law.bounds, run.rng)
                for name, s in KINDS.items()}
        record_answers(run, law.name, {name: dict(zip(COLUMNS[2:], one, strict=True))
                                       for name, one in rows.items()})
        run.table(f"answers-{law.name}", COLUMNS[1:], [(name, *one) for name, one in rows.items()])


def record_answers(run, name, answers):
    """Record which answers {kind: {column: value}} are finite, rotate, and are out of bounds."""
    scale = f"{len(answers)} kinds of F, {DRAWS} of each"
    sound = [row["finite"] for row in answers.values()]
    run.record(f"extremes.nclaw.singular.{name}.finite", float(np.mean(sound)), paper=1.0,
               comparator="=", scale=scale, note="share of kinds; not: "
               + (", ".join(kind for kind, row in answers.items() if not row["finite"]) or "none"))
    for target, determined, rule in (
            ("turns", True, {"comparator": "<=", "bound": EQUAL_WITHIN}),
            ("turns_undetermined", False, {"comparator": "info"})):
        errors = {kind: max(row["turns"], row["returned_turns"]) for kind, row in answers.items()
                  if bool(row["determined"]) == determined}
        worst = max(errors, key=errors.get)
        run.record(f"extremes.nclaw.singular.{name}.{target}", errors[worst], scale=scale,
                   note=f"largest difference of the values at Q F from those at F, rotated by Q, "
                        f"over the latter: {worst}", **rule)
    guesses = {kind: row for kind, row in answers.items() if row["beyond"] > MAX_EXCESS}
    worst = max(guesses, key=lambda kind: guesses[kind]["stress"])
    run.record(f"extremes.nclaw.singular.{name}.guesses", len(guesses), unit="kinds",
               comparator="info", scale=scale, note="out of the bounds of strains; the largest "
               f"stress is {guesses[worst]['stress']:.3g} Pa, the true one "
               f"{guesses[worst]['true_stress']:.3g} Pa: {worst}")
