"""One step of a run, made shorter where it would fail its checks.

The checks come before a particle is changed: the solve of an implicit step, and how far the grid
would move the particles. A step that fails is rejected and tried again with half of dt. What is
tried depends on the state alone, so that a resumed run has the same bits.

A retry is for a single bad step, not a licence for a dt that is too long. An explicit step is not
tried again if dt is past its stable bound, or if the particles were too fast for dt before it: then
it is made as it is, and the monitor ends the run.
"""

import numpy as np

from .body import filled, keep_inside
from .core.displacement import largest_speed, speed_bound
from .monitor import check, lost, runs_away

HALVINGS = 8            # of dt in a step, at most
SLACK = 1e-12           # of the CFL limit: round-off between this check and the monitor's


def take_step(problem, stepper, state, dt):
    """Advance the bodies of a state by dt [s], and its counts; return the length to check it by.

    A fixed dt whose step is rejected is made in 2^k equal parts; of an adaptive one the first part
    is the step. The length is that of the last part, of an explicit step with fixed dt all of it.
    Raises `Unstable` where the shortest part fails too.
    """
    parts, done, reports, bodies = 1, 0, [], filled(state.bodies)
    while done < parts:
        part = dt / parts
        grid = stepper.advance_grid(bodies, state.t + done * part, part)
        fault = fault_of(problem, stepper, state, grid, part)
        again = fault is not None and (parts > 1 or may_retry(problem, stepper, state, dt))
        if again and parts < 2**HALVINGS:
            parts, done, state.rejected = 2 * parts, 2 * done, state.rejected + 1
            continue
        stepper.update_particles(bodies, grid, part)
        if problem.clip is not None:
            keep_inside(bodies, *problem.clip)
        reports.append(stepper.report)
        if again:
            give_up(problem, state, reports[-1], part, fault)
        done += 1
        if problem.clock.dt is None:
            break
    note_solves(state, reports)
    return dt if problem.clock.dt is not None and not stepper.implicit else part


def fault_of(problem, stepper, state, grid, dt):
    """Return why the step to the velocities of a grid must not be made, or None."""
    solve = stepper.report
    if solve is not None and not (solve.converged or problem.allow_unstable):
        return f"the implicit step was not solved: {solve.message}"
    slack = max(SLACK, float(np.finfo(problem.scheme.real).eps))
    limit = (1.0 - slack) * problem.limits.cfl * problem.dx / dt
    parts, scheme = stepper.parts(grid, filled(state.bodies)), stepper.scheme
    if all(speed_bound(*part) <= limit for part in parts):
        return None
    if all(largest_speed(body.particles, part, scheme.stencil, scheme.share(dt)) <= limit
           for part, bodies in parts for body in bodies):
        return None
    return f"a particle crosses more than {problem.limits.cfl:g} dx in a step"


def may_retry(problem, stepper, state, dt):
    """Return whether a rejected step of length dt [s] is tried again, shorter."""
    return stepper.implicit or (dt <= state.bound and not runs_away(problem, state, dt))


def note_solves(state, reports):
    """Keep the report of the last implicit part, or of the first that was not solved, in a state;
    count those that stalled.
    """
    solves = [report for report in reports if report is not None]
    state.solve = next((solve for solve in solves if not solve.converged), (solves or [None])[-1])
    state.stalled += sum(solve.stalled for solve in solves)


def give_up(problem, state, solve, dt, fault):
    """Raise `Unstable` for a step whose shortest part, of length dt [s], was made and is faulty."""
    state.step, state.t, state.solve = state.step + 1, state.t + dt, solve
    check(problem, state, dt)
    raise lost(problem, state, dt, f"{fault}, also with dt = {dt:.3g} s")
