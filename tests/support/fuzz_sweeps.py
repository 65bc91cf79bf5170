"""Strange but valid scenes, hostile paths and tiny budgets, given to `mpm-ref limits` and `needs`.

    python tests/support/fuzz_sweeps.py FOLDER SEED CASES

prints JSON: the cases that ended with a traceback, took too long, said too much, or wrote a file
outside of their output folder, and the number of cases by exit status.
"""

import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
from collections import Counter
from pathlib import Path

from fuzz import MEMORY, TooLong, answer_to, fault_of

STATUSES = 0, 1, 2, 4           # an answer, none, bad input, a file that cannot be written
SECONDS = 120                   # of a case: a budget of seconds, and kernels that are compiled
COMMANDS = "limits", "needs", "limits", "needs", "trade"
BODY = """
[[body]]
name = "{name}"
density = {density}
shape = {shape}
sampling = {sampling}
velocity = {velocity}
material = {material}
"""
PART = """
[[{key}]]
{word} = {shape}
motion = {motion}
"""
KEYS = {        # of a scene: its usual value first, then strange ones; None leaves the key out
    "dx": ["0.1", "0.1", "0.1", "0.03", "0.3", "1.0", "1e9", "0.0999999999999999"],
    "end": ["0.02", "0.02", "1e-30", "1e-9", "1e12", "1e30"],
    "dt": [None, None, "0.001", "1e-30", "1e30", "0.02"],
    "interval": [None, None, "0.01", "1e-30", "1e30", "0.003"],
    "gravity": [None, "[0.0, -9.8]", "[1e9, -1e9]", "[0.0, 1e-300]", "[0.0, 0.0]"],
    "title": [None, "'$\\frac{ $x_$'",
              '"' + "w" * 5000 + '"', '"<script>alert(1)</script>"',
              '"a\\nb"', '"\u2603 %s {} #"', '"x" # y'],
    "seed": [None, "9223372036854775807"],
    "unstable": [None, None, '"allow"'],
    "clip": [None, None, "{ lower = [-1e9, -1e9], upper = [1e9, 1e9] }",
             "{ lower = [0.3, 0.3], upper = [0.4, 0.4] }"],
    "walls": [None, None, '{ low = [-1000000000, "open"], high = ["open", 1000000000] }',
              '{ low = [3, 3], high = [3, 3], kind = "slip", friction = 10.0 }'],
    "limits": [None, None, "{ growth = 0.0 }", "{ cfl = 1e-30 }", "{ J = [0.999999, 1.000001] }"],
    "scheme": [None, None, '{ transfer = "pic", degree = 1 }', '{ transfer = "flip", flip = 0.0 }',
               "{ rpic = 1.0 }"],
}
CFL = [None, None, "1e-300", "1.0", "10.0"]     # without a fixed dt
LONGEST = [None, None, "1e-30", "1e30"]
NAMES = ["block", "a", "wall x-", "..", "mirror x", "-"]
SHAPES = ['{ type = "box", lower = [0.2, 0.2], upper = [0.6, 0.6] }',
          '{ type = "box", lower = [0.2, 0.2], upper = [0.6, 0.6] }',
          '{ type = "sphere", center = [0.5, 0.5], radius = 0.2 }',
          '{ type = "sphere", center = [5e8, -5e8], radius = 0.2 }',
          '{ type = "box", lower = [0.2, 0.2], upper = [0.200000001, 0.6] }',
          '{ type = "box", lower = [-1e-9, -1e-9], upper = [1e-9, 1e-9] }']
PARTS = ['{ type = "half_space", point = [0.0, 0.2], normal = [0.0, 1.0] }',
         '{ type = "half_space", point = [0.0, 0.5], normal = [1e-9, 1e9] }',
         '{ type = "half_space", point = [1e9, -1e9], normal = [1.0, 1.0] }',
         '{ type = "sphere", center = [0.5, 0.5], radius = 9.0 }']
