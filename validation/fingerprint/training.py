"""A few epochs of every training: laws by each method, graph networks, maps and fields.

A training without PyTorch raises; compare records that were both made with it.
"""

from functools import partial

from . import library_learn as learn
from .recording import RunCase

METHODS = ("ours", "labeled", "spline", "neural", "no rotation", "no undeformed", "admissible",
           "sys-id")
SMALL = {"steps": 40, "every": 1, "body.jelly.sampling.counts": [4, 4, 4]}
LAW = """
scene = "nclaw_jelly"
method = "{}"

[set]
steps = 40
body.jelly.sampling.counts = [4, 4, 4]

[train]
epochs = 2
first = 10
last = 20
"""
GRAPH = {"steps": 4, "width": 16, "blocks": 2, "batch": 1, "check": 2, "radius": 0.2}
LDM = """
scene = "ldm_gravity"
test = 1

[set]
steps = 5
body.cylinder.sampling.count = 200

[[parameter]]
name = "g"
key = "gravity[2]"
values = [-9.0, -5.0, -1.0]

[map]
kind = "network"
r = 2
hidden = [16, 16]
latent = "{}"
epochs = 3
points = 64
"""
NSF = """
model = "nsf"
scene = "nsf_jelly"
test = 1

[set]
dx = 0.03333333333333333
dt = 0.016666666666666666
steps = 12
every = 2
body.cube.sampling.count = 200
body.wall.sampling.count = 300

[[parameter]]
name = "v"
key = "body.cube.velocity.linear[0]"
values = [0.3, 0.4, 0.5]

[map]
kind = "network"
r = 3
beta = [4, 4, 4]
octaves = {}
latent = "{}"
epochs = 2
field_epochs = 2
points = 64
"""


def cases():
    """Return a `RunCase` of each training."""
    runs = [RunCase(f"training law {method}", partial(learn.law, LAW.format(method)))
             for method in METHODS]
    runs.append(RunCase("training graph", partial(learn.graph, "nclaw_jelly", SMALL, 5, GRAPH)))
    runs += [RunCase(f"training ldm {latent}", partial(learn.ldm, LDM.format(latent)))
              for latent in ("encoder", "free", "modes")]
    runs += [RunCase(f"training nsf {latent}", partial(learn.nsf, NSF.format(octaves, latent)))
              for octaves, latent in ((0, "encoder-nsf"), (2, "modes"))]
    return runs
