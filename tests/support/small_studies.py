"""A small study for tests: a bar in 2D that is held at one end and bends under gravity."""

from edited_text import write_edited

from mpm_ref.rom import model_file
from mpm_ref.rom.study import dataset, reduce
from mpm_ref.rom.study.generate import FINISHED, generate
from mpm_ref.rom.study.play import play_session
from mpm_ref.rom.study.study import load
from mpm_ref.store.results import Results

STEPS = 8
SCENE = f"""
title = "Bar"
dim = 2
dx = 0.1
dt = 0.01
steps = {STEPS}
every = 4
gravity = [0.0, -1.0]
scheme = {{ transfer = "pic" }}

[[body]]
name = "bar"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.0], upper = [0.8, 0.2] }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.3 }}

[[fixed]]
name = "wall"
region = {{ type = "half_space", point = [0.0, 0.0], normal = [1.0, 0.0] }}
motion = {{ translation = {{ type = "steady", rate = [0.0, 0.0] }} }}
"""
STUDY = """
title = "Bars"
scene = "bar.toml"
test = 1

[[parameter]]
name = "g"
key = "gravity[1]"
scale = -1.0
from = 1.0
to = 4.0
count = 4

[map]
kind = "modes"
r = 3
"""

CURVED = (("r = 3", "r = 2\nmodes = 4"), ('"modes"', '"curved"'),
          ("[map]", '[run]\nprojection = "nonlinear"\n\n[map]'))     # edits


def session_of(folder, g=2.5):
    """A session of `mpm-ref rom play` with the study and the map that `modelled` made."""
    study = load(folder / "bars.toml")
    return play_session(study, reduce.load(folder / "map.npz", study), [g], (0, 1))[0]


def write(folder, *edits, scene=SCENE):
    """Path of the study in a folder, with (before, after) of some of its text."""
    (folder / "bar.toml").write_text(scene)
    return write_edited(folder / "bars.toml", STUDY, edits)


def study(folder, *edits, **scene):
    """The `ReducedStudy`."""
    return load(write(folder, *edits, **scene))


def generated(folder, data="."):
    """The `ReducedStudy` in a folder, and the folder in it with its runs."""
    bars, data = study(folder), folder / data
    data.mkdir(exist_ok=True)
    assert [(done.number, done.why) for done in generate(bars, data)] == [
        (k, FINISHED) for k in range(4)]
    return bars, data


def modelled(folder):
    """The folder, with a study, its runs in data/ and modes of them in map.npz."""
    bars, data = generated(folder, "data")
    runs = dataset.load(bars, data, bars.train)
    model_file.save(folder / "map.npz", reduce.compute_model(bars, runs, {}))
    return folder


def ended(path):
    """Why a run ended, and its frames."""
    with Results(path) as results:
        return results.manifest["parts"][-1]["why"], len(results)