PART_NAMES = ["floor", "", "wall x-", "../../x", "a:b", "<b>", "x" * 5000, "$\\frac{$"]
MOTIONS = ["{}", "{}", '{ translation = { type = "steady", rate = [1e9, 0.0] } }',
           '{ rotation = { type = "oscillation", amplitude = 1e9, frequency = 1e30 } }',
           '{ translation = { type = "keyframes", times = [0.0, 1e-12], '
           'values = [[0.0, 0.0], [1e-9, 0.0]] } }', "{ angle = 1e6 }"]
SAMPLINGS = ['{ type = "regular", per_cell = 2 }', '{ type = "regular", per_cell = 2 }',
             '{ type = "regular", per_cell = 1 }', '{ type = "lattice", counts = [1, 1] }',
             '{ type = "poisson", count = 1 }', '{ type = "jittered", per_cell = 3 }']
VELOCITIES = ["{}", "{}", "{ linear = [1e9, 0.0] }", "{ linear = [1e-300, -1e-300] }",
              "{ angular = 1e9 }", "{ linear = [0.1, 0.0], center = [1e9, 1e9] }"]
MATERIALS = ['{ law = "fluid", lam = 1e4 }', '{ law = "fluid", lam = 1e-30 }',
             '{ law = "fluid", lam = 1e30 }', '{ law = "fixed_corotated", E = 1e5, nu = 0.3 }',
             '{ law = "fixed_corotated", E = 1e-300, nu = 0.0 }',
             '{ law = "fixed_corotated", E = 1e20, nu = 0.4999999 }',
             '{ law = "fixed_corotated", E = 1e5, nu = -0.999 }']
DENSITIES = ["1000.0", "1000.0", "1e-30", "1e30", "1e-3"]
QUANTITIES = ["positions", "centroid@end", "path:1e9,-1e9", "region:0.2,0.2,0.6,0.6",
              "region:0,0,1e-9,1e-9", "front:x+", "front:y-:block", "profile:y", "kinetic@end",
              "gravity", "energy", "impulse:floor", "force:floor", "impulse:wall x-", "force:@end",
              "mean:J:0,0,1,1", "mean:pressure:0,0,1e-9,1e-9", "mean:speed:-1e9,-1e9,1e9,1e9",
              "positions:..", "", ":", "@", "impulse:" + "x" * 5000, "path:1e400,0", "front:z+"]
ERRORS = ["1%", "20%", "1e-300", "0.999999", "1e-13%", "99.9%", "1e400", "-1%"]
BUDGETS = ["1s", "2s", "3s", "0.02min", "1e308h", "0.999s", "-1s"]
FILES = ["scene.toml", "scene.toml", "a b.toml", "..toml", "...toml", ".toml", "-x.toml",
         "a'\";$(touch x).toml", "\u00fc\u2603.toml", "x" * 240 + ".toml", "x" * 250, "scene",
         "scene.best.toml", "s.trade", "a\nb.toml", "%s{}.json.toml"]
FOLDERS = ["out", "out", "out/deep/er", "out/a b", "out/\u2603", "out/-x", "out/../out",
           "out/x.toml"]


def strange_scene(rng):
    """Return the text of a scene with strange values, most of them valid."""
    keys = {key: usual_or_any(rng, values) for key, values in KEYS.items()}
    if keys["dt"] is None:
        keys |= {"cfl": usual_or_any(rng, CFL), "longest": usual_or_any(rng, LONGEST)}
    lines = ["dim = 2", *(f"{key} = {value}" for key, value in keys.items() if value is not None)]
    names = rng.sample(NAMES, rng.choice((1, 1, 1, 2)))
    bodies = [BODY.format(
        name=name, density=usual_or_any(rng, DENSITIES), shape=usual_or_any(rng, SHAPES),
        sampling=usual_or_any(rng, SAMPLINGS), velocity=usual_or_any(rng, VELOCITIES),
        material=usual_or_any(rng, MATERIALS)) for name in names]
    return "\n".join(lines) + "".join([*bodies, *strange_parts(rng), *strange_tables(rng)])


