"""Writing of golden files, and of files to check against them, in HDF5, sealed (`store.seal`).

docs/reference/golden-files.md has the layout.
"""

import json
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import h5py
import numpy as np

from ..body import Body
from ..core.surface import AT_NODES
from ..plain.flows import FLOWS
from ..plain.laws import LAWS
from ..store.atomic import NotWritten, replacing, require_place
from ..store.journal import JournaledFile
from ..store.seal import GOLDEN, WHOLE, seal, verify
from . import accepted_step, adjoint_recording, implicit_recording, recording
from .comparison import require_numbers
from .schema import ALL_ARRAYS, AUXILIARY, FORMAT, NODES, key, reserved_names

PACKED = {"compression": "gzip", "compression_opts": 9, "shuffle": True, "fletcher32": True}


def record(problem, path, steps, overwrite=False, begin=0, eps=None):
    """Record `steps` steps of a problem, after `begin` others, and write the golden file `path`.

    The problem's own arrays stay as they are; all steps have the dt of a run's next step. eps > 0
    is the tolerance of implicit steps, by default the scene's. Returns the numbers of implicit
    steps that had nothing to solve, which do not test a solver. Raises ValueError for steps < 1 or
    past the end of the run, for names of bodies that cannot name groups, for a state in which the
    reference's own error is too large to judge others by, for an implicit step that is not solved,
    and if `path` exists, unless it is a golden file and overwrite is set; `Unstable`; `NotWritten`.
    """
    require_writable(path, overwrite)
    require_recordable(problem)
    check_implicit(problem)
    module = implicit_recording if problem.integrator == "implicit" else recording
    return write_golden(with_tolerance(problem, eps), path, (steps, begin), module.record_steps)


def record_adjoint(problem, path, steps, overwrite=False, begin=0):
    """Record explicit steps as `record` does, each with its adjoint, stage by stage backwards.

    Raises ValueError as that does, and for what has no adjoint: implicit steps, conditions, laws
    and flows without one.
    """
    require_writable(path, overwrite)
    require_recordable(problem)
    adjoint_recording.require_adjoints(problem)
    write_golden(problem, path, (steps, begin), adjoint_recording.record_steps)


def write_golden(problem, path, steps_and_begin, record_steps):
    """Write the golden file of the steps that `record_steps` yields.

    Returns the numbers of those that had nothing to solve.
    """
    steps, begin = steps_and_begin
    if steps < 1 or begin < 0:
        raise ValueError(f"steps = {steps}, begin = {begin}: expected at least one step to record, "
                         "after 0 or more")
    problem, state = recording.state_after(problem, begin)
    idle = []
    with new_file(path) as f:
        put_problem(f, problem)
        for k, golden in enumerate(record_steps(problem, steps, state)):
            put_step(f.create_group(f"steps/{k}"), golden)
            idle += [k] * has_nothing_to_solve(golden)
    return tuple(idle)


@contextmanager
def new_file(path):
    """Yield a new `h5py.File`, which is sealed and replaces `path` when the block ends.

    HDF5 writes to memory, since it may crash where a disk is full. Raises `NotWritten`.
    """
    with replacing(path) as part:
        file = JournaledFile(part, new=True)
        try:
            with h5py.File(file, "w", libver=("v110", "v110")) as f:
                yield f
            file.commit()
        except NotWritten as fault:
            raise NotWritten(str(fault).replace(str(part), str(path))) from fault
        finally:
            file.close()
        seal(part, GOLDEN)


def has_nothing_to_solve(golden):
    """Return whether an implicit step was solved by its initial increment, 0."""
    report = golden.report
    return report is not None and not report.iterations and not golden.arrays["dv"].value.any()


def with_tolerance(problem, eps):
    """Return the problem with the tolerance eps of its implicit steps; None leaves the scene's.

    Raises ValueError for an explicit problem, or an eps that is not a finite number > 0.
    """
    if eps is None:
        return problem
    if not 0.0 < eps < np.inf:
        raise ValueError(f"eps = {eps}: expected a tolerance, a finite number > 0")
    if problem.integrator != "implicit":
        raise ValueError(f"eps = {eps} with an explicit integrator, which solves nothing: leave it "
                         "out")
    return replace(problem, solver=replace(accepted_step.solver_options(problem), eps=eps))


def require_writable(path, overwrite):
    """Raise ValueError unless `path` is free, or a golden file that may be replaced."""
    require_place(path)
    if not Path(path).exists():
        return
    if not overwrite:
        raise ValueError(f"{path} exists: add --overwrite to replace it, or name another file")
    if not is_golden(path):
        raise ValueError(f"{path} is not a golden file, or a damaged one, and only whole ones are "
                         "overwritten; remove it yourself, or name another file")


def is_golden(path):
    """Return whether a file is a golden file, and whole."""
    if not Path(path).is_file() or verify(path, GOLDEN) != WHOLE:
        return False
    with h5py.File(path, "r") as f:
        return f.attrs.get("format") == FORMAT


