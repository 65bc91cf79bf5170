"""Golden files, and files to check against them: HDF5.

docs/reference/golden-files.md has the layout.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np

from ..body import Body
from ..plain.flows import FLOWS
from ..plain.laws import LAWS
from ..store.atomic import replacing, require_place
from . import accepted_step, adjoint_recording, implicit_recording, recording
from .comparison import refuse_no_numbers
from .schema import BESIDE, EVERY, FORMAT, NODES, key, taken

PACKED = {"compression": "gzip", "compression_opts": 9, "shuffle": True, "fletcher32": True}


def record(problem, path, steps, overwrite=False, begin=0, eps=None):
    """Record `steps` steps of a problem, after `begin` others, and write the golden file `path`.

    The problem's own arrays stay as they are; all steps have the dt of a run's next step. eps > 0
    is the tolerance of implicit steps, by default the scene's. Returns the numbers of implicit
    steps that had nothing to solve, which say nothing of a solver. Raises ValueError for steps < 1
    or past the end of the run, for names of bodies that cannot name groups, for a state in which
    the reference's own error is too large to judge others by, for an implicit step that is not
    solved, and where `path` exists, unless it is a golden file that overwrite lets go; `Unstable`;
    `NotWritten`.
    """
    require_free(path, overwrite)
    refuse_bodies(problem)
    run = implicit_recording.run if problem.integrator == "implicit" else recording.run
    return put(solved_to(problem, eps), path, (steps, begin), run)


def record_adjoint(problem, path, steps, overwrite=False, begin=0):
    """Record explicit steps as `record` does, each with its adjoint, stage by stage backwards.

    Raises ValueError as that does, and for what has no adjoint: implicit steps, conditions, laws
    and flows without one.
    """
    require_free(path, overwrite)
    refuse_bodies(problem)
    adjoint_recording.require_adjoints(problem)
    put(problem, path, (steps, begin), adjoint_recording.run)


def put(problem, path, when, run):
    """Write the golden file of the steps that `run` records, when = (steps, begin); returns the
    numbers of those that had nothing to solve.
    """
    steps, begin = when
    if steps < 1 or begin < 0:
        raise ValueError(f"steps = {steps}, begin = {begin}: expected at least one step to record, "
                         "after 0 or more")
    problem, state = recording.advanced(problem, begin)
    idle = []
    with replacing(path) as part, h5py.File(part, "w", libver=("v110", "v110")) as f:
        describe(f, problem)
        for k, recorded in enumerate(run(problem, steps, state)):
            put_step(f.create_group(f"steps/{k}"), recorded)
            idle += [k] * has_nothing_to_solve(recorded)
    return tuple(idle)


def has_nothing_to_solve(recorded):
    """Whether an implicit step was solved by the increment 0 that it began with."""
    report = recorded.report
    return report is not None and not report.iterations and not recorded.arrays["dv"].value.any()


def solved_to(problem, eps):
    """The problem with the tolerance eps of its implicit steps. Raises ValueError for an explicit
    one, or an eps that is none.
    """
    if eps is None:
        return problem
    if not 0.0 < eps < np.inf:
        raise ValueError(f"eps = {eps}: expected a tolerance, a finite number > 0")
    if problem.integrator != "implicit":
        raise ValueError(f"eps = {eps} with an explicit integrator: nothing is solved; leave it "
                         "out")
    return replace(problem, solver=replace(accepted_step.options_of(problem), eps=eps))


def require_free(path, overwrite):
    """Raise ValueError unless nothing stands at `path`, or a golden file that may be replaced."""
    require_place(path)
    if not Path(path).exists():
        return
    if not overwrite:
        raise ValueError(f"{path} exists: add --overwrite to replace it, or name another file")
    if not is_golden(path):
        raise ValueError(f"{path} is not a golden file, and only those are overwritten; remove it "
                         "yourself, or name another file")


def is_golden(path):
    """Whether a file is a golden one."""
    try:
        with h5py.File(path, "r") as f:
            return f.attrs.get("format") == FORMAT
    except OSError:
        return False


def refuse_bodies(problem):
    """Raise ValueError for names that are not unique, or mean something else in the file, and for
    laws and flows that the plain twin does not know.
    """
    names = [body.name for body in problem.bodies]
    clash = sorted(taken(problem.integrator) & set(names))
    if len(set(names)) < len(names) or any("/" in name or name.strip(".") == "" for name in names):
        raise ValueError(f"bodies {names}: expected a name of its own for each, without a slash")
    if clash:
        raise ValueError(f"body {clash[0]!r}: this names an array, or a group, of every "
                         f"{problem.integrator} step in the file; rename the body")
    for body in problem.bodies:
        for part, known in ((body.law, LAWS), (body.flow, FLOWS)):
            if type(part).__name__ not in known:
                raise ValueError(f"body {body.name!r}: {type(part).__name__} is not known to the "
                                 f"plain twin; expected one of {', '.join(sorted(known))}")


def describe(f, problem):
    """The problem: attributes of the file, and the initial state of each body."""
    s = problem.scheme
    f.attrs.update({
        "format": FORMAT, "title": problem.title, "scene": problem.source, "dim": problem.dim,
        "dx": problem.dx, "gravity": problem.gravity, "degree": s.degree, "transfer": s.transfer,
        "flip": s.flip, "rpic": s.rpic, "mass_eps": s.mass_eps,
        "gravity_on_empty": s.gravity_on_empty, "conditions": str(problem.conditions),
        "rule": "tolerance of an entry = tolerance_f64 or tolerance_f32 of its array * its scale",
    })
    if problem.integrator == "implicit":
        f.attrs.update(solver_attributes(accepted_step.options_of(problem)))
    if problem.clip is not None:
        f.attrs["clip"] = np.array(problem.clip)
    for body in problem.bodies:
        put_body(f.create_group(f"bodies/{body.name}"), body)


def solver_attributes(options):
    """What of an implicit solve another code has to know."""
    named = {"search": options.search._asdict(), "cycle": options.cycle._asdict()}
    return {"integrator": "implicit", "options": json.dumps({**asdict(options), **named}),
            **{name: getattr(options, name)
               for name in ("method", "eps", "displacement_tolerance", "norm", "start")}}


def put_body(group, body):
    """Material and initial state of a body."""
    for role in Body._fields[2:4]:
        record_ = getattr(body, role)
        group.attrs[role] = type(record_).__name__
        group.attrs[f"{role}_parameters"] = json.dumps(record_._asdict())
    for name, a in body.particles._asdict().items():
        if len(a) and name not in ("L", "tau"):         # both follow from the rest
            group.create_dataset(name, data=a, **PACKED)
    group.create_dataset("id", data=np.arange(len(body.id)), **PACKED)


def put_step(group, recorded):
    """One step: every array with its scale, its own error and its tolerances."""
    group.attrs.update({"t": recorded.t, "dt": recorded.dt})
    group.create_dataset("nodes", data=recorded.nodes.astype(np.int32), **PACKED)
    for name, a in recorded.inputs.items():
        group.create_dataset(name, data=a.astype(np.int32) if name in NODES else a, **PACKED)
    for name, a in recorded.bars.items():
        group.create_dataset(f"bar/{name}", data=a, **PACKED)
    if recorded.report is not None:
        put_report(group.create_group("report"), recorded.report)
    for name, base in recorded.bases.items():
        group.create_dataset(f"{name}/base", data=base.astype(np.int32), **PACKED)
    stages = {array.name: array for array in EVERY}
    for name, a in recorded.arrays.items():
        data = group.create_dataset(name, data=a.value, **PACKED)
        group.create_dataset(f"scale/{name}", data=a.scale, **PACKED)
        array = stages[name.split("/")[-1]]
        data.attrs.update({
            "stage": array.stage, "unit": array.unit, "error_twin": a.twin,
            "error_reordered": a.reordered, "error_in_units": a.error,
            **{f"tolerance_{p}": a.tolerance(p) for p in recording.EPS},
        })


def put_report(group, report):
    """How the scene's method solved the step: numbers to look at, that no check compares."""
    said = {name: a for name, a in report._asdict().items() if name not in ("clock", "seconds")}
    group.attrs.update({name: np.array(a) if name == "residuals" else a
                        for name, a in said.items()})


