"""A reduced run with inferred stress, to be recorded (see `rom.study.record`)."""

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from ...body import Body, particles_at
from ...materials import NoFlow
from ...store.writer import Fields
from ..extrapolation import Extent
from ..fields.pod_fields import Spanned
from ..latent import Latent
from ..step import Report
from .nsf_case import Whole
from .nsf_fields import of_run
from .nsf_run import Plan, begin, continued, drawn, of_cells, weighed
from .nsf_watch import look, sparse, trained

VECTORS = {"xhat": "1"}                         # of the group `reduced`: units
COUNTS = {"samples": "1", "points": "1", "rank": "1"}
NUMBERS = {"residual": "m", "beyond": "1"}


@dataclass(frozen=True)
class Recording:
    """A reduced run to be recorded."""

    whole: Whole
    fields: object          # of this run
    rest: np.ndarray        # (r,) latent coordinates near the start
    extent: Extent          # of the training latents
    run: object             # `tables.Run`
    plan: Plan
    problem: object         # the scene's, with the clock of the reduced run
    facts: dict             # what else is to be known of it, plain values

    series = VECTORS, COUNTS, NUMBERS
    stored = Fields(("x", "v", "C", "tau"))

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.fields.r

    @property
    def count(self):
        """Number of points shown."""
        return len(self.whole.X)

    @property
    def doubts(self):
        """The warnings before the run."""
        return sparse(self.fields, self.plan.samples[0])

    def states(self, known):
        """Yield (`Latent`, `Report` or None, `Sight`) of each state, those known too."""
        known = known or [(begin(self.whole, self.fields, self.rest), None)]
        for _, at, report in continued(known, self.whole, self.fields, self.plan):
            yield at, report, look(self.extent, at, report)

    def bodies(self, at):
        """The bodies in a state. They have no law: of a stress that is inferred no strain and no
        elastic energy is known.
        """
        everything, fields, matter = np.arange(self.count), self.fields, self.whole.matter
        x, v = fields.place(everything, at.xhat), matter.v
        if at.before is not None:
            v = (x - fields.place(everything, at.before)) / self.problem.clock.dt
        tau, C = (field(everything, at.xhat) for field in (fields.stress, fields.affine))
        ends = np.cumsum([len(body.id) for body in self.problem.bodies])
        own = zip(self.problem.bodies, np.split(everything, ends[:-1]), strict=True)
        return tuple(body_of(body.name, x[p], v[p], matter, (p, tau[p], C[p])) for body, p in own)

    def row(self, step):
        """Of a `Step`; at the start nothing is reported."""
        reported = {} if step.report is None else step.report._asdict()
        return {"xhat": step.latent.xhat, **reported, "beyond": step.sight.beyond}


def body_of(name, x, v, matter, rest):
    """A `Body` at x (n, d) with velocity v, of points with (numbers, stress, affine field)."""
    points, tau, C = rest
    particles = particles_at(x, v, matter.m[points], matter.V0[points], transfer="apic")
    return Body(name, particles._replace(tau=tau, C=C), None, NoFlow(), np.arange(len(points)))


def plan_of(run, problem, fields):
    """`Plan` of a study's `Run` of a `Problem`. Raises ValueError as `chosen` does."""
    return Plan((chosen(run, problem, fields),), run.faster, run.inversion)


def chosen(run, problem, fields):
    """`Chosen` samples of a study's `Run`. Raises ValueError as `require_samples` does, and for
    weights of samples without modes.
    """
    n = len(fields.X)
    count = n if run.points is None else run.points
    require_samples(run, fields.X, fields.r)
    if not (run.weighed or run.cells):
        return drawn(n, count, run.seed)
    if not isinstance(fields, Spanned):
        asked = "weighed = true" if run.weighed else f"cells = {run.cells}"
        raise ValueError(f"{asked}: weights of samples are told by modes, which networks "
                         "have not; leave it out, or make fields of modes")
    if run.weighed:
        return weighed(fields, n, count, run.seed)
    return of_cells(fields, problem, n, run.cells, run.seed)


def require_samples(run, X, r):
    """Raise ValueError where the samples of a study's `Run` of points X (n, d) do not suffice for r
    latent coordinates, or are more than there are points.
    """
    (n, d), count = X.shape, run.points
    if count is not None and not ceil(r / d) <= count <= n:
        raise ValueError(f"points = {count}: expected {ceil(r / d)} .. {n} samples, of {n} points "
                         f"and for {r} latent coordinates; change `points` of [run]")


def recording(whole, model, mu, run, facts):
    """`Recording` of a reduced run with parameters mu on the fields of a `Model`. Raises ValueError
    as `plan_of` does.
    """
    fields, clock = of_run(model.field, whole, mu), whole.problem.clock
    plan = plan_of(run, whole.problem, fields)
    own = replace(clock, dt=run.faster * clock.dt, steps=plan.steps(clock), every=1)
    return Recording(whole, fields, model.rest, trained(fields, model.xhat), run, plan,
                     replace(whole.problem, clock=own), facts)


def states(results):
    """(`Latent`, `Report` or None) of each frame of a reduced run."""
    n = len(results)
    rows = {name: series[:n] for name, series in results.h5["reduced"].items()}
    found = [(Latent(rows["xhat"][k], before=rows["xhat"][k - 1] if k else None),
              report_of(rows, k) if k else None) for k in range(n)]
    return tuple(found)


def report_of(rows, k):
    """`Report` of step k, as far as it is stored."""
    counts = (int(rows[name][k]) for name in COUNTS)
    return Report(*counts, float(rows["residual"][k]), 0, True, {})