def require_recordable(problem):
    """Raise ValueError for names of bodies that cannot name groups of the file, for averaged
    volumes, for conditions at surfaces, for contact of bodies, for sources and sinks, and for laws
    and flows that the plain twin does not have.
    """
    names = [body.name for body in problem.bodies]
    clash = sorted(reserved_names(problem.integrator) & set(names))
    if len(set(names)) < len(names) or any("/" in name or name.strip(".") == "" for name in names):
        raise ValueError(f"bodies {names}: expected a different name for each, without a slash")
    if clash:
        raise ValueError(f"body {clash[0]!r}: this names an array, or a group, of every "
                         f"{problem.integrator} step in the file; rename the body")
    if hasattr(problem.conditions, "apply_at_surface"):
        raise ValueError(AT_NODES)
    if problem.contacts:
        raise ValueError("contact of bodies: golden files have one velocity field; expected a "
                         "scene without it")
    if problem.sources or problem.sinks:
        raise ValueError("sources or sinks: golden files have the same particles in all steps; "
                         "expected a scene without [body.source] and [[sink]]")
    if problem.scheme.precision != "double":
        raise ValueError(f"precision = {problem.scheme.precision!r}: golden files hold arrays of "
                         "double precision; expected 'double', which any backend may be compared "
                         "with")
    if problem.scheme.f_bar:
        raise ValueError("f_bar = true: golden files have no arrays of averaged volumes; expected "
                         "a scene with f_bar = false")
    if problem.scheme.gimp:
        raise ValueError(f"gimp = {problem.scheme.gimp}: golden files have weights of splines; "
                         "expected a scene with gimp = 0")
    for body in problem.bodies:
        for part, table in ((body.law, LAWS), (body.flow, FLOWS)):
            if type(part).__name__ not in table:
                raise ValueError(f"body {body.name!r}: {type(part).__name__} is not known to the "
                                 f"plain twin; expected one of {', '.join(sorted(table))}")


def check_implicit(problem):
    """Raise ValueError for the forms of the implicit step that its plain twin does not have."""
    if problem.integrator != "implicit":
        return
    if problem.scheme.transfer == "mls":
        raise ValueError("transfer = 'mls' with an implicit integrator: its plain twin has the "
                         "gradient form alone; expected 'apic', 'pic' or 'flip'")
    if any(part.friction for part in getattr(problem.conditions, "rules", ())):
        raise ValueError("friction with an implicit integrator: its plain twin has none; expected "
                         "a scene without, or integrator = \"explicit\"")
    if problem.solver is not None and problem.solver.return_map == "implicit":
        raise ValueError("return_map = 'implicit': the plain twin of implicit steps lags it; "
                         "expected 'lagged'")
    if problem.scheme.mass_eps:
        raise ValueError(f"mass_eps = {problem.scheme.mass_eps} with an implicit integrator: its "
                         "plain twin has none; expected 0")


def put_problem(f, problem):
    """Write the problem: attributes of the file, and the initial state of each body."""
    s = problem.scheme
    f.attrs.update({
        "format": FORMAT, "title": problem.title, "scene": problem.source, "dim": problem.dim,
        "dx": problem.dx, "gravity": problem.gravity, "degree": s.degree, "transfer": s.transfer,
        "flip": s.flip, "rpic": s.rpic, "relaxation": s.relaxation, "mass_eps": s.mass_eps,
        "gravity_on_empty": s.gravity_on_empty, "conditions": str(problem.conditions),
        "rule": "tolerance of an entry = tolerance_f64 or tolerance_f32 of its array * its scale",
    })
    if problem.integrator == "implicit":
        f.attrs.update(solver_attributes(accepted_step.solver_options(problem)))
    if problem.clip is not None:
        f.attrs["clip"] = np.array(problem.clip)
    for body in problem.bodies:
        put_body(f.create_group(f"bodies/{body.name}"), body)


def solver_attributes(options):
    """Return the attributes that describe an implicit solve to another code."""
    records = {"search": options.search._asdict(), "cycle": options.cycle._asdict()}
    return {"integrator": "implicit", "options": json.dumps({**asdict(options), **records}),
            **{name: getattr(options, name)
               for name in ("method", "eps", "displacement_tolerance", "norm", "start")}}


def put_body(group, body):
    """Write the material and the initial state of a body."""
    for role in Body._fields[2:4]:
        parameters = getattr(body, role)
        group.attrs[role] = type(parameters).__name__
        group.attrs[f"{role}_parameters"] = json.dumps(parameters._asdict())
    for name, a in body.particles._asdict().items():
        if len(a) and name not in ("L", "tau"):         # both follow from the rest
            group.create_dataset(name, data=a, **PACKED)


