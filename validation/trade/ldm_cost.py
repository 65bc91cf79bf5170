"""CPU time of the parts of LDM's reduced step, and the number of runs until training has paid."""

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
from ..ldm.timing import full_step, race
from ..ldm.tower import FAST, GRIDS, NET, PAPER, scene_of

EVALUATIONS = ("derivatives", "place", "velocity")
PARTS = ("network", "quadrature", "grid", "projection", "rest")
SPLIT = ("particles", "way", "quadrature_points", "cpu", *PARTS, *EVALUATIONS, "us_derivatives",
         "predicted")
STEPS, REPEATS = 10, 7
PAYS = ("particles", "steps", "cpu_data", "cpu_training", "cpu_full", "cpu_fastest",
        "cpu_reduced", "runs_same", "runs")


class PartTimer:
    """CPU seconds by part; the time of a part inside another counts for the inner one alone."""

    def __init__(self):
        self.spent, self.inside, self.since = Counter(), ["rest"], process_time()

    def turn(self):
        """Count the time until now for the current part."""
        now = process_time()
        self.spent[self.inside[-1]] += now - self.since
        self.since = now

    def part(self, name, function):
        """Return the function with its time counted for a part."""
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
    """A proxy of an object that passes some of its methods through a function of (name, method)."""

    def __init__(self, target, names, through):
        self.target = target
        for name in names:
            setattr(self, name, through(name, getattr(target, name)))

    def __getattr__(self, name):
        return getattr(self.target, name)


def split_step(one, map_at_rest, options, steps=STEPS):
    """Return means over steps, after one that compiles: CPU seconds by part, points of the map's
    evaluations by kind, and quadrature points.
    """
    (field_map, rest), clock, evaluated = map_at_rest, PartTimer(), Counter()
    stepper = ldm_model(one, field_map, options)

    def counted(name, method):
        timed = clock.part("network", method)

        def call(X, *args):
            evaluated[name] += len(X)
            return timed(X, *args)
        return call

    field = stepper.field
    stepper.field = field._replace(g=TimedCalls(field.g, EVALUATIONS, counted))
    stepper.quadrature = TimedCalls(stepper.quadrature, ("cloud",),
                                 lambda name, method: clock.part("quadrature", method))
    stepper.on_grid = clock.part("grid", stepper.on_grid)
    stepper.project = clock.part("projection", stepper.project)
    latent = ldm_start(one, field_map, rest)
    pick = ldm_sampler(one, field_map, options, latent.xhat, 0)
    dt, points = one.problem.clock.dt, []
    with one_thread():
        for k in range(steps + 1):
            if k == 1:
                clock.turn()
                clock.spent.clear()
                evaluated.clear()
            latent, report = stepper.step(latent, pick(k * dt, latent).points, k * dt, dt)
            points.append(report.points)
        clock.turn()
    return ({name: clock.spent[name] / steps for name in PARTS},
            {name: evaluated[name] / steps for name in EVALUATIONS}, float(np.mean(points[1:])))


@experiment("trade.ldm.split", title="LDM: CPU time of the parts of a reduced step",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 200})
def step_parts(run):
    """Time a step of the tower with 25 samples, with the paper's options and cheap ones."""
    rows, model = [], trained(NET)
    map_at_rest = model.field, model.rest
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        one = ldm_full_model(scene_of(size))
        for name, options in (("paper", PAPER), ("cheap", FAST)):
            rows.append(record_parts(run, f"trade.ldm.split.{size}.{name}", one, map_at_rest,
                                     options._replace(points=25)))
    run.table("parts", SPLIT, rows)


