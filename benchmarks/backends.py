"""The steppers of the block, each in a process of its own, so that no backend's threads or caches
disturb another one.
"""

import time
from contextlib import suppress
from multiprocessing import get_context

import numpy as np


def make_backend(name, problem, threads):
    """Return a stepper of the problem; only the requested backend is imported."""
    if name == "mpm_ref":
        from .ours_block import OurBlock as Backend
    elif name == "taichi":
        from .taichi_block import TaichiBlock as Backend
    else:
        from .warp_block import WarpBlock as Backend
    return Backend(problem, threads)


def serve(pipe, name, problem, threads):
    """Advance a backend by as many steps as the pipe asks for, until it is None; answer with the
    wall and CPU seconds, and the kinetic energy [J].
    """
    stepper = make_backend(name, problem, threads)
    while (steps := pipe.recv()) is not None:
        wall, cpu = time.perf_counter(), time.process_time()
        stepper.step(steps)
        times = time.perf_counter() - wall, time.process_time() - cpu
        pipe.send((*times, 0.5 * problem.m * float(np.sum(stepper.velocity() ** 2))))


class RemoteBackend:
    """A backend in a process of its own, which answers there as `serve` does.

    setup: what `serve` takes beside the name and the number of threads: a problem or a precision.
    """

    def __init__(self, name, setup, threads, serve=serve):
        context = get_context("spawn")
        self.pipe, end = context.Pipe()
        self.process = context.Process(target=serve, args=(end, name, setup, threads),
                                       daemon=True)
        self.process.start()
        end.close()

    def run(self, task):
        """Return the answer of `serve` to a task. The default `serve` takes a number of steps, and
        answers with their wall and CPU seconds, and the kinetic energy after them [J].
        """
        self.pipe.send(task)
        return self.pipe.recv()

    def close(self):
        """End the process."""
        with suppress(OSError):         # of a process that has ended by itself
            self.pipe.send(None)
        self.process.join()