def put_step(group, golden):
    """Write a `GoldenStep`: every array with its scale, its own error and its tolerances."""
    group.attrs.update({"t": golden.t, "dt": golden.dt})
    group.create_dataset("nodes", data=golden.nodes.astype(np.int32), **PACKED)
    for name, a in golden.inputs.items():
        group.create_dataset(name, data=a.astype(np.int32) if name in NODES else a, **PACKED)
    for name, a in golden.bars.items():
        group.create_dataset(f"bar/{name}", data=a, **PACKED)
    if golden.report is not None:
        put_report(group.create_group("report"), golden.report)
    for name, base in golden.bases.items():
        group.create_dataset(f"{name}/base", data=base.astype(np.int32), **PACKED)
    stages = {array.name: array for array in ALL_ARRAYS}
    for name, a in golden.arrays.items():
        data = group.create_dataset(name, data=a.value, **PACKED)
        group.create_dataset(f"scale/{name}", data=a.scale, **PACKED)
        array = stages[name.split("/")[-1]]
        data.attrs.update({
            "stage": array.stage, "unit": array.unit, "error_twin": a.twin,
            "error_reordered": a.reordered, "error_in_units": a.error,
            **{f"tolerance_{p}": a.tolerance(p) for p in recording.EPS},
        })


def put_report(group, report):
    """Write the solver's report on a step, for people: no check compares it."""
    values = {name: a for name, a in report._asdict().items() if name not in ("clock", "seconds")}
    group.attrs.update({name: np.array(a) if name == "residuals" else a
                        for name, a in values.items()})


def write(path, steps):
    """Write another code's arrays in the layout that `check` reads.

    steps is a list with one dictionary {key: array} for each step of the golden file, in order;
    None for a step that was not computed. Keys are `mass`, `velocity`, .. on nodes, and `ball/x`,
    `ball/C`, .. for the particles of the body "ball", or just `x`, `C` where there is one body.
    Grid arrays are lists over `nodes`, (M, d) integer coordinates (node i lies at i dx); or whole
    grids (n1, .., nd[, d]) with `origin` (d,), the coordinates of the first node. Particles in
    another order come with `id` (N,), the number of each in the golden file. Arrays that are left
    out are not checked. Raises ValueError, with the step, for a key that no golden file has, for
    arrays that do not hold numbers, and for grids that differ in shape.
    """
    require_dictionaries(steps)
    with new_file(path) as f:
        f.create_group("steps")
        for k, arrays in enumerate(steps):
            try:
                if arrays:
                    put_given(f.create_group(f"steps/{k}"), arrays)
            except ValueError as fault:
                raise ValueError(f"steps[{k}]: {fault}") from fault


def put_given(group, arrays):
    """Put the arrays of a step of another code. Raises ValueError."""
    for name, a in as_lists(arrays).items():
        require_key(name)
        require_numbers(name, np.asarray(a))
        group.create_dataset(name, data=a)


def require_dictionaries(steps):
    """Raise ValueError unless steps is a list of dictionaries and None."""
    if not isinstance(steps, list | tuple):
        raise ValueError(f"steps is a {type(steps).__name__}: expected a list with a dictionary of "
                         "arrays for each step")
    for k, arrays in enumerate(steps):
        if not (arrays is None or isinstance(arrays, dict)):
            raise ValueError(f"steps[{k}] is a {type(arrays).__name__}: expected a dictionary of "
                             "arrays, or None for a step that was not computed")


def require_key(name):
    """Raise ValueError for a key that is not in the schema."""
    names = [array.name for array in ALL_ARRAYS]
    if name.split("/")[-1] not in (*names, *AUXILIARY):
        raise ValueError(f"array {name!r}: expected one of {', '.join(names)}, for particles with "
                         f"the name of their body in front, or {', '.join(AUXILIARY)}")


def as_lists(arrays):
    """Return {key: array} with whole grids, given with `origin`, as lists over nodes with mass."""
    if "origin" not in arrays:
        if np.ndim(arrays.get("mass", 0.0)) > 1:
            raise ValueError(f"mass has the shape {np.shape(arrays['mass'])} without `origin`: add "
                             "the integer coordinates of the first node of the grid, (d,); or give "
                             "the masses of M nodes, (M,), with their nodes, (M, d)")
        return arrays
    if "mass" not in arrays:
        raise ValueError("origin without mass: whole grids need `mass`, which selects their nodes; "
                         f"the keys are {', '.join(arrays)}")
    full = np.asarray(arrays["mass"]) != 0.0       # includes NaN, which the check must find
    if full.ndim != len(arrays["origin"]):
        raise ValueError(f"mass has the shape {full.shape}: expected {len(arrays['origin'])} axes, "
                         "one for each coordinate of origin")
    out = {name: a for name, a in arrays.items() if name != "origin"}
    for array in ALL_ARRAYS:
        if array.location == "nodes" and not array.level and key(array) in out:
            grid = np.asarray(out[key(array)])
            if grid.shape[:full.ndim] != full.shape:
                raise ValueError(f"array {key(array)!r} has the shape {grid.shape}: expected that "
                                 f"of mass, {full.shape}, in its first {full.ndim} axes")
            out[key(array)] = grid[full]
    out["nodes"] = np.argwhere(full) + np.asarray(arrays["origin"])
    return out
