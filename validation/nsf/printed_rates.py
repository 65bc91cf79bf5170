"""NSF's networks of the jelly cube with the printed epochs at each of the five printed rates.

The sentence on the training (NSF-train) can be read so, or as the epochs in total, which
`printed_networks` has. Weights: `python -m validation.training.nsf jelly-rates --folder
results/training`.
"""

from functools import cache

from mpm_ref.rom.model_file import load

from ..common.registry import experiment
from ..common.weights_needed import load_available, load_weights
from .errors import COLUMNS, error_rows, mean, record_errors, record_mean
from .networks import identity
from .networks_runs import DRAWS, TRAINED, fit_to_networks, scale_of
from .printed_networks import FOLDER, mean_errors, printed_nets

RATES = 5           # learning rates (NSF-train)


def rates_nets():
    """Return {name: `FieldsNet`} of trainings that are five times as long as `printed_nets` are."""
    net = printed_nets()["jelly-printed"]
    networks = {name: getattr(net, name) for name in "ghl"}
    return {"jelly-rates": net._replace(**{
        name: own._replace(epochs=RATES * own.epochs) for name, own in networks.items()})}


@cache
def trained_at_each_rate(name):
    """Return the `Model` of a training. Raises as `networks.trained`."""
    return load_weights(FOLDER / f"{name}.npz", identity(rates_nets()[name]), load,
                        f"python -m validation.training.nsf {name} --folder results/training")


@experiment("nsf.networks-rates", title="NSF: networks trained as long at each rate as printed",
            profiles=("standard",), budget={"standard": 2000})
def networks_at_each_rate(run):
    """Record the errors of these networks on their training runs, and of reduced runs on them."""
    rows = []
    for name, model in load_available(run, rates_nets(), trained_at_each_rate).items():
        net = rates_nets()[name]
        one = fit_to_networks(model, net.study)
        rows += record_runs(run, f"nsf.networks-rates.{name}", one, model.about["errors"],
                            scale_of(net, one))
    run.table("errors", ("scene", *COLUMNS[1:]), rows)


def record_runs(run, target, one, fit, scale):
    """Record the errors of three networks and of reduced runs with few samples; return rows."""
    rows = [row for draw in run.progress(range(DRAWS), "draws")
            for row in error_rows(one, "jelly", one.study.samples, (draw,))]
    record_mean(run, target, rows, scale, f"{one.study.samples} samples", **TRAINED)
    nearest = [one.nearest_state_errors(value) for value in one.study.test]
    record_errors(run, f"{target}.nearest", mean_errors(nearest), scale,
                  "nearest states that the networks know", **TRAINED)
    for word, error, note in (
            *((f"fit.{field}", error, "on snapshots of the training, over the norm of the field")
              for field, error in fit.items()),
            ("stress", mean(rows, "stress"), "of the Kirchhoff stress, all particles and times")):
        run.record(f"{target}.{word}", 100.0 * error, unit="%", comparator="info", scale=scale,
                   note=note)
    return rows
