"""Reduced runs of NSF: fields of modes and of networks, samples, inversions, joint coordinates."""

from functools import partial

from . import library_rom as rom
from .recording import RunCase

STEPS = 20
MODES = {
    "drawn": ("drawn", 100),
    "all points": ("drawn", 1250),
    "linear": ("drawn", 100, {"inversion": "linear"}),
    "longer steps": ("drawn", 100, {"factor": 1.5}),
    "weighted": ("weighted", 40),
    "weighted linear": ("weighted", 40, {"inversion": "linear"}),
    "cells": ("cells", 10),
    "map alone": ("drawn", 100, {"map_alone": True}),
}
NETWORKS = {        # weights: scene, its values, parameters, samples, steps
    "jelly": ("nsf_jelly", {"body.cube.velocity.linear[0]": 0.45}, [], 50, 6),
    "jelly-waves-32": ("nsf_jelly", {"body.cube.velocity.linear[0]": 0.45}, [], 50, 6),
    "metal": ("nsf_metal", {"dx": 0.02, "dt": 0.003}, [0.08], 50, 6),
}
SHEAR = ("nsf_shear", "fixed.top.motion.translation.amplitude[0]", (0.02, 0.03, 0.04),
         {"steps": 300, "every": 15}, (4, 12, 12, 12, 1.0, 1e-2), (40, 30))


def cases():
    """Return a `RunCase` of each kind of reduced run."""
    runs = [RunCase("nsf modes data", rom.data_of_modes)]
    runs += [RunCase(f"nsf modes {name}", partial(on_modes, *arguments))
             for name, arguments in MODES.items()]
    runs += [RunCase(f"nsf networks {name}", partial(rom.nsf_networks, name, *arguments))
             for name, arguments in NETWORKS.items()]
    runs.append(RunCase("nsf joint", partial(rom.nsf_joint, *SHEAR)))
    return runs


def on_modes(samples, count, options=None):
    """Return a run on fields of modes."""
    return rom.nsf_modes(samples, count, STEPS, **(options or {}))
