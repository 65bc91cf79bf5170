"""Maps with latent coordinates that move nothing, or nothing that others do not move."""

import numpy as np

from mpm_ref.rom.fields.network import Decoder
from mpm_ref.rom.fields.perceptron import layers_of, network
from mpm_ref.rom.fields.pod import PodModes
from mpm_ref.rom.study.run import SCHEMES, RunOptions

from ..common.registry import experiment
from ..ldm.studies import GRAVITY
from .ldm_points import Bench
from .ldm_runs import learned, linear, record_silent, table_of

NET, R = "gravity-r4", 4
NEAR = {"quick": (1e-7, 1e-13), "standard": (1e-3, 1e-5, 1e-7, 1e-13)}     # from a column to its
                    # copy, over the column
RANKED = 1e-10      # the rank is counted down to here
SAME = 1.1          # errors within this factor are as good
FEW = 10            # samples
SCALE = "gravity 7.5 m/s^2, r = 4 and one coordinate more"


def wider(reduction, row, name):
    """A trained map with one more latent coordinate, whose weights (width,) in the first layer are
    given; in training it was zero.
    """
    (W, b), *rest = layers_of(reduction.map.net)
    net = network([(np.vstack([W, row]), b), *rest])
    return reduction._replace(name=name, map=Decoder(net, reduction.map.units),
                              xhat=with_zero(reduction.xhat), rest=with_zero(reduction.rest))


def changed(reduction, row, name):
    """A trained map whose last latent coordinate has other weights in the first layer: spoilt."""
    (W, b), *rest = layers_of(reduction.map.net)
    net = network([(np.vstack([W[:-1], row]), b), *rest])
    return reduction._replace(name=name, map=Decoder(net, reduction.map.units))


def lacking(sound):
    """`Reduction`s that cannot do all that the sound one does."""
    W = layers_of(sound.map.net)[0][0]
    return [changed(sound, 0.0 * W[-1], "the last column zero"),
            changed(sound, W[-2], "the last column as the one before")]


def repeated(reduction, share, name):
    """POD modes with one more: a share of the first."""
    map = reduction.map
    U, slope = (np.concatenate([a, share * a[..., :1]], axis=-1) for a in (map.U, map.slope))
    return reduction._replace(name=name, map=PodModes(map.X, U, slope, map.tree),
                              xhat=with_zero(reduction.xhat), rest=with_zero(reduction.rest))


def with_zero(a):
    """An array with one more entry, zero, on its last axis."""
    return np.concatenate([a, np.zeros_like(a[..., :1])], axis=-1)


def redundant(sound, pod, near, rng):
    """[(`Reduction`, rank)] that can do what the sound ones do; near: distances of columns."""
    W = layers_of(sound.map.net)[0][0]
    noise = rng.normal(size=W.shape[1]) * np.abs(W[-1]).max()
    found = [(wider(sound, 0.0 * W[-1], "a column of zeros"), R),
             (wider(sound, W[-1], "a column twice"), R),
             (repeated(pod, 1.0, "a mode twice"), R), (repeated(pod, 0.0, "a mode of zeros"), R)]
    return found + [(wider(sound, W[-1] + eps * noise, f"a column and one {eps:g} from it"),
                     R + (eps > RANKED)) for eps in near]


@experiment("extremes.ldm.singular", title="LDM: latent coordinates that depend on each other",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 40})
def singular(run):
    """The rank must be told; a redundant coordinate must do no harm, a missing one be noticed."""
    sound = learned(NET)
    pod = linear(GRAVITY.run(GRAVITY.train[::run.choose(quick=12, standard=6)]), R)
    ways = [RunOptions(*scheme) for scheme in run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])]
    plain = {False: Bench(sound), True: Bench(pod)}
    more, tried = [], []
    for reduction, rank in run.progress(redundant(sound, pod, NEAR[run.profile], run.rng),
                                        "maps"):
        of = plain[isinstance(reduction.map, PodModes)]
        bench = Bench(reduction, usual=of.usual)
        more += [(bench.trial("redundant", way), of.ended(way).error, rank) for way in ways]
        tried.append(bench.trial("redundant", RunOptions(points=FEW)))
    less = [Bench(reduction, usual=plain[False].usual).trial("lacking", way)
            for reduction in lacking(sound) for way in ways]
    record_redundant(run, more, tried)
    found = [trial for trial, *_ in more] + tried + less
    record_silent(run, "extremes.ldm.singular", found, SCALE)
    table_of(run, found)


def record_redundant(run, more, tried):
    """Record ranks and errors of maps with too many coordinates, rows (`Trial`, error of the sound
    map, rank); and what few samples make of them.
    """
    wrong = [f"{t.map}: {t.end.rank}" for t, _, rank in more if t.end.rank != rank]
    run.record("extremes.ldm.singular.rank", 1.0 - len(wrong) / len(more), paper=1.0,
               comparator="=", scale=f"{len(more)} runs, {SCALE}",
               note="; ".join(("share whose rank was told right", *wrong)))
    apart = {t: max(t.end.error / error, error / t.end.error) for t, error, _ in more}
    worst = max(apart, key=apart.get)
    run.record("extremes.ldm.singular.harm", apart[worst], comparator="<=", bound=SAME,
               scale=f"{len(more)} runs, {SCALE}", note="error over that of the map without the "
               f"coordinate, or the reverse, at most: {worst.map}, {worst.scheme}")
    worst = max(tried, key=lambda t: t.end.error / t.usual)
    run.record("extremes.ldm.singular.few", worst.end.error, unit="%", comparator="info",
               scale=f"{FEW} samples", note=f"largest error: {worst.map}; the sound map's with all "
               f"samples is {worst.usual:.3g} %")
