"""Tabulate what of the code a scene uses: arrays, stages of a step, kernels, SVD, PyTorch.

A fresh process makes the first steps (see `code_probe`); a kernel counts as used if Python called
it there, which loads it from the store of compiled kernels or compiles it.
"""

import hashlib
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import msgspec

from ..scene.toml import digest
from ..store.atomic import write_bytes
from ..store.foreign import environment
from ..sweep.store import source_hash
from . import code_probe

STAGES = {          # of a step: beginnings of the names of the kernels that it calls
    "sort particles by cell": ("core.order._place",),
    "particles to grid": ("core.transfer_lines.scatter", "core.transfer_mls3.scatter"),
    "velocities of nodes": ("core.grid._update_all",),
    "forces apart from momenta": ("core.grid._update_all_apart",),
    "gravity on empty nodes": ("core.grid._update_all_empty",),
    "colliders and regions: nodes tested": ("core.boundary._pull_back",),
    "colliders, regions, walls: nodes in contact": ("core.boundary._settle",),
    "colliders: points of their surface": ("core.surface.",),
    "contact of bodies": ("core.body_contact.", "core.crowded_nodes."),
    "implicit solve": ("hot.",),
    "multigrid": ("hot.multigrid.",),
    "grid to particles": ("core.transfer_lines.gather", "core.transfer_mls3.gather"),
    "averaged volumes": ("core.f_bar._",),
    "J alone": ("core.deform.fluid",),
    "F": ("core.corotated.elastic", "core.deform.elastic", "core.deform.plastic",
          "core.deform.radial", "core.deform.full"),
    "return map": ("core.deform.plastic", "core.deform.radial", "core.deform.full"),
    "RPIC damping": ("core.transfer._damp",),
}
MEANINGS = {        # of the fields of particles, as `core.state` has them
    "x": "position", "v": "velocity", "C": "affine velocity", "L": "velocity gradient, if not C",
    "F": "deformation gradient or J", "tau": "stress", "m": "mass", "V0": "volume at rest",
    "y": "yield stress", "b": "body force",
}
LONGEST = 600       # [s] that the first steps may take


@dataclass(frozen=True)
class CodeParts:
    """Parts of the code that the first steps of a scene used."""

    steps: int
    arrays: dict        # {body: {field: bytes}}, 0 where it is not carried
    particles: dict     # {body: number}
    kernels: dict       # {name: number of compiled forms}
    svd: dict           # {body: "every step", "large strains alone" or "never"}
    implicit: bool
    torch: bool

    @property
    def stages(self):
        """Return {stage: names of the kernels that it called}, empty where it was not entered."""
        return {stage: [name for name in self.kernels if name.startswith(prefixes)]
                for stage, prefixes in STAGES.items()}

    @property
    def numbers(self):
        """Return {body: {field: bytes per particle}}."""
        return {body: {name: size // self.particles[body]
                       for name, size in fields.items()} for body, fields in self.arrays.items()}

    @property
    def facts(self):
        """Return the parts as plain values."""
        return vars(self) | {"bytes_per_particle": self.numbers, "stages": self.stages}


def table_rows(parts):
    """Return the rows of a table of {name of a scene: `CodeParts`}: (label, texts), a text for each
    scene. Rows without texts are headings; the labels below them begin with spaces. No rows of no
    scene.
    """
    columns = list(parts.values())
    if not columns:
        return []
    rows = [("number of first steps", [str(column.steps) for column in columns])]
    for bodies in alike_bodies(columns[0]):
        rows.append((f"bytes per particle of {', '.join(bodies)}", []))
        fields = columns[0].numbers[bodies[0]]
        counts = [column.numbers.get(bodies[0], {}) for column in columns]
        rows += [(f"  {', '.join(filter(None, (name, MEANINGS.get(name))))}",
                  [str(count.get(name, 0)) for count in counts]) for name in fields]
        rows.append(("  together", [str(sum(count.values())) for count in counts]))
        rows.append(("  SVD for its stress", [c.svd.get(bodies[0], "-") for c in columns]))
    rows.append(("kernels that a stage calls", []))
    rows += [(f"  {stage}", [str(len(column.stages[stage])) for column in columns])
             for stage in STAGES]
    rows.append(("  all, with those outside of steps", [str(len(c.kernels)) for c in columns]))
    return [*rows, ("PyTorch", ["loaded" if c.torch else "not loaded" for c in columns])]


def table_lines(parts):
    """Return the table of `table_rows` as lines of text."""
    rows = table_rows(parts)
    if not rows:
        return []
    width = max(len(label) for label, _ in rows)
    head = "  ".join([f"{'what the code uses':{width}}", *(f"{name:>12}" for name in parts)])
    return [head, *("  ".join([f"{label:{width}}", *(f"{value:>12}" for value in values)]).rstrip()
                    for label, values in rows)]


def alike_bodies(parts):
    """Return lists of bodies with the same sizes of fields and the same SVD."""
    groups = {}
    for body, numbers in parts.numbers.items():
        groups.setdefault((tuple(numbers.items()), parts.svd[body]), []).append(body)
    return list(groups.values())


def code_parts(scene, folder=None):
    """Return the `CodeParts` of a scene, stored in a folder if one is given.

    Raises RuntimeError, with the last line of its error, where the process fails or takes too long.
    """
    path = None if folder is None else Path(folder) / f"code-{key_of_parts(scene)}.json"
    if (stored := stored_parts(path)) is not None:
        return stored
    try:
        done = subprocess.run([sys.executable, "-P", "-m", code_probe.__name__], check=False,
                              capture_output=True, input=msgspec.json.encode(scene),
                              env=environment(), timeout=LONGEST)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"the first steps of the scene in a process of their own took over "
                           f"{LONGEST} s") from None
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise RuntimeError(f"the first steps of the scene in a process of their own failed: "
                           f"{lines[-1] if lines else f'exit status {done.returncode}'}")
    parts = CodeParts(**json.loads(done.stdout))
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, done.stdout)
    return parts


def stored_parts(path):
    """Return the `CodeParts` in a file; None without one, or where it is damaged."""
    try:
        return None if path is None else CodeParts(**json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None


def key_of_parts(scene):
    """Return the hash of a scene and of the sources that its first steps depend on."""
    probe = Path(code_probe.__file__).read_bytes()
    text = f"{source_hash()} {digest(scene)}".encode()
    return hashlib.sha256(text + probe).hexdigest()[:32]
