"""The model that NSF is compared with: LDM on trained networks (NSF-X12), in the scenes without
plasticity, whose stress follows from the gradient of the map.

The map is the stored network of the position, F its derivative by the place at rest (LDM-eq15), and
the step LDM's (`mpm_ref.rom.step.ldm_stepper`), by PIC as LDM is printed. Beside it stands the map
alone on modes, whose gradients are those of neighbours, with NSF's step.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.elastic import ElasticMap
from mpm_ref.rom.fields.network import Decoder
from mpm_ref.rom.model_file import Model
from mpm_ref.rom.study.evaluate import history_reference, level_of, path_errors, stress_share
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ReducedRun, RunOptions, ldm_model, ldm_start
from mpm_ref.rom.study.samples import ldm_sampler

from ..common.registry import experiment
from ..common.scenes import with_
from .errors import COLUMNS, error_rows, mean, record_mean
from .networks import fields_of, trained
from .reduced_runs import RunErrors, fit_study
from .rivals import study_of
from .studies import NsfStudy

SCENES = "jelly", "bread", "ball"       # without plasticity, as in the paper's comparisons
MODELS = {
    "ldm": "LDM: the trained network of the position, the stress of its gradient, PIC",
    "nsf": "NSF on the same network of the position, with those of stress and affine field",
    "modes": "the map alone on modes, with gradients of neighbours and NSF's step"}


class NumberedDecoder(NamedTuple):
    """A learned map of the points of one body or several, by their numbers."""

    X: np.ndarray       # (n, d) points at rest [m]
    g: Decoder

    @property
    def dim(self):
        """Number of axes d."""
        return self.g.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.g.r

    def place(self, points, xhat):
        """Return x (m, d) [m] of points of these numbers."""
        return self.g.place(self.X[points], xhat)

    def derivatives(self, points, xhat):
        """Return x (m, d), F (m, d, d) and dg/dxhat (m, d, r) of points of these numbers."""
        return self.g.derivatives(self.X[points], xhat)

    def velocity(self, points, xhat, vhat):
        """Return the velocities (m, d) [m/s] of points of these numbers."""
        return self.g.velocity(self.X[points], xhat, vhat)


class LdmBaseline(NamedTuple):
    """LDM on a trained network of the position, in the tests of a study."""

    study: NsfStudy
    tests: dict         # {value: `Histories` of a run}
    model: Model        # of the networks

    def errors(self, value, count, draw, *_):
        """Return the `RunErrors` of LDM's run with `count` samples, drawn for each step anew;
        infinite where it breaks down.
        """
        full, g = map_of(self.study.run(value), self.model.field.g)
        plan = ldm_plan(full, g, RunOptions(points=count), (self.model.rest, draw))
        test, points = self.tests[value], []

        def states():
            for state in plan.states():
                points.extend(() if state.report is None else (state.report.points,))
                yield level_of(state.t / test.dt), state.latent.xhat

        path = path_errors(ElasticMap(g, full.law), history_reference(test), states())
        mean_points = np.nan if path.breakdown else float(np.mean(points))
        return RunErrors(path.errors, stress_share(path.stress), mean_points, count, np.nan)


def map_of(scene, g):
    """Return the `FullModel` of a scene with PIC, and the `NumberedDecoder` of its points."""
    full = ldm_full_model(with_(scene, scheme=with_(scene.scheme, transfer="pic")))
    return full._replace(by_number=True), NumberedDecoder(full.X, g)


def ldm_plan(full, g, options, start):
    """Return LDM's `ReducedRun` of a `FullModel` on a map that takes numbers. start: latent
    coordinates near those at the start, and the seed of the samples.
    """
    clock, (rest, seed) = full.problem.clock, start
    return ReducedRun(ldm_model(full, g, options), lambda: ldm_start(full, g, rest),
                      lambda xhat: ldm_sampler(full, g, options, xhat, seed), clock.dt, clock.steps)


@experiment("nsf.baseline", title="NSF beside LDM on trained networks",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 400})
def compare_baseline(run):
    """Record errors of LDM on networks, of the map alone on modes, and of NSF on the same networks,
    with the study's samples, one draw.
    """
    rows = []
    for name in run.progress(run.choose(quick=SCENES[:1], standard=SCENES), "scenes"):
        rows += record_scene(run, name, fit_study(study_of(run, name)), trained(f"{name}-waves"))
    run.table("errors", ("model", *COLUMNS[1:]), rows)


def record_scene(run, name, one, model):
    """Record the errors of a scene's models; return their rows. one: `FittedStudy`; model: of the
    trained networks.
    """
    studies = {"ldm": LdmBaseline(one.study, one.tests, model),
               "nsf": one._replace(fields=fields_of(model, one.study), xhat=model.xhat),
               "modes": one._replace(map_alone=True)}
    count = one.study.samples
    rows = {word: error_rows(studies[word], f"{name}.{word}", count, (0,)) for word in MODELS}
    for word, note in MODELS.items():
        target, rule = ((f"nsf.{name}.baseline_error.positions", {}) if word == "ldm" else
                        (f"nsf.baseline.{name}.{word}", {"comparator": "info"}))
        record_mean(run, target, rows[word], one.size, f"{count} samples", fields=note, **rule)
        run.record(f"nsf.baseline.{name}.{word}.stress", 100.0 * mean(rows[word], "stress"),
                   unit="%", scale=one.size, comparator="info",
                   note=f"of the Kirchhoff stress, all particles and times; {note}")
    run.record(f"nsf.baseline.{name}.share", share_of(rows["nsf"], rows["ldm"]), comparator="<=",
               bound=1.0, scale=one.size, note="error of NSF over that of LDM on the same network "
               "of the position, which it must be below; none where LDM breaks down")
    return [row for some in rows.values() for row in some]


def share_of(rows, others):
    """Return the mean error of rows over that of others, NaN where the others broke down."""
    error = mean(others, "origin")
    return mean(rows, "origin") / error if np.isfinite(error) else np.nan
