"""A small study for tests of NSF's model: two disks in 2D of which one is plastic, thrown at each
other at several speeds.
"""

from command_line import mpm_ref
from edited_text import write_edited

STEPS, EVERY, RUNS = 16, 2, 4
SCENE = f"""
title = "Disks"
dim = 2
dx = 0.1
dt = 2e-3
steps = {STEPS}
every = {EVERY}
gravity = [0.0, -9.8]
scheme = {{ transfer = "apic" }}

[[body]]
name = "hard"
density = 1000.0
shape = {{ type = "sphere", center = [0.3, 0.3], radius = 0.2 }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "fixed_corotated", E = 1e5, nu = 0.3 }}
velocity = {{ linear = [2.0, 0.0] }}

[[body]]
name = "soft"
density = 500.0
shape = {{ type = "sphere", center = [0.75, 0.32], radius = 0.2 }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "hencky", E = 5e4, nu = 0.3, flow = {{ type = "von_mises", tau_y = 2e3 }} }}
"""
STUDY = f"""
title = "Two disks"
model = "nsf"
scene = "disks.toml"
test = 1

[[parameter]]
name = "v"
key = "body.hard.velocity.linear[0]"
from = 1.6
to = 2.4
count = {RUNS}

[map]
kind = "modes"
r = 3
modes = 5
tau = 8
C = 8
smoothing = 1e-6

[run]
points = 20
"""


def write(folder, *edits, scene=SCENE):
    """Path of the study in a folder, with (before, after) of some of its text."""
    (folder / "disks.toml").write_text(scene)
    return write_edited(folder / "pairs.toml", STUDY, edits)


def modelled(folder):
    """The folder, with a study, its runs in data/ and its fields in fields.npz."""
    study = write(folder)
    for arguments, said in ((("generate", study, "--out", folder / "data", "--workers", 1),
                             "made 4, continued 0, 0 were there; 1 held out"),
                            (("train", study, "--data", folder / "data", "--out",
                              folder / "fields.npz"), "modes, r = 3, of 3 runs and ")):
        done = mpm_ref("rom", *arguments)
        assert done.exit_code == 0, done.output
        assert said in done.stdout
    return folder