def write(path, steps):
    """Write another code's arrays in the layout that `check` reads.

    steps is a list with one dictionary {key: array} for each step of the golden file, in order;
    None for a step that was not computed. Keys are `mass`, `velocity`, .. on nodes, and `ball/x`,
    `ball/C`, .. for the particles of the body "ball", or just `x`, `C` where there is one body.
    Grid arrays are lists over `nodes`, (M, d) integer coordinates (node i lies at i dx); or whole
    grids (n1, .., nd[, d]) with `origin` (d,), the coordinates of the first node. Particles in
    another order come with `id` (N,), the number of each in the golden file. What is left out is
    not checked. Raises ValueError for a key that no golden file has, and for what is no array of
    numbers.
    """
    refuse_no_list(steps)
    with replacing(path) as part, h5py.File(part, "w", libver=("v110", "v110")) as f:
        f.create_group("steps")
        for k, arrays in enumerate(steps):
            for name, a in listed(arrays or {}).items():
                refuse_key(name)
                refuse_no_numbers(name, np.asarray(a))
                f.create_dataset(f"steps/{k}/{name}", data=a)


def refuse_no_list(steps):
    """Raise ValueError unless steps is a list of dictionaries, and None."""
    if not isinstance(steps, list | tuple):
        raise ValueError(f"steps is a {type(steps).__name__}: expected a list with a dictionary of "
                         "arrays for each step")
    for k, arrays in enumerate(steps):
        if not (arrays is None or isinstance(arrays, dict)):
            raise ValueError(f"steps[{k}] is a {type(arrays).__name__}: expected a dictionary of "
                             "arrays, or None for a step that was not computed")


def refuse_key(name):
    """Raise ValueError for a key that is not in the schema."""
    known = [array.name for array in EVERY]
    if name.split("/")[-1] not in (*known, *BESIDE):
        raise ValueError(f"array {name!r}: expected one of {', '.join(known)}, for particles with "
                         f"the name of their body in front, or {', '.join(BESIDE)}")


def listed(arrays):
    """The arrays with whole grids, if there is an `origin`, as lists over their nodes with mass."""
    if "origin" not in arrays:
        return arrays
    if "mass" not in arrays:
        raise ValueError("origin without mass: whole grids need `mass`, which tells their nodes")
    full = np.asarray(arrays["mass"]) != 0.0       # NaN counts: it must be seen
    out = {name: a for name, a in arrays.items() if name != "origin"}
    for array in EVERY:
        if array.where == "nodes" and not array.level and key(array) in out:
            out[key(array)] = np.asarray(out[key(array)])[full]
    out["nodes"] = np.argwhere(full) + np.asarray(arrays["origin"])
    return out
