"""The training of a law study: the full-order run that laws are learned from, in a results file,
and the laws with the record of their training.
"""

import hashlib
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ... import scene
from ...materials.learned import weights
from ...materials.learned.strain_range import strain_bounds
from ...store.manifest import source_hash, versions
from ...store.results import BadResults, Results
from ...store.running import Options, run
from ...store.writer import StoredFields, require_run
from ...training import import_with_torch
from ...trajectories import Observed
from ..bodies import body_maker
from .compare import RunBroken, positions, threads_for

FIELDS = ("x", "v", "C", "F")
J_ALONE = "J"


def trainer():
    """Return the module that trains laws. Raises ValueError without PyTorch."""
    return import_with_torch("nclaw.train.train", "laws are trained",
                "laws that were trained run, export and plot without it")


def train_study(study, observed, checkpoint=None, on_epoch=None, **about):
    """Train the laws of a study on its run, `Observed`, and return `LearnedLaws`.

    checkpoint and on_epoch: as for `nclaw.train.fit.train`; about: more facts for the record of the
    training, with the `threads` of PyTorch. Raises ValueError without PyTorch and for a checkpoint
    of another training, and `Diverged` of `trainer`.
    """
    how, recipe, problem, facts = trainer(), study.tables.train, study.problem(), identity(study)
    how.use_threads(about["threads"])
    laws = start_of_training(how, study)
    done = how.train_laws(study.tables.method, recipe, laws, (problem, observed), checkpoint,
                          on_epoch)
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.meter.total._asdict().items()}
    trained = how.learned_laws(laws, {
        **about, **facts, **took, **done.errors, "seen": strain_bounds(observed.F),
        "torch": how.version()})
    error = run_error(study.problem(), body_maker(trained), observed.x)
    return trained._replace(about={**trained.about, "run_error": error})


def start_of_training(how, study):
    """Return the `LawPair` that the training of a study begins with: that of its file `start`, or
    one that is drawn. Raises ValueError for a file that has no such laws.
    """
    tables, start = study.tables, study.file("start")
    if start is not None:
        return how.continued_laws(tables.method, weights.load(start))
    return how.initial_laws(tables.method, tables.train.seed, tables.records, study.material)


def run_error(problem, maker, x):
    """Return the root mean square error of a run by other laws over the motion of the true one,
    with positions x (k + 1, n, d) after every step; None where it breaks down.

    maker: a function that gives a body the laws (see `nclaw.bodies.body_maker`).
    """
    clock = replace(problem.clock, steps=len(x) - 1, end=None, every=1, interval=None)
    run = positions(replace(problem, clock=clock), tuple(map(maker, problem.bodies)))
    try:
        with threads_for(problem.bodies):
            errors = [np.mean((learned - true) ** 2)
                      for learned, true in zip(run, x, strict=True)]
    except RunBroken:
        return None
    motion = np.mean((x - x[0]) ** 2)
    error = float(np.sqrt(np.mean(errors) / motion)) if motion > 0.0 else np.inf
    return error if np.isfinite(error) else None


def identity(study):
    """Return what identifies a training: scene, method, recipe and versions, as plain values; and
    the laws that it goes on from, if any.
    """
    origin, start = {}, study.file("start")
    if start is not None:
        origin["start_sha256"] = hashlib.sha256(start.read_bytes()).hexdigest()
    return {"scene_sha256": scene.digest(study.scene), "title": study.scene.title,
            "dt": study.scene.dt, "method": study.tables.method,
            "recipe": asdict(study.tables.train), "source_sha256": source_hash(),
            "versions": versions(), **origin}


def is_complete(path, problem):
    """Return whether a results file holds all steps of a problem.

    Raises BadResults for a file that is no results file, or of another scene.
    """
    if not Path(path).exists():
        return False
    with Results(path) as results:
        require_run(results.h5, path, problem, 0)
        return len(results) == problem.clock.steps + 1


def make_run(path, problem, watch=None):
    """Run a problem into a results file, from its checkpoint if there is one; returns the steps
    that it has then, fewer than all where it was interrupted. Raises as `store.running.run`.
    """
    options = Options(fields=StoredFields(FIELDS), resume=True)
    return run(problem, path, options, watch).state.step


def read_run(path, problem):
    """Return the `Observed` of a results file that is `is_complete`. Raises BadResults for one that
    lacks a field, or whose numbers are not all finite.
    """
    body, d = problem.bodies[0].name, problem.dim
    with Results(path) as results:
        fields = {name: results.field(body, name) for name in FIELDS[:3]}
        last = J_ALONE if results.has(body, J_ALONE) else FIELDS[3]
        fields[last] = results.field(body, last)
    require_finite(path, fields)
    J = fields.pop(J_ALONE, None)
    if J is not None:
        fields["F"] = J[..., None, None] ** (1.0 / d) * np.eye(d)
    return Observed(**fields)


def require_finite(path, fields):
    """Raise BadResults unless {name: field (k + 1, n, ..)} are finite numbers."""
    for name, a in fields.items():
        lost = np.argwhere(~np.isfinite(a))
        if len(lost):
            k, p = lost[0][:2]
            raise BadResults(f"{path}: {name} of particle {p} after step {k} is {a[k, p]}: "
                             "expected finite numbers to learn from; make the run again")
