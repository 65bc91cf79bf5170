"""The cylinder under gravity (LDM section 5.1), full order: its deflection."""

import numpy as np

from mpm_ref.monitor import volume_ratio
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, threads_for, with_

SCENE = "ldm_gravity"


@experiment("ldm.cylinder", title="Deflection of LDM's cylinder under gravity",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def cylinder(run):
    """Drop of the free end over 30 steps for the weakest and the strongest gravity."""
    rows = []
    for g in run.progress((1, 10), "gravity"):
        t, drop, J, particles = deflection(float(g))
        rows += [(g, *row) for row in zip(t, drop, strict=True)]
        scale = f"{particles} particles, {len(t) - 1} steps, as printed"
        run.record(f"ldm.cylinder.g{g}.tip", drop[-1], unit="m", comparator="info", scale=scale,
                   note="mean drop of the last cell; the paper prints no number")
        run.record(f"ldm.cylinder.g{g}.J_min", J[0], comparator="info", scale=scale,
                   note=f"smallest J at the end; largest {J[1]:.3f}")
    run.table("tip", ("g", "t", "drop"), rows)


def deflection(g):
    """Times [s], drop of the free end [m], extremes of J, number of particles."""
    problem = build(with_(catalogue_scene(SCENE), gravity=(0.0, 0.0, -g)))
    x0, rows = problem.bodies[0].particles.x.copy(), []
    tip = x0[:, 0] > x0[:, 0].max() - problem.dx
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            body = frame.state.bodies[0]
            z = np.empty(len(x0))
            z[body.id] = body.particles.x[:, 2]
            rows.append((frame.t, float(np.mean((x0[:, 2] - z)[tip]))))
    J = volume_ratio(body.particles)
    t, drop = zip(*rows, strict=True)
    return t, drop, (float(J.min()), float(J.max())), len(x0)
