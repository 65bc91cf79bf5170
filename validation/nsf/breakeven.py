"""The share of points at which a reduced run pays: the time that its fields take for a point,
compared with that of a full-order step for a particle (section 6, appendix C of the paper).

A reduced step on a share s of the particles takes at least s n (f + g): f for the fields of a point
(its place now and a step ago, stress, affine field), g for its part of the step on the grid, which
is that of the full-order step without singular values, return map and stress. So it is p / (s (f +
g)) times faster at best, where p is the full-order step's time for a particle. Finding the points
and the inversion come on top; `nsf.speed` has them.

Fields are of random numbers: no time depends on their values.
"""

from itertools import pairwise
from time import perf_counter
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.architecture import DEPTH
from mpm_ref.rom.fields.network import (
    Decoder,
    DecoderUnits,
    Field,
    FieldUnits,
    LearnedFields,
    learned_fields,
)
from mpm_ref.rom.fields.perceptron import network
from mpm_ref.rom.fields.pod_fields import ModalField, PodFields, Sizes, cells
from mpm_ref.rom.fields.radial_basis import Radial
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from validation.nsf.pointwise_networks import infer

from ..common.registry import experiment
from .speed import full_steps
from .studies import cake, metal

INFO = {"comparator": "info"}
REPEATS = 5
SWEEP = (16, 32, 64, 128)               # widths of all three networks
CENTRES = 600                           # of radial functions: 12 runs of 50 snapshots
INPUTS, OUTPUTS = 9, (3, 6, 9)          # a point and six latent coordinates; of g, h and l
TWINS = "scene", "fields", "by_layer", "by_point"      # seconds of a point

class PrintedScene(NamedTuple):
    """Printed sizes of a scene."""

    study: object
    widths: tuple           # of g, h and l
    share: float            # of the particles that are integration points


SCENES = {"metal": PrintedScene(metal, (96, 288, 432), 0.09),
          "cake": PrintedScene(cake, (144, 384, 576), 0.067)}


class BreakEvenRow(NamedTuple):
    """A row of the table: fields of a kind in a scene."""

    scene: str
    fields: str
    products: int           # that they take for a point
    point: float            # seconds that they take for one
    bound: float            # ... that as many products of a matrix product take
    particle: float         # ... of a full-order step for a particle
    grid: float             # ... of its part on the grid
    even: float             # share of points at which a reduced step takes as long, at best
    ten: float              # ... a tenth
    printed_share: float
    speedup: float          # at that share, at best


@experiment("nsf.breakeven", title="NSF: how few points must be left for a reduced run to pay",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 120})
def breakeven(run):
    """Shares of integration points at which a reduced step takes as long as a full-order one, and a
    tenth of it, for networks of several widths and for modes.
    """
    rate, rows, twins = products_per_second(run.choose(quick=256, standard=1024)), [], []
    for name, scene in run.progress(SCENES.items(), "scenes"):
        study = scene.study(run.choose(quick=3, standard=1))
        full, deform = full_steps(study, run.choose(quick=10, standard=50))
        model = nsf_full_model(study.run(study.test[0]))
        n = len(model.X)
        for word, products, fields in kinds(model, scene, run.rng):
            points = np.sort(run.rng.choice(n, round(scene.share * n), replace=False))
            f = seconds_of_a_point(fields, points)
            cost = PointCost(full / n, (full - deform) / n, f)
            rows.append(BreakEvenRow(name, word, products, f, products / rate, cost.particle,
                                     cost.grid, cost.share(1.0), cost.share(10.0), scene.share,
                                     cost.speedup(scene.share)))
            record_row(run, rows[-1], n)
            if isinstance(fields, LearnedFields):
                twins.append((name, word, *passes(fields, points)))
    record_twins(run, twins)
    run.record("nsf.breakeven.rate", rate, unit="1/s", **INFO,
               note="products, each with a sum, of a matrix product in double precision")
    run.table("shares", BreakEvenRow._fields, rows)
    run.table("twins", TWINS, twins)


class PointCost(NamedTuple):
    """Seconds of a step for a particle or point."""

    particle: float         # of a full-order step
    grid: float             # ... of its part on the grid
    fields: float           # of a reduced one

    def speedup(self, share):
        """Return the speed-up of a reduced step on a share of the particles, at best."""
        return self.particle / (share * (self.fields + self.grid))

    def share(self, speedup):
        """Return the share of particles at which a reduced step has a speed-up."""
        return self.speedup(1.0) / speedup


def kinds(model, scene, rng):
    """Yield (word, products that a point takes, fields) for a `FullModel`."""
    for word, widths in [("printed", scene.widths), *((f"networks-{w}", (w, w, w)) for w in SWEEP)]:
        nets = networks(widths, model.X, rng)
        place, stress, affine = (net[0].W.size for net in nets)
        yield (word, 2 * place + stress + affine,
               learned_fields(model.X, nets, (), BLOCK * model.problem.dx))
    fields, sizes = modes(model, rng), Sizes(6)
    products = 2 * 3 * sizes.modes + 6 * sizes.tau + 9 * sizes.C
    yield "modes", products, fields
    yield "modes-single", products, fields.single()


