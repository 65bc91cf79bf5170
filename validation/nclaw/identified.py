"""Errors of laws themselves, without a run (Table 5)."""

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
TERMS = {"P": "Pa^2", "Fnew": "1"}
NOTES = {"P": "the printed number has no unit", "Fnew": ""}


@experiment("nclaw.table5", title="NCLaw: the laws' own answers",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def table5(run):
    """P of deformation gradients and F of trial ones, 1 000 each, drawn from water's training run:
    mean squared errors of all components. The text does not say which run it draws from.
    """
    law = build(environment(NAME)).bodies[0].law
    F, trial = drawn(trajectory(NAME), environment(NAME).dt)
    truth = answers(law, NoFlow(), F, trial)[0], without_shear(trial)
    for name, laws in load_available(run, METHODS, trained).items():
        learned = answers(learned_law(laws.elastic), learned_flow(laws.plastic), F, trial)
        for (term, unit), a, b in zip(TERMS.items(), learned, truth, strict=True):
            run.record(f"nclaw.table5.{term}.{METHODS[name]}", np.mean((a - b) ** 2), unit=unit,
                       scale=f"{POINTS} points of the training run, seed {SEED}", note=NOTES[term])
    unchanged(run, trial, truth[1])


def unchanged(run, trial, F):
    """Record the error of a law that returns the trial gradient unchanged."""
    run.record("nclaw.table5.Fnew.unchanged", np.mean((trial - F) ** 2), unit="1",
               comparator="info", scale=f"{POINTS} points of the training run, seed {SEED}",
               note="of a law that answers F_trial")


def drawn(observed, dt):
    """Return deformation gradients (n, 3, 3) of random points and steps of a run, and the trial
    ones that follow.
    """
    steps, points = len(observed.F) - 1, observed.F.shape[1]
    step, point = np.random.default_rng(SEED).integers((steps, points), size=(POINTS, 2)).T
    F, C = observed.F[step, point], observed.C[step + 1, point]
    return F, F + dt * C @ F


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
