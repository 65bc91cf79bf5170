"""Models for runs under a gravity that changes, computed from training runs.

Training runs under constant gravity give LDM's modes, responses to steps, and the correction of
coarse runs; those under random loads give inferred operators.
"""

from functools import partial
from time import process_time

import numpy as np

from mpm_ref.rom.correction import carrier, fit_correction
from mpm_ref.rom.evolution import EVOLVED, MAP
from mpm_ref.rom.fields.numbered import numbered
from mpm_ref.rom.fields.pod import directions, modes
from mpm_ref.rom.inference import fit_dynamics
from mpm_ref.rom.study.full_model import field_of, ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_run

from .arm_models import CORRECTIONS
from .live_runs import TICKS, LiveMethod, full_states

F_IN_WORDS = {MAP: "of the map", EVOLVED: "evolved"}


def ldm_method(name, training, r, **options):
    """Return the `LiveMethod` of LDM on r modes of a `StepTraining`; options: of `RunOptions`."""
    clock, X = process_time(), training.X
    g = modes(X, np.concatenate(training.x), np.concatenate(training.F), r)
    fit, points, options = process_time() - clock, np.arange(len(X)), RunOptions(**options)
    return LiveMethod(name, partial(reduced_states, training.scene, g, options),
                      partial(numbered(g).place, points), fit, training.cpu,
                      settings=f"r = {r}, {options.points or 'all'} samples, F "
                      f"{F_IN_WORDS[options.deformation_gradient]}")


def reduced_states(scene, g, options, load):
    """Return the iterator over the latent coordinates of a reduced run on a map g after each tick
    of a load.
    """
    plan = ldm_run(ldm_full_model(scene), g, options, np.zeros(g.r))
    latent = plan.find_start()
    return reduced_steps(plan, latent, plan.make_sampler(latent.xhat), load)


def reduced_steps(plan, latent, sampler, load):
    """Yield the latent coordinates of a `ReducedRun` after each tick of a load."""
    step = 0
    for gravity in load:
        plan.stepper.gravity = gravity
        for _ in range(plan.steps // TICKS):
            t = step * plan.dt
            samples = sampler(t, latent)
            latent, _ = plan.stepper.step(latent, samples.points, t, plan.dt, samples.weights)
            step += 1
        yield latent.xhat


def superposition_method(training):
    """Return the `LiveMethod` of a linear body: a jump of gravity adds the response to a step.

    u(t) = sum_k S(t - t_k) dg_k, where S is linear in the components of gravity that the training
    runs vary, fitted to them by least squares.
    """
    clock, X = process_time(), training.X
    responses = np.tensordot(np.linalg.pinv(training.gravity), training.x - X, axes=1)
    return LiveMethod("superposition", jumps, partial(superposed, X, responses),
                      process_time() - clock, training.cpu)


def jumps(load):
    """Yield after each tick of a load the jumps of gravity so far, {their age in ticks: (3,)}."""
    ages, last = {}, np.zeros(3)
    for gravity in load:
        ages = {age + 1: jump for age, jump in ages.items()}
        if (gravity != last).any():
            ages[1] = gravity - last
        last = gravity
        yield ages


def superposed(X, responses, ages):
    """Return x (n, 3) of points X after jumps (see `jumps`), by responses (3, TICKS, n, 3)."""
    x = X.copy()
    for age, jump in ages.items():
        for axis in np.flatnonzero(jump):
            x += jump[axis] * responses[axis, age - 1]
    return x


def corrected_method(training, coarse, times):
    """Return the `LiveMethod` of a run on a grid `times` as coarse with a correction learned from a
    `StepTraining` on each of the two grids.
    """
    clock, one = process_time(), carrier(training.X, coarse.X)
    x, x_coarse = np.concatenate(training.x), np.concatenate(coarse.x)
    fit = fit_correction(one, x, x_coarse, CORRECTIONS, np.arange(len(x)) // TICKS)
    return LiveMethod(f"corrected.{times:g}", partial(full_states, coarse.scene),
                      lambda bodies: fit.place(field_of(bodies, "x")), process_time() - clock,
                      training.cpu, coarse.cpu, f"smoothing {fit.smoothing:g}")


def operators_method(training, most):
    """Return the `LiveMethod` of operator inference of a `LoadTraining`, on at most `most` modes of
    its states after each tick.
    """
    X, (runs, levels, *shape) = training.X, training.x.shape
    clock, ticks = process_time(), training.x[:, training.parts - 1::training.parts]
    U, _ = directions(X, ticks.reshape(-1, *shape).astype(float), most)
    to_modes = np.linalg.pinv(U.reshape(-1, most)).T
    a = np.array([(x - X).reshape(levels, -1) @ to_modes for x in training.x])
    model = fit_dynamics(a, np.repeat(training.loads, training.parts, axis=1))
    U = U[..., :model.r]
    return LiveMethod("operators", partial(operator_states, model, training.parts),
                      lambda a: X + U @ a, process_time() - clock, training.cpu,
                      settings=f"r = {model.r} of {most}, {runs} training runs under random loads, "
                      f"smoothing {model.smoothing:g}")


def operator_states(model, parts, load):
    """Yield the latent coordinates of `LatentDynamics` after each tick of a load; parts: intervals
    of a tick.
    """
    loads = (gravity for gravity in load for _ in range(parts))
    for k, a in enumerate(model.states(loads), 1):
        if k % parts == 0:
            yield a
