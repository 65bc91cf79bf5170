"""NSF's three networks as printed: widths, encoder, rates and resolution of the paper (NSF-arch,
NSF-encoder, NSF-train).

The paper shows all points of up to 32 snapshots at once, for 300 epochs of the position and 600 of
the other two networks at each of five rates; it could mean these numbers in total, as is done here.
Its trainings take 2 to 20 hours on a graphics processor. Here each batch shows a part of the
points, drawn anew, which leaves the number of steps of the optimiser as it is.
Each is a file of weights, remade by `python -m validation.training.nsf NAME`.
"""

from functools import cache

from mpm_ref.rom.model_file import load
from mpm_ref.rom.train.stages import EPOCHS, FIELD_EPOCHS

from ..common.weights_needed import load_weights
from .networks import FOLDER, FieldsNet, NetworkPlan, identity
from .networks_runs import printed
from .studies import jelly

BATCH, POINTS = 32, 32      # snapshots, and points shown of each


def printed_nets():
    """Return {name: `FieldsNet`} of the scenes whose networks are trained as printed."""
    return {"jelly-printed": as_printed(jelly())}


def as_printed(study):
    """Return the `FieldsNet` of a study with the printed widths, latent coordinates, epochs and
    rates.
    """
    widths = printed(study.scene.removeprefix("nsf_"))
    g, h, l = (NetworkPlan(widths[name], epochs, 0.0)
               for name, epochs in zip("ghl", (EPOCHS, FIELD_EPOCHS, FIELD_EPOCHS), strict=True))
    return FieldsNet(study, g, h, l, batch=BATCH, points=POINTS, latent="encoder-nsf",
                     schedule="steps")


@cache
def trained_as_printed(name):
    """Return the `Model` of a scene. Raises as `networks.trained`."""
    return load_weights(FOLDER / f"{name}.npz", identity(printed_nets()[name]), load,
                        f"python -m validation.training.nsf {name}")
