"""Implement `mpm-ref info`, which describes results, checkpoints, scenes, studies and models.

Each kind of file has facts, a dict for programs, and lines, the same content as text.
"""

from math import isfinite, isnan
from pathlib import Path
from typing import Annotated

import typer

from .. import scene
from ..body import filled
from ..energy_budget import Terms
from ..nclaw.strain_watch import poor_law_warnings, time_step_warnings
from ..preflight import misplaced
from ..rom.model_file import is_model
from ..rom.study import record
from ..store import checkpoint, manifest
from ..store.atomic import size_text
from ..store.manifest import scene_hash
from ..store.results import ENERGIES, Results
from ..store.running import checkpoint_of
from ..store.text import counted
from ..store.weights_file import MAGIC, load_arrays
from ..timestep import TimeStep, stable_dt
from . import law_info, rom_info
from .catalogue import find_scene, is_hdf5, study_named
from .errors import at_start, exit_on_errors, options
from .study_kinds import is_law_study, is_study
from .terminal import as_json, compiling, warn


def of_problem(problem, state=None):
    """Return size, wave speed, bounds of the time step and memory of a `Problem` as it stands, and
    warnings about it; state: the first one of a run, where that was computed.
    """
    stepper = problem.stepper()
    bounds = state.terms if state is not None else None
    if bounds is None:
        bounds = stable_dt(filled(problem.bodies), stepper)
    grid = stepper.storage.cover([body.particles.x for body in filled(problem.bodies)])
    clock = problem.clock
    return {
        "title": problem.title,
        "dim": problem.dim,
        "bodies": {body.name: len(body.id) for body in problem.bodies},
        "particles": sum(len(body.id) for body in problem.bodies),
        "sources": {problem.bodies[one.body].name: {
            "particles": one.particles, "blocks": one.blocks, "start": one.start,
            "last": one.time(one.blocks - 1)} for one in problem.sources},
        "dx": problem.dx,
        "nodes": grid.m.size,
        "integrator": problem.integrator,
        "solver": solver_of(stepper),
        "wave_speed": None if stepper.implicit else problem.dx / bounds.elastic,
        "dt": clock.dt,
        "cfl": None if clock.dt else clock.cfl,
        "longest": clock.longest if isfinite(clock.longest) else None,
        "bounds": bounds._asdict(),
        "steps": clock.steps,
        "end": clock.end,
        "particle_bytes": sum(a.nbytes for body in problem.bodies
                              for name, a in body.particles._asdict().items()
                              if not (name == "C" and a is body.particles.L)),
        "grid_bytes": sum(a.nbytes for a in grid[:4]),
        "scene_sha256": scene_hash(problem),
        "warnings": [*misplaced(problem), *time_step_warnings(problem),
                     *poor_law_warnings(problem)],
    }


def solver_of(stepper):
    """Return method and tolerances of an implicit stepper, None for an explicit one."""
    if not stepper.implicit:
        return None
    options = stepper.options
    return {"method": options.method, "eps": options.eps,
            "displacement_tolerance": options.displacement_tolerance}


def of_results(path):
    """Return frames, times, energies, bodies, manifest and checkpoint of a results file."""
    with Results(path) as results:
        n = len(results)
        return {
            "title": results.title,
            "dim": results.dim,
            "bodies": {body: results.count(body) for body in results.bodies},
            "fields": {body: results.fields(body) for body in results.bodies},
            "dx": results.dx,
            "frames": n,
            "steps": int(results.step[-1]) if n else 0,
            "time": [float(t) for t in results.time[[0, -1]]] if n else None,
            "energy": dict(zip(ENERGIES, results.energy[-1].tolist(), strict=True)) if n else None,
            "checkpoint": str(checkpoint_of(path)) if checkpoint_of(path).exists() else None,
            "manifest": results.manifest,
            "reduced": record.summary(results),
            "rejected": manifest.count_so_far(results.manifest, "rejected"),
            "stalled": manifest.count_so_far(results.manifest, "stalled"),
            "warnings": [*unsolved(manifest.count_unsolved(results.manifest)),
                         *stalled(manifest.count_so_far(results.manifest, "stalled")),
                         *manifest.strain_warnings(results.manifest),
                         *manifest.error_warnings(results.manifest)],
        }


