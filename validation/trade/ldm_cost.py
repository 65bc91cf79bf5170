"""Where the time of a reduced step goes, and after how many runs training has paid."""

from collections import Counter
from time import process_time

import numpy as np

from mpm_ref.core.blas import one_thread
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ldm_model, ldm_start, with_precision
from mpm_ref.rom.study.samples import ldm_sampler
from mpm_ref.scene import build

from ..common.registry import experiment
from ..ldm.networks import trained
from ..ldm.studies import STUDIES, TOWER
from ..ldm.timing import fastest, race
from ..ldm.tower import FAST, GRIDS, NET, PAPER, scene_of

EVALUATIONS = ("derivatives", "place", "velocity")
PARTS = ("network", "quadrature", "grid", "projection", "rest")
SPLIT = ("particles", "way", "quadrature_points", "cpu", *PARTS, *EVALUATIONS, "us_derivatives",
         "predicted")
STEPS, REPEATS = 10, 7
PAYS = ("particles", "steps", "cpu_data", "cpu_training", "cpu_full", "cpu_fastest",
        "cpu_reduced", "runs_same", "runs")


class Clock:
    """CPU seconds by part; a part inside another counts for itself alone."""

    def __init__(self):
        self.spent, self.inside, self.since = Counter(), ["rest"], process_time()

    def turn(self):
        """Count the time until now for the part that is on."""
        now = process_time()
        self.spent[self.inside[-1]] += now - self.since
        self.since = now

    def part(self, name, function):
        """The function, its time counted for a part."""
        def timed(*args, **kwargs):
            self.turn()
            self.inside.append(name)
            try:
                return function(*args, **kwargs)
            finally:
                self.turn()
                self.inside.pop()
        return timed


class TimedCalls:
    """An object of which some methods go through a function of (name, method)."""

    def __init__(self, of, names, through):
        self.of = of
        for name in names:
            setattr(self, name, through(name, getattr(of, name)))

    def __getattr__(self, name):
        return getattr(self.of, name)


def split(one, at, way, steps=STEPS):
    """CPU seconds of a step by part, points that the map was evaluated at by kind, and quadrature
    points; means over steps, after one that compiles.
    """
    (map, rest), clock, asked = at, Clock(), Counter()
    stepper = ldm_model(one, map, way)

    def counted(name, method):
        timed = clock.part("network", method)

        def call(X, *args):
            asked[name] += len(X)
            return timed(X, *args)
        return call

    field = stepper.field
    stepper.field = field._replace(g=TimedCalls(field.g, EVALUATIONS, counted))
    stepper.quadrature = TimedCalls(stepper.quadrature, ("cloud",),
                                 lambda name, method: clock.part("quadrature", method))
    stepper.on_grid = clock.part("grid", stepper.on_grid)
    stepper.project = clock.part("projection", stepper.project)
    latent = ldm_start(one, map, rest)
    pick, dt, points = ldm_sampler(one, map, way, latent.xhat, 0), one.problem.clock.dt, []
    with one_thread():
        for k in range(steps + 1):
            if k == 1:
                clock.turn()
                clock.spent.clear()
                asked.clear()
            latent, report = stepper.step(latent, pick(k * dt, latent).points, k * dt, dt)
            points.append(report.points)
        clock.turn()
    return ({name: clock.spent[name] / steps for name in PARTS},
            {name: asked[name] / steps for name in EVALUATIONS}, float(np.mean(points[1:])))


