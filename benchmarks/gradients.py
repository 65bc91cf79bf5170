"""Measure what a gradient costs: of a loss of the end of a few explicit steps, with respect to the
initial positions and velocities of the block.

The loss is sum_p w_p . x_p(end) with fixed random w. All backends differentiate the steps that
`blocks` measures, with fixed corotated elasticity. Its stress needs the rotation of F. Taichi and
Warp compute it by five of Newton's iterations, with and without a gradient, and their tapes go
through them. Taichi 1.7.4 refuses to differentiate its singular value decomposition, and the
gradient through that of Warp 1.19.0 is wrong at F = I. Ours has its gradient in closed form.

A gradient begins with the initial state and ends with the two arrays; it includes the steps
forward. Ours makes new particles, sorts them and keeps the states of all steps; Taichi and Warp
write into arrays of all steps, of particles and nodes, that were allocated before. The runs without
a gradient are those of `blocks`, which keep one state. Every run has a process of its own, and
they are timed in turn. Warp's CPU kernels are serial. Memory is what the process grew by, its
compiler included where caches are cold: run twice before it is read.
"""

import time
from pathlib import Path

import numpy as np

from .backends import RemoteBackend
from .problem import loss_of_run

AGREE = 1e-12       # difference of the gradients that is allowed, relative to the largest entry
STATUS = Path("/proc/self/status")
WORK = 300_000      # particle-steps of a round, where one gradient has fewer


def make_gradient(name, problem, threads):
    """Return a backend that differentiates a `LossOfRun`; no other backend is imported."""
    if name == "mpm_ref":
        from .ours_gradient import OurGradient as Backend
    elif name == "taichi":
        from .taichi_gradient import TaichiGradient as Backend
    else:
        from .warp_gradient import WarpGradient as Backend
    return Backend(problem, threads)


def serve_gradients(pipe, name, problem, threads):
    """Compute as many gradients as the pipe asks for, until it is None; answer with the wall and
    CPU seconds, the loss and its gradients, and the memory that was added [bytes], or None.
    """
    before = memory("VmRSS")
    backend = make_gradient(name, problem, threads)
    while (count := pipe.recv()) is not None:
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(count):
            found = backend.gradient()
        times = time.perf_counter() - wall, time.process_time() - cpu
        peak = memory("VmHWM")
        pipe.send((*times, found, None if peak is None else peak - before))


def memory(name):
    """Return an entry of the process's status [bytes], or None where a system has no such file."""
    if not STATUS.exists():
        return None
    lines = (line.split() for line in STATUS.read_text().splitlines())
    return next(1024 * int(words[1]) for words in lines if words[0] == name + ":")


def disagreement(gradients):
    """Return the largest difference of losses and gradients from those of the first backend,
    relative to the largest entry of each. gradients: {backend: (loss, x_bar, v_bar)}.
    """
    first, *others = gradients.values()
    return float(np.max([
        np.abs(b - a).max() / np.abs(a).max()
        for other in others for a, b in zip(first, other, strict=True)
    ], initial=0.0))                                        # `np.max` keeps what is not a number


def require_agreement(gradients):
    """Return the disagreement of the backends. Raises SystemExit where it exceeds `AGREE`, or is
    not a number.
    """
    difference = disagreement(gradients)
    if not difference <= AGREE:
        raise SystemExit(f"the gradients of {', '.join(gradients)} disagree by {difference:.1e} > "
                         f"{AGREE}")
    return difference


def gradient_rows(block, names, steps, threads, repeats):
    """Return a row per backend: median wall and CPU ns per particle-step without a gradient and
    with it, their ratios, and the memory of a gradient.

    Raises SystemExit if the gradients disagree.
    """
    problem = loss_of_run(block, steps)
    tapes = {name: RemoteBackend(name, problem, threads, serve_gradients) for name in names}
    plain = {name: RemoteBackend(name, block, threads) for name in names}
    try:
        firsts = {name: tape.run(1) for name, tape in tapes.items()}
        difference = require_agreement({name: first[2] for name, first in firsts.items()})
        forward, whole, memories, lasts = timed_rounds(plain, tapes, problem, repeats)
        difference = max(difference, require_agreement(lasts))
    finally:
        for backend in (*tapes.values(), *plain.values()):
            backend.close()
    return [
        {"particles": len(block.x), "steps": steps, "backend": name,
         "forward_wall_ns": forward[name][0], "forward_cpu_ns": forward[name][1],
         "gradient_wall_ns": whole[name][0], "gradient_cpu_ns": whole[name][1],
         "cpu_ratio": whole[name][1] / forward[name][1],
         "cpu_ratio_to_ours": whole[name][1] / whole[names[0]][1],
         "memory_bytes": memories[name],
         "disagreement": difference}
        for name in names
    ]


def timed_rounds(plain, tapes, problem, repeats):
    """Return the median wall and CPU ns per particle-step without and with a gradient, the memory
    [bytes], and the last gradient of every backend; all are warm after steps that are not timed.
    """
    count = len(problem.w) * problem.steps
    many = max(1, round(WORK / count))
    forward, whole = {name: [] for name in plain}, {name: [] for name in tapes}
    memories, lasts = {}, {}
    for backend in plain.values():
        backend.run(problem.steps)
    for _ in range(repeats):
        for name in plain:
            forward[name].append(plain[name].run(many * problem.steps)[:2])
            *times, lasts[name], memories[name] = tapes[name].run(many)
            whole[name].append(times)
    scale = 1e9 / (many * count)
    return *({name: (np.median(rounds, axis=0) * scale).tolist() for name, rounds in of.items()}
             for of in (forward, whole)), memories, lasts


def gradient_line(row):
    """Return a row of the table of gradients as text."""
    mebibytes = "" if row["memory_bytes"] is None else f"  {row['memory_bytes'] / 2**20:.0f} MiB"
    return (f"{row['size']:>5} {row['backend']:8} forward: wall {row['forward_wall_ns']:7.1f} ns  "
            f"CPU {row['forward_cpu_ns']:7.1f} ns  "
            f"with gradient: wall {row['gradient_wall_ns']:7.1f} ns  CPU "
            f"{row['gradient_cpu_ns']:7.1f} ns  x {row['cpu_ratio']:.2f} of forward, "
            f"x {row['cpu_ratio_to_ours']:.2f} of ours{mebibytes}")
