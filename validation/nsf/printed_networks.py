"""NSF's three networks as printed: widths, encoder and rates of the paper (NSF-arch, NSF-encoder,
NSF-train), on the jelly cube at the printed resolution, on the metal frame and the sand at half.

The paper shows all points of up to 32 snapshots at once, for 300 epochs of the position and 600 of
the other two networks at each of five rates; it could mean these numbers in total, as is done here.
Its trainings take 2 to 20 hours on a graphics processor. Here each batch shows a part of the
points, drawn anew, which leaves the number of steps of the optimiser as it is.
Each is a file of weights, made by `python -m validation.training.nsf NAME --folder
results/training`; of 5 to 10 MB, it is not in the repository.
"""

from functools import cache
from pathlib import Path

import numpy as np

from mpm_ref.rom.model_file import load
from mpm_ref.rom.study.errors import PositionErrors

from ..common.registry import experiment
from ..common.weights_needed import load_available, load_weights
from .errors import COLUMNS, error_rows, mean, record_errors, record_mean
from .networks import FieldsNet, NetworkPlan, identity
from .networks_runs import DRAWS, TRAINED, fit_to_networks, printed, printed_error, scale_of
from .studies import jelly, metal, sand

FOLDER = Path(__file__).parents[2] / "results" / "training"

BATCH, POINTS = 32, 32                      # snapshots, and points shown of each
EPOCHS = {"g": 300, "h": 600, "l": 600}    # of each network (NSF-train)


def printed_nets():
    """Return {name: `FieldsNet`} of the scenes whose networks are trained as printed."""
    return {f"{name}-printed": as_printed(study) for name, study in (
        ("jelly", jelly()), ("metal", metal(2)), ("sand", sand(2)))}


def as_printed(study):
    """Return the `FieldsNet` of a study with the printed widths, latent coordinates, epochs and
    rates.
    """
    widths = printed(study.scene.removeprefix("nsf_"))
    g, h, l = (NetworkPlan(widths[name], EPOCHS[name], 0.0) for name in "ghl")
    return FieldsNet(study, g, h, l, batch=BATCH, points=POINTS, latent="encoder-nsf",
                     schedule="steps")


@cache
def trained_as_printed(name):
    """Return the `Model` of a scene. Raises as `networks.trained`."""
    return load_weights(FOLDER / f"{name}.npz", identity(printed_nets()[name]), load,
                        f"python -m validation.training.nsf {name} --folder results/training")


@experiment("nsf.networks-printed", title="NSF: networks with the printed widths and encoder",
            profiles=("standard",), budget={"standard": 7000})
def networks_as_printed(run):
    """Record the errors of these networks on their training runs, and of reduced runs on them."""
    rows = []
    for name, model in load_available(run, printed_nets(), trained_as_printed).items():
        net = printed_nets()[name]
        one = fit_to_networks(model, net.study)
        record_fit(run, name, model.about["errors"], scale_of(net, one))
        rows += record_runs(run, name, one, scale_of(net, one))
    run.table("errors", ("scene", *COLUMNS[1:]), rows)


def record_fit(run, name, errors, scale):
    """Record the errors of three networks on some of their training snapshots."""
    for field, error in errors.items():
        run.record(f"nsf.networks-printed.{name}.fit.{field}", 100.0 * error, unit="%",
                   comparator="info", scale=scale, note="on snapshots of the training, over the "
                   "norm of the field")


def record_runs(run, name, one, scale):
    """Record the errors of reduced runs with few samples and of the nearest states; return rows."""
    target, few = f"nsf.networks-printed.{name}", one.study.samples
    rows = [row for draw in run.progress(range(DRAWS), f"{name}, {few} samples")
            for row in error_rows(one, name, few, (draw,))]
    record_mean(run, printed_error(name, target), rows, scale, f"{few} samples",
                fields=TRAINED["fields"])
    run.record(f"{target}.stress", 100.0 * mean(rows, "stress"), unit="%", comparator="info",
               scale=scale, note="of the Kirchhoff stress, all particles and times")
    nearest = [one.nearest_state_errors(value) for value in one.study.test]
    record_errors(run, f"{target}.nearest", mean_errors(nearest), scale,
                  "nearest states that the networks know", **TRAINED)
    return rows


def mean_errors(errors):
    """Return the mean of some `PositionErrors`."""
    return PositionErrors(*np.mean(errors, axis=0))