@experiment("trade.ldm.split", title="LDM: where the time of a reduced step goes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 200})
def of_parts(run):
    """Of a step of the tower with 25 samples, the paper's way and the cheap one, by size."""
    rows, model = [], trained(NET)
    at = model.field, model.rest
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        one = ldm_full_model(scene_of(size))
        for name, way in (("paper", PAPER), ("cheap", FAST)):
            rows.append(parted(run, f"trade.ldm.split.{size}.{name}", one, at,
                               way._replace(points=25)))
    run.table("parts", SPLIT, rows)


def parted(run, name, one, at, way):
    """Record the parts of a way; a row of the table."""
    spent, asked, points = split(one, at, way)
    total, each = sum(spent.values()), cost(one, with_precision(at[0], way), at[1])
    predicted = sum(asked[kind] * each[kind] for kind in EVALUATIONS)
    shares = ", ".join(f"{part} {spent[part] / total:.0%}" for part in PARTS)
    scale = f"{len(one.X)} particles, {way.points} samples, {points:.0f} quadrature points"
    run.record(f"{name}.us_per_point", 1e6 * total / points, unit="us", comparator="info",
               scale=scale, note=f"{1e3 * total:.3g} ms of CPU time a step: {shares}; value and "
               f"Jacobians at {asked['derivatives'] / points:.2f} times the points, each "
               f"{1e6 * each['derivatives']:.2g} us by itself; so the network alone must take "
               f"{1e3 * predicted:.3g} ms")
    return (len(one.X), name.rsplit(".", 1)[-1], points, total, *spent.values(), *asked.values(),
            1e6 * each["derivatives"], predicted)


def cost(one, map, rest):
    """CPU seconds that each kind of evaluation takes for a point, among many."""
    X, found = one.X[:: -(-len(one.X) // 20000)], {}
    calls = {"derivatives": lambda: map.derivatives(X, rest), "place": lambda: map.place(X, rest),
             "velocity": lambda: map.velocity(X, rest, rest)}
    for name, call in calls.items():
        times = []
        for _ in range(REPEATS):
            begin = process_time()
            call()
            times.append(process_time() - begin)
        found[name] = float(np.median(times)) / len(X)
    return found


@experiment("trade.ldm.offline", title="LDM: after how many runs training has paid",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 200})
def offline(run):
    """On the tower: a map trained on 34 thousand points, used at every size."""
    rows, model = [], trained(NET)
    data = data_cost(run.choose(quick=3, standard=TOWER.scene(*TOWER.mu[0]).steps))
    training = trained_in(model.about)
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        scene = scene_of(size)
        full, (cheap,) = race(scene, (model.field, model.rest), [FAST._replace(points=25)],
                              run.choose(quick=3, standard=10))
        count, best = len(build(scene).bodies[0].id), fastest(scene)
        known = [scene.steps * a.cpu for a in (full, best, cheap.spent)]
        rows.append((count, scene.steps, data, training, *known,
                     paid(known[0] - known[2], data + training),
                     paid(known[1] - known[2], data + training)))
        cost_summary(run, size, rows[-1])
    run.table("pays", PAYS, rows)


def trained_in(about):
    """CPU seconds of a training; weights made before sums were kept have those of its last part."""
    return about["cpu_seconds" if "cpu_seconds" in about else "cpu_seconds_of_last_part"]


def paid(gain, spent):
    """Runs after which gains of so many seconds are as much as was spent; infinite without any."""
    return spent / gain if gain > 0.0 else np.inf


def cost_summary(run, size, row):
    """Record a row of the table."""
    known = dict(zip(PAYS, row, strict=True))
    run.record(f"trade.ldm.offline.{size}", known["cpu_fastest"] - known["cpu_reduced"],
               unit="CPU s", comparator="info",
               scale=f"{known['particles']} particles, {known['steps']} steps, 25 samples",
               note=f"saved by a run, beside the full model with its fastest transfer; "
               f"{known['cpu_data']:.3g} s of data and {known['cpu_training']:.3g} s of training "
               f"(the last part of it, where it was cut off) are paid after {known['runs']:.3g} "
               f"runs, beside the transfer that it was trained on after {known['runs_same']:.3g}")


def data_cost(steps):
    """CPU seconds of all training runs of the tower, from as many steps of one."""
    study = STUDIES[TOWER.name]
    scene = study.scene(*study.mu[study.train[0]])
    full, _ = race(scene, (None, None), [], steps)
    return full.cpu * scene.steps * len(study.train)
