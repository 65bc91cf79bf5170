"""What NSF's networks cost and give by the width of their hidden layers."""

from ..common.registry import experiment
from ..common.weights_needed import load_available
from ..nsf.errors import COLUMNS, error_rows, mean, record_mean
from ..nsf.networks import narrow, net_of, trained
from ..nsf.networks_runs import OUTPUTS, TRAINED, fit_to_networks, scale_of, weight_count
from .nsf import full_cpu, reduced_cpu

DOUBLE = 8              # bytes of a weight
DRAWS, REPEATS = 3, 3   # of samples; of times
OWN = ("width", "bytes", "cpu", "cpu_full", *COLUMNS[1:])


@experiment("trade.nsf.widths", title="NSF: error and cost by the width of networks",
            profiles=("standard",), budget={"standard": 300})
def of_widths(run):
    """The jelly cube with features: the usual samples, drawn, and all particles."""
    found = load_available(run, [*narrow(), "jelly-waves"], trained)
    rows = [row for name, model in run.progress(found.items(), "widths")
            for row in of_width(run, net_of(name), model)]
    run.table("widths", OWN, rows)


def of_width(run, net, model):
    """Record errors and cost of a `Net`; its rows."""
    one, width = fit_to_networks(model, net.study), net.g.width
    scale, few = scale_of(net, one), net.study.samples
    size = DOUBLE * sum(weight_count(net.study, own, width, net.octaves if own != "g" else 0)
                        for own in OUTPUTS)
    cpu, full = reduced_cpu(one, few, False, REPEATS), full_cpu(one)
    drawn = error_rows(one, f"{width} wide", few, range(DRAWS))
    every = error_rows(one, f"{width} wide", len(one.fields.X), (0,))
    for word, rows, note in (("", drawn, f"{few} samples; {cpu:.3g} CPU s beside {full:.3g} of the "
                              f"full-order run, {size / 1e3:.3g} kB of weights"),
                             (".all", every, "all particles are samples")):
        record_mean(run, f"trade.nsf.widths.{width}{word}", rows, scale,
                    f"{note}; of the stress {100.0 * mean(rows, 'stress'):.3g} %", **TRAINED)
    return [(width, size, cpu, full, *row[1:]) for row in drawn + every]