def unsolved(n):
    """Return the warning that n implicit steps did not converge, as a list of one or none."""
    if n == 0:
        return []
    return [f"{counted(n, 'implicit step')} of the run did not meet the solver's tolerance, which "
            'unstable = "allow" lets pass: what follows may be wrong; give the solver more '
            "`max_iterations`, or a larger `eps` or `displacement_tolerance`, or take a smaller dt"]


def stalled(n):
    """Return the warning that n implicit steps stood still, as a list of one or none."""
    if n == 0:
        return []
    return [f"{counted(n, 'implicit step')} of the run ended at its start, within its tolerance, "
            "although gravity or spin would move free matter by more than that: stiff bodies may "
            'hover; leave `start` and `balance` of the solver out, or say start = "gravity" and '
            'balance = "rigid"']


def rejected_line(n):
    """Return the number of rejected steps as a list of one line or none."""
    return [f"{counted(n, 'rejected step')}, tried again with half of dt"] if n else []


def problem_lines(facts):
    """Return facts of a problem as lines of text."""
    bodies = ", ".join(f"{name} {count}" for name, count in facts["bodies"].items())
    length = counted(facts["steps"], "step") if facts["steps"] else f"until t = {facts['end']:g} s"
    memory = size_text(facts["particle_bytes"]), size_text(facts["grid_bytes"])
    return [
        f"{facts['title'] or 'untitled'}: {facts['dim']}D, {facts['particles']} particles "
        f"({bodies}), dx = {facts['dx']:g} m, {facts['nodes']} nodes at the start",
        *(f"source {name!r}: {counted(one['blocks'], 'block')} from t = {one['start']:.4g} s to "
          f"{one['last']:.4g} s, {counted(one['particles'], 'particle')} in all"
          for name, one in facts["sources"].items()),
        f"{length}, {step_line(facts)}; {method(facts)}",
        f"memory: particles {memory[0]}, grid {memory[1]}",
    ]


def method(facts):
    """Return the wave speed of an explicit run, or the solver of an implicit one, as text."""
    if facts["wave_speed"] is not None:
        return f"wave speed {facts['wave_speed']:.4g} m/s"
    solver = facts["solver"]
    dx = solver["displacement_tolerance"]
    displacement = f", displacements to {dx:g} dx" if dx else ""
    return f"implicit: {solver['method']}, eps {solver['eps']:g}{displacement}"


def step_line(facts):
    """Return the choice of dt, and its bound with the finite terms, as text."""
    bound = TimeStep(**facts["bounds"])
    finite = ", ".join(f"{name.replace('_', ' ')} {term:.3g} s"
                       for name, term in bound._asdict().items() if isfinite(term))
    longest = f", longest {facts['longest']:.3g} s" if facts["longest"] else ""
    chosen = (f"fixed dt = {facts['dt']:.6g} s" if facts["dt"] else
              f"dt adaptive, cfl {facts['cfl']:g}{longest}")
    if not finite:
        return f"{chosen}, no particle bounds it at the start"
    return f"{chosen}, bound at the start {bound.dt:.3g} s ({finite})"


def results_lines(facts):
    """Return facts of a results file as lines of text."""
    bodies = ", ".join(f"{name} {count} ({' '.join(facts['fields'][name])})"
                       for name, count in facts["bodies"].items())
    lines = [f"{facts['title'] or 'untitled'}: {facts['dim']}D, dx = {facts['dx']:g} m, "
             f"bodies: {bodies}"]
    if facts["frames"]:
        energies = ", ".join(energy_in_words(*one) for one in facts["energy"].items())
        first, last = facts["time"]
        lines.append(f"{counted(facts['frames'], 'frame')}, t = {first:g} to {last:g} s, "
                     f"{counted(facts['steps'], 'step')}; at the end: {energies}")
    else:
        lines.append("no frame yet")
    lines += rejected_line(facts["rejected"])
    if facts["reduced"]:
        lines.append(record.summary_line(facts["reduced"]))
    for part in facts["manifest"].get("parts", []):
        lines += [part_line(part), *budget_line(part)]
    lines.append(f"checkpoint: {facts['checkpoint'] or 'none'}")
    return lines


def energy_in_words(name, value):
    """Return an energy [J] as text; NaN, for laws without energy, is unknown."""
    return f"{name} unknown" if isnan(value) else f"{name} {value:.6g} J"