def record_parts(run, name, one, map_at_rest, options):
    """Record the parts of a step with some options. Returns a row of the table."""
    spent, evaluated, points = split_step(one, map_at_rest, options)
    field, rest = map_at_rest
    total = sum(spent.values())
    precise = with_precision(field, options, one.problem.scheme.transfer)
    each = evaluation_costs(one, precise, rest)
    predicted = sum(evaluated[kind] * each[kind] for kind in EVALUATIONS)
    shares = ", ".join(f"{part} {spent[part] / total:.0%}" for part in PARTS)
    scale = f"{len(one.X)} particles, {options.points} samples, {points:.0f} quadrature points"
    run.record(f"{name}.us_per_point", 1e6 * total / points, unit="us", comparator="info",
               scale=scale, note=f"{1e3 * total:.3g} ms of CPU time a step: {shares}; value and "
               f"Jacobians at {evaluated['derivatives'] / points:.2f} times the points, each "
               f"{1e6 * each['derivatives']:.2g} us by itself; so the network alone takes at least "
               f"{1e3 * predicted:.3g} ms")
    return (len(one.X), name.rsplit(".", 1)[-1], points, total, *spent.values(),
            *evaluated.values(), 1e6 * each["derivatives"], predicted)


def evaluation_costs(one, field, rest):
    """Return the CPU seconds of each kind of evaluation for one of many points."""
    X, costs = one.X[:: -(-len(one.X) // 20000)], {}
    calls = {"derivatives": lambda: field.derivatives(X, rest),
             "place": lambda: field.place(X, rest),
             "velocity": lambda: field.velocity(X, rest, rest)}
    for name, call in calls.items():
        times = []
        for _ in range(REPEATS):
            begin = process_time()
            call()
            times.append(process_time() - begin)
        costs[name] = float(np.median(times)) / len(X)
    return costs


@experiment("trade.ldm.offline", title="LDM: number of runs until training has paid",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 200})
def offline(run):
    """Compare costs on the tower, with a map trained on 34 thousand points, at every size."""
    rows, model = [], trained(NET)
    data = data_cost(run.choose(quick=3, standard=TOWER.scene(*TOWER.mu[0]).steps))
    training = training_cpu(model.about)
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        scene = scene_of(size)
        full, best, (cheap,) = race(scene, (model.field, model.rest), [FAST._replace(points=25)],
                                    run.choose(quick=3, standard=10))
        count = len(build(scene).bodies[0].id)
        costs = [scene.steps * a.cpu for a in (full, best, cheap.spent)]
        rows.append((count, scene.steps, data, training, *costs,
                     runs_to_pay(costs[0] - costs[2], data + training),
                     runs_to_pay(costs[1] - costs[2], data + training)))
        record_payback(run, size, rows[-1])
    run.table("pays", PAYS, rows)


def training_cpu(about):
    """Return the CPU seconds of a training, or of its last part where the weights have no more."""
    return about["cpu_seconds" if "cpu_seconds" in about else "cpu_seconds_of_last_part"]


def runs_to_pay(gain, spent):
    """Return the number of runs whose gains equal the seconds spent; infinite without gain."""
    return spent / gain if gain > 0.0 else np.inf


def record_payback(run, size, row):
    """Record a row of the table."""
    costs = dict(zip(PAYS, row, strict=True))
    run.record(f"trade.ldm.offline.{size}", costs["cpu_fastest"] - costs["cpu_reduced"],
               unit="CPU s", comparator="info",
               scale=f"{costs['particles']} particles, {costs['steps']} steps, 25 samples",
               note=f"saved by a run, against the full model with its fastest transfer; "
               f"{costs['cpu_data']:.3g} s of data and {costs['cpu_training']:.3g} s of training "
               f"(the last part of it, where it was cut off) are paid after {costs['runs']:.3g} "
               f"runs, against the transfer that it was trained on after {costs['runs_same']:.3g}")


def data_cost(steps):
    """Return the CPU seconds of all training runs of the tower, from `steps` steps of one."""
    study = STUDIES[TOWER.name]
    scene = study.scene(*study.mu[study.train[0]])
    return full_step(scene, steps).cpu * scene.steps * len(study.train)
