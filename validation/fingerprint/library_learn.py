"""Calls of mpm_ref's trainings, which need PyTorch; see `library`."""

from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from mpm_ref.nclaw.gnn.features import box_of
from mpm_ref.nclaw.study import study as law_study
from mpm_ref.nclaw.study.training import train_study
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history, simulate_snapshots
from mpm_ref.rom.study.reduce import train_model
from mpm_ref.rom.study.study import load
from mpm_ref.scene import build
from mpm_ref.training import Machine, import_with_torch
from mpm_ref.trajectories import observed

from .library import ROOT, problem, scene_names

SCENES = {name: ROOT / "scenes" / f"{name}.toml" for name in scene_names()}


@contextmanager
def study_file(text):
    """Write the text of a study into a file of its own for as long as the block runs."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(text, encoding="utf-8")
        yield path


def law(text):
    """Return the weights of both laws of a law study after its training."""
    with study_file(text) as path:
        study = law_study.load(path, SCENES)
        laws = train_study(study, observed(study.problem()), threads=1)
    return {"elastic": laws[0], "plastic": laws[1]}


def graph(scene, values, frames, recipe):
    """Return a graph network trained on every `frames`-th step of a scene, and its error."""
    world = problem(scene, values)
    box, dt = box_of(world.conditions.walls, world.dx), frames * world.clock.dt
    x, v, *_ = observed(world)
    examples, fit = (import_with_torch(f"nclaw.gnn.train.{name}", "", "")
                     for name in ("examples", "fit"))
    run = examples.training_run(x[::frames], v[0], dt, box)
    session = fit.train_graph(fit.GraphRecipe(**recipe), [run], dt)
    network, reading, _ = session.simulator({})
    return {"network": network, "reading": reading, "history": session.history}


def ldm(text):
    """Return the map, latent coordinates and coordinates at rest of a study's training."""
    with study_file(text) as path:
        study = load(path, SCENES)
        runs = simulate_snapshots((build(study.scene(study.mu[k])) for k in study.train),
                         study.mu[list(study.train)])
        model = train_model(study, runs, {}, path.with_suffix(".pt"), lambda history: None,
                            Machine())
    decoder, xhat, rest, _ = model
    return {"latent": xhat, "rest": rest, "derivatives": decoder.derivatives(runs.X, rest)}


def nsf(text):
    """Return three networks, latent coordinates and coordinates at rest of a study's training."""
    with study_file(text) as path:
        study = load(path, SCENES)
        runs = join_histories((simulate_history(study.scene(study.mu[k]), study.mu[k],
                                        every=study.base.every)
                       for k in study.train), len(study.train))
        model = train_model(study, runs, {}, path.parent / "stages", lambda history: None,
                            Machine())
    fields, xhat, rest, _ = model
    return {"latent": xhat, "rest": rest, "networks": tuple(fields)}
