"""`mpm-ref info`: what results, a checkpoint, a scene, a study, a map or learned laws hold."""

from pathlib import Path
from typing import Annotated

import typer

from .. import scene
from ..store import checkpoint
from ..store.words import counted
from . import info, law_info, law_study_info, npz_info, rom_info
from .faults import at_start, one_line, options
from .shipped import find_scene, is_hdf5, study_named
from .terminal import compiling, warn


def describe(
    name: Annotated[str, typer.Argument(metavar="FILE|SCENE|STUDY")],
    json: Annotated[bool, typer.Option("--json", help="Answer with JSON.")] = False,
):
    """Say what results, a checkpoint, a scene, a study, a map or learned laws hold."""
    with one_line():
        facts, lines = _facts(name)
        warn(facts.get("warnings", []))
        print(info.as_json(facts) if json else "\n".join(lines))


def _facts(name):
    """(facts, lines) of whatever a name stands for."""
    if not is_hdf5(name):
        return _facts_of_npz_or_text(name)
    if checkpoint.is_one(name) or checkpoint.is_named_so(name):
        facts = checkpoint.summary(name)
        return facts, [f"checkpoint: step {facts['step']}, t = {facts['t']:.6g} s, after "
                       f"{counted(facts['frames'], 'frame')}; "
                       f"scene sha256 {facts['scene_sha256'][:12]}"]
    facts = info.of_results(name)
    return facts, info.results_lines(facts)


def _facts_of_npz_or_text(name):
    with compiling(), options():
        if npz_info.is_npz(name):
            return npz_info.of_npz(name)
        study = study_named(name)
        if rom_info.is_study(study):
            facts = rom_info.of_study(name)
            return facts, rom_info.study_lines(facts)
        if law_study_info.is_one(study):
            facts = law_study_info.of_study(study)
            return facts, law_study_info.lines(facts)
        layers = law_info.in_text(Path(name))
        if layers is not None:
            facts = law_info.of_layers(name, layers)
            return facts, law_info.lines(facts)
    return _facts_of_scene(find_scene(name))


def _facts_of_scene(path):
    with compiling(), at_start(path):
        facts = info.of_problem(scene.build(scene.load(path), str(path)))
    return facts, info.problem_lines(facts)
