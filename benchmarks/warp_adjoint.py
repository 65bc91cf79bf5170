"""The adjoint of the step of `warp_stages` by Warp's tape.

The gradient of every array of the step is that which the tape leaves in it. Two gradients of golden
files have no array of their own and are not given: that by F through F_trial alone, and that by x
through the gather alone.
"""

import warp as wp

from .warp_stages import WarpStages

PARTICLES = ("x", "v", "C", "tau", "m", "V0")
NODES = {"velocity_bc": "v", "velocity": "v_free", "momentum": "mv", "force": "f", "mass": "m"}


def pull_back(start, seed, precision, svd):
    """Return the gradients of sum <seed, state after a step from a `Start`>, as `oracle.write`
    takes them, by the decomposition `svd` of `WarpStages`.

    seed: {name: array} for x, v, C and F.
    """
    steps = WarpStages(start, precision, svd)
    F = "J" if steps.is_fluid else "F"
    with wp.Tape() as tape:
        steps.update_stress(steps.q, flows=False)
        q, nodes, after = steps.advance()
    arrays = {name: getattr(after, F if name == "F" else name) for name in seed}
    tape.backward(grads={a: wp.array(seed[name], dtype=a.dtype, device="cpu")
                         for name, a in arrays.items()})
    gradients = {f"{name}_grad": getattr(q, name).grad.numpy() for name in PARTICLES}
    gradients |= {f"{name}_grad": steps.on_grid(getattr(nodes, stored).grad)
                  for name, stored in NODES.items()}
    gradients |= {"F_grad": getattr(q, F).grad.numpy(), "L_grad": after.L.grad.numpy(),
                  "gravity_grad": steps.k.gravity.grad.numpy()[0]}
    law = steps.k.law.grad.numpy()
    if steps.is_fluid:
        gradients |= {"law_grad": law[1:], "tau_grad": trace(gradients["tau_grad"])}
    else:
        gradients |= {"law_grad": law, "F_trial_grad": after.F_trial.grad.numpy()}
    return gradients | {"origin": (0,) * start.dim, "mass": steps.on_grid(nodes.m)}


def trace(A):
    """Return the traces (N,) of matrices (N, d, d)."""
    return A.trace(axis1=1, axis2=2)