def networks(widths, X, rng):
    """Return position, stress and affine field as networks of random weights."""
    low, span = X.min(axis=0), np.ptp(X, axis=0)
    nets = [network([(rng.normal(size=(a, b)) / np.sqrt(a), np.zeros(b))
                     for a, b in pairwise((INPUTS, *(width,) * DEPTH, k))])
            for width, k in zip(widths, OUTPUTS, strict=True)]
    plain = [FieldUnits(low, span, np.zeros(k), np.ones(k), np.zeros(0), np.ones(0))
             for k in OUTPUTS[1:]]
    units = DecoderUnits(low, span, np.zeros(3), 1e-3 * span)
    return Decoder(nets[0], units), Field(nets[1], plain[0]), Field(nets[2], plain[1])


def modes(model, rng):
    """Return `PodFields` fields of random modes, of usual `Sizes`."""
    sizes, n = Sizes(6), len(model.X)

    def radial(k):
        return Radial(rng.normal(size=(CENTRES, sizes.r)), np.ones(sizes.r),
                      rng.normal(size=(CENTRES, k)), np.zeros((1 + sizes.r, k)))

    U = rng.normal(size=(n, 3, sizes.modes))
    tau, C = (ModalField(rng.normal(size=(n, k, R)), radial(R))
              for k, R in ((6, sizes.tau), (9, sizes.C)))
    return PodFields(model.X, U, radial(sizes.modes - sizes.r), tau, C, np.zeros(0),
                     cells(model.X, U, BLOCK * model.problem.dx))


def seconds_of_a_point(fields, points):
    """Return the median of the seconds that fields take for a point in a step. Points are
    scattered at random: in a run they lie together around samples, so that some are read faster.
    """
    xhat = latent(fields)

    def evaluate():
        fields.place(points, xhat)
        fields.place(points, 0.9 * xhat)
        fields.stress(points, xhat)
        fields.affine(points, xhat)

    return seconds(evaluate) / len(points)


def passes(fields, points):
    """Return the seconds for a point of networks' positions with their derivatives, stress and
    affine field: layer by layer, and point by point in one compiled pass (`pointwise_networks`).
    """
    xhat, X = latent(fields), fields.X[points]

    def layers():
        fields.derivatives(points, xhat)
        fields.stress(points, xhat)
        fields.affine(points, xhat)

    return (seconds(layers) / len(points),
            seconds(lambda: infer(fields.g, fields.h, fields.l, X, xhat)) / len(points))


def latent(fields):
    """Return latent coordinates (r,) at which fields are timed."""
    return np.linspace(-0.1, 0.1, fields.r)


def seconds(work):
    """Return the seconds of a call, after a first one; the median of REPEATS."""
    took = []
    for _ in range(1 + REPEATS):
        start = perf_counter()
        work()
        took.append(perf_counter() - start)
    return float(np.median(took[1:]))


def products_per_second(size):
    """Return the products per second of a matrix product in doubles, on all threads, the best of
    several.
    """
    A, took = np.ones((size, size)), []
    for _ in range(1 + REPEATS):
        start = perf_counter()
        A @ A
        took.append(perf_counter() - start)
    return size**3 / min(took)


def record_twins(run, twins):
    """Record how many times as long networks take point by point as layer by layer."""
    for name, word, by_layer, by_point in twins:
        run.record(f"nsf.breakeven.{name}.{word}.twin", by_point / by_layer, unit="x", **INFO,
                   note=f"positions with derivatives, stress and affine field in one compiled "
                        f"pass {1e6 * by_point:.3g} us a point, layer by layer "
                        f"{1e6 * by_layer:.3g} us")


def record_row(run, row, n):
    """Record the shares of a `BreakEvenRow`."""
    note = (f"{row.products:.3g} products and {1e6 * row.point:.3g} us a point "
            f"(at least {1e6 * row.bound:.2g} us at the rate of a matrix product), full-order "
            f"{1e6 * row.particle:.3g} us a particle; finding points and inversion left out")
    for word, value, unit, meaning in (
            ("even", 100.0 * row.even, "%", "share of points at which both take as long"),
            ("ten", 100.0 * row.ten, "%", "share at which a reduced step takes a tenth"),
            ("speedup", row.speedup, "x", "at best, with the printed share of "
             f"{100.0 * row.printed_share:.3g} % of the particles")):
        run.record(f"nsf.breakeven.{row.scene}.{row.fields}.{word}", value, unit=unit,
                   scale=f"{n} particles", note=f"{meaning}; {note}", **INFO)