def part_line(part):
    """Return a part of a run as text."""
    if "last_step" not in part:
        return f"part: from step {part['first_step']} on, began {part['began']}: {part['why']}"
    return (f"part: steps {part['first_step']} to {part['last_step']}, {part['wall_s']} s, "
            f"{size_text(part['peak_bytes'])}, state sha256 {part['state_sha256'][:12]}: "
            f"{part['why']}")


def budget_line(part):
    """Return the energy budget of a part of a run as a list of one line or none."""
    budget = part.get("energy_budget")
    if not budget:
        return []
    terms = ", ".join(f"{name} {budget[name]:+.4g}" for name in Terms._fields)
    return [f"  energy {budget['first']:.6g} to {budget['last']:.6g} J, changed by: {terms} "
            f"(gap {budget['gap']:.1g})"]


def describe(
    name: Annotated[str, typer.Argument(metavar="FILE|SCENE|STUDY", help="A file, or the name of "
                                        "a bundled scene or study.")],
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
):
    """Describe a results file, checkpoint, scene, study, reduced model or learned law."""
    with exit_on_errors():
        facts, lines = _facts(name)
        warn(facts.get("warnings", []))
        print(as_json(facts) if json else "\n".join(lines))


def _facts(name):
    """(facts, lines) of whatever a name stands for."""
    if not is_hdf5(name):
        return _facts_of_npz_or_text(name)
    if checkpoint.is_checkpoint(name) or checkpoint.has_checkpoint_name(name):
        facts = checkpoint.summary(name)
        return facts, [f"checkpoint: step {facts['step']}, t = {facts['t']:.6g} s, after "
                       f"{counted(facts['frames'], 'frame')}; "
                       f"scene sha256 {facts['scene_sha256'][:12]}"]
    facts = of_results(name)
    return facts, results_lines(facts)


def _facts_of_npz_or_text(name):
    with compiling(), options():
        if is_npz(name):
            return of_npz(name)
        study = study_named(name)
        if is_study(study):
            facts = rom_info.of_study(name)
            return facts, rom_info.study_lines(facts)
        if is_law_study(study):
            facts = law_info.law_study_facts(study)
            return facts, law_info.law_study_lines(facts)
        layers = law_info.read_json_layers(Path(name))
        if layers is not None:
            facts = law_info.layers_facts(name, layers)
            return facts, law_info.laws_lines(facts)
    return _facts_of_scene(find_scene(name))


def _facts_of_scene(path):
    with compiling(), at_start(path):
        record = scene.load(path)
        quantities = [one.text for one in record.quantity]
        facts = of_problem(scene.build(record, str(path))) | {"quantities": quantities}
    return facts, [*problem_lines(facts), *quantities_line(quantities)]


def quantities_line(texts):
    """Return the quantities of interest of a scene as a list of one line or none."""
    return [f"quantities of interest: {', '.join(texts)}"] if texts else []


SHOWN = 4           # names of arrays that a sentence shows


def is_npz(name):
    """Return whether a name is that of a file with the signature of npz files."""
    if not Path(name).is_file():
        return False
    with open(name, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def of_npz(name):
    """(facts, lines) of a map, of stress fields, of laws, of their layers or of a graph network.

    Raises ValueError for a file that is damaged or none of these.
    """
    path = Path(name)
    arrays = load_arrays(path)
    if is_model(arrays):
        facts = rom_info.of_map(path)
        return facts, rom_info.map_lines(facts)
    if law_info.is_graph_network(arrays):
        facts = law_info.graph_network_facts(path)
        return facts, law_info.graph_network_lines(facts)
    if law_info.has_laws(arrays):
        facts = law_info.layers_facts(path, arrays) if law_info.is_exported(arrays) else (
            law_info.laws_facts(path))
        return facts, law_info.laws_lines(facts)
    if epochs := law_info.epochs_of(arrays):
        raise ValueError(f"{path} holds the laws of several epochs, {', '.join(epochs)}, of a "
                         "training of the validation suite; expected those of one, as `mpm-ref law "
                         "train` writes them")
    names = sorted(arrays)
    more = ", .." if len(names) > SHOWN else ""
    raise ValueError(f"{path} holds no map, no laws and no graph network: it has "
                     f"{', '.join(names[:SHOWN])}{more}; name a file of `mpm-ref rom train`, "
                     "`mpm-ref law train` or `mpm-ref law export`")
