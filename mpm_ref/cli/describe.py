"""`mpm-ref info`: what a results file, a checkpoint, a scene, a study or a map holds."""

from typing import Annotated

import typer

from .. import scene
from ..store import checkpoint
from ..store.words import counted
from . import info, rom_info
from .faults import at_start, one_line, options
from .shipped import find_scene, is_hdf5
from .terminal import compiling, warn


def describe(
    name: Annotated[str, typer.Argument(metavar="FILE|SCENE|STUDY")],
    json: Annotated[bool, typer.Option("--json", help="Answer with JSON.")] = False,
):
    """Say what a results file, a checkpoint, a scene, a study or a map holds."""
    with one_line():
        facts, lines = _facts(name)
        warn(facts.get("warnings", []))
        print(info.as_json(facts) if json else "\n".join(lines))


def _facts(name):
    """(facts, lines) of whatever a name stands for."""
    if not is_hdf5(name):
        return _facts_of_text_or_map(name)
    if checkpoint.is_one(name) or checkpoint.is_named_so(name):
        facts = checkpoint.summary(name)
        return facts, [f"checkpoint: step {facts['step']}, t = {facts['t']:.6g} s, after "
                       f"{counted(facts['frames'], 'frame')}; "
                       f"scene sha256 {facts['scene_sha256'][:12]}"]
    facts = info.of_results(name)
    return facts, info.results_lines(facts)


def _facts_of_text_or_map(name):
    with compiling(), options():
        if rom_info.is_map(name):
            facts = rom_info.of_map(name)
            return facts, rom_info.map_lines(facts)
        if rom_info.is_study(name):
            facts = rom_info.of_study(name)
            return facts, rom_info.study_lines(facts)
    return _facts_of_scene(find_scene(name))


def _facts_of_scene(path):
    with compiling(), at_start(path):
        facts = info.of_problem(scene.build(scene.load(path), str(path)))
    return facts, info.problem_lines(facts)
