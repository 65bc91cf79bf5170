"""Errors of laws themselves, without a run (Table 5)."""

from typing import NamedTuple

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.explicit import deform_body, initial_stress
from mpm_ref.materials import NoFlow
from mpm_ref.materials.learned import learned_flow, learned_law
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.weights_needed import load_available
from .environments import environment, trajectory
from .trained_laws import trained

NAME, POINTS, SEED = "water", 1000, 0
METHODS = {NAME: "ours", f"{NAME}-labeled": "labeled"}      # of weights
SEEDS = {f"{NAME}-seed-{k}": f"ours.seed-{k}" for k in (1, 2)}
UNITS = {"P": "Pa^2", "Fnew": "1"}
STEPS = (*range(1, 20), *range(20, 1000, 20))       # of the table by frame
FRAME = 9           # in free flight; F of "labeled" is there nearest to print
CHOSEN = ("not judged: of all frames, the one where the error of F of \"labeled\" is nearest to "
          "the printed one")
COLUMNS = ("step", "t", "method", "P", "Fnew")
NOTHING = {"P": "no_stress", "Fnew": "unchanged"}
NOTES = {"P": "of a law that answers 0", "Fnew": "of a law that answers F_trial"}


class Questions(NamedTuple):
    """Gradients F and trial gradients (n, 3, 3), and the true answers P [Pa] and F (n, 3, 3)."""

    F: np.ndarray
    trial: np.ndarray
    P: np.ndarray
    new: np.ndarray


@experiment("nclaw.table5", title="NCLaw: the laws' own answers",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def table5(run):
    """P of deformation gradients and F of trial ones, 1 000 each: mean squared errors of all
    components. As the text says, they are drawn at random from water's training run. Beside: all
    points of single frames, and one frame of free flight.
    """
    observed, dt = trajectory(NAME), environment(NAME).dt
    law = build(environment(NAME)).bodies[0].law
    laws = {METHODS.get(name) or SEEDS[name]: own
            for name, own in load_available(run, (*METHODS, *SEEDS), trained).items()}
    whole = with_answers(law, *drawn(observed, dt))
    record_errors(run, "nclaw.table5", {word: errors(whole, own) for word, own in laws.items()
                                        if word not in SEEDS.values()},
                  scale=f"{POINTS} points of the training run, seed {SEED}")
    record_nothing(run, "nclaw.table5", whole)
    frames = {step: with_answers(law, *at_step(observed, dt, step)) for step in STEPS}
    by_frame = {step: {word: errors(asked, own) for word, own in laws.items()}
                for step, asked in frames.items()}
    run.table("frames", COLUMNS, [(step, step * dt, word, e["P"], e["Fnew"])
                                  for step, found in by_frame.items() for word, e in found.items()])
    record_errors(run, "nclaw.table5.frame", by_frame[FRAME], comparator="info", note=CHOSEN,
                  scale=f"all points after {FRAME} steps of the training run, in free flight")
    record_nothing(run, "nclaw.table5.frame", frames[FRAME])


def record_errors(run, start, by_method, **rule):
    """Record the errors {method: {term: error}} under ids that begin with `start`."""
    for method, found in by_method.items():
        for term, value in found.items():
            run.record(f"{start}.{term}.{method}", value, unit=UNITS[term], **rule)


def record_nothing(run, start, asked):
    """Record the errors of laws that do nothing: no stress, and the trial gradient unchanged."""
    found = {"P": np.mean(asked.P**2), "Fnew": np.mean((asked.trial - asked.new) ** 2)}
    for term, value in found.items():
        run.record(f"{start}.{term}.{NOTHING[term]}", value, unit=UNITS[term], comparator="info",
                   note=NOTES[term])


def errors(asked, laws):
    """Return {term: mean squared error} of the answers of `LearnedLaws` to `Questions`."""
    P, new = answers(learned_law(laws.elastic), learned_flow(laws.plastic), asked.F, asked.trial)
    return {"P": np.mean((P - asked.P) ** 2), "Fnew": np.mean((new - asked.new) ** 2)}


def with_answers(law, F, trial):
    """Return the `Questions` of gradients with the answers of a law and of the fluid's flow."""
    return Questions(F, trial, answers(law, NoFlow(), F, trial)[0], without_shear(trial))


def drawn(observed, dt):
    """Return deformation gradients (n, 3, 3) of random points and steps of a run, and the trial
    ones that follow.
    """
    steps, points = len(observed.F) - 1, observed.F.shape[1]
    step, point = np.random.default_rng(SEED).integers((steps, points), size=(POINTS, 2)).T
    F, C = observed.F[step, point], observed.C[step + 1, point]
    return F, F + dt * C @ F


def at_step(observed, dt, step):
    """Return deformation gradients (n, 3, 3) of all points after a step, and the trial ones that
    follow.
    """
    F = observed.F[step]
    return F, F + dt * observed.C[step + 1] @ F


def without_shear(F):
    """Return J^(1/3) I of gradients F (n, 3, 3), NCLAW-eq21; `FluidProjection` returns it rotated
    as F.
    """
    return np.linalg.det(F)[:, None, None] ** (1.0 / 3.0) * np.eye(3)


def answers(law, flow, F, trial):
    """Return P (n, 3, 3) [Pa] of F and F of trial gradients (n, 3, 3) by a law and a flow."""
    elastic, plastic = points(law, NoFlow(), F), points(law, flow, trial)
    initial_stress(elastic)
    deform_body(plastic, 0.0)
    return elastic.particles.tau @ np.linalg.inv(F).mT, plastic.particles.F


def points(law, flow, F):
    """Return a `Body` at rest whose deformation gradients are F (n, 3, 3)."""
    n = len(F)
    still, one = np.zeros((n, 3)), np.ones(n)
    particles = particles_at(still, still, one, one)._replace(F=F.copy())
    return Body("points", particles, law, flow, np.arange(n))