def usual_or_any(rng, values):
    """Return the first of some values, or any of them."""
    return values[0] if rng.random() < 0.6 else rng.choice(values)


def strange_parts(rng):
    """Return the texts of colliders and fixed regions."""
    parts = []
    for _ in range(rng.choice((0, 1, 1, 2))):
        key, word = rng.choice((("collider", "shape"), ("collider", "shape"), ("fixed", "region")))
        text = PART.format(key=key, word=word, shape=usual_or_any(rng, PARTS),
                           motion=usual_or_any(rng, MOTIONS))
        name = usual_or_any(rng, PART_NAMES)
        text += f"name = {json.dumps(name)}\n"
        if key == "collider":
            text += f'kind = "{rng.choice(("separate", "slip", "sticky"))}"\n'
        parts.append(text)
    return parts


def strange_tables(rng):
    """Return the texts of tables of quantities of interest."""
    tables = ['type = "kinetic"', 'type = "force"\npart = "floor"\nat_end = true',
              'type = "positions"\nbody = "block"', 'type = "front"\nside = "x-"',
              'type = "mean"\nfield = "J"\nlower = [0, 0]\nupper = [1e-9, 1e-9]']
    return [f"\n[[quantity]]\n{table}\n" for table in rng.sample(tables, rng.choice((0, 0, 0, 1)))]


def strange_arguments(rng, folder):
    """Return (name of the scene's file, output folder, options)."""
    options = ["--error", usual_or_any(rng, ERRORS), "--budget", usual_or_any(rng, BUDGETS),
               "--workers", "1", "--quiet"]
    for text in rng.sample(QUANTITIES, rng.choice((0, 0, 0, 1))):
        options += ["--quantity", text]
    if rng.random() < 0.3:
        options.append("--json")
    return usual_or_any(rng, FILES), folder / usual_or_any(rng, FOLDERS), options


def cases(folder, seed, count):
    """Yield (scene's text, its file, output folder, command line)."""
    for k in range(count):
        rng = random.Random(f"{seed} {k}")
        text = strange_scene(rng)
        name, out, options = strange_arguments(rng, folder)
        file = folder / "in" / name
        yield text, file, out, [rng.choice(COMMANDS), *options, "--out", str(out), "--", str(file)]


def files_of(folder, but):
    """Return the paths of all files in a folder that are not in another one."""
    return {path for path in folder.rglob("*") if but.resolve() not in (path, *path.parents)}


def hidden_fault(done):
    """Return the error of the program that an answer reports as a run that crashed, or None."""
    text = f"{done.stdout} {done.stderr}"
    found = re.search(r"crashed: \w+: .*|\w+Warning: .*", text)
    return found and found[0]


def main(folder, seed, count):
    """Print the faults of `count` cases, and how many ended with which status, as JSON."""
    from mpm_ref.cli import app

    def too_long(*_):
        raise TooLong

    signal.signal(signal.SIGALRM, too_long)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    folder, faults, statuses = folder.resolve(), [], Counter()
    (folder / "here").mkdir(parents=True)
    os.chdir(folder / "here")
    for k, (text, file, out, command) in enumerate(cases(folder, seed, count)):
        for place in ("in", "out"):
            shutil.rmtree(folder / place, ignore_errors=True)
            (folder / place).mkdir()
        file.write_text(text)
        before, began = files_of(folder, out), time.perf_counter()
        done = answer_to(app, command, SECONDS)
        fault = fault_of(done, STATUSES) or hidden_fault(done)
        statuses[f"{command[0]} {done and done.exit_code}"] += 1
        if fault is None and (new := files_of(folder, out) - before - set(out.parents)):
            fault = f"written outside of {out}: {sorted(map(str, new))}"
        if fault is not None:
            faults.append({"case": k, "command": command, "scene": text, "fault": fault,
                           "seconds": round(time.perf_counter() - began, 1)})
    print(json.dumps({"faults": faults, "statuses": statuses}, indent=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
