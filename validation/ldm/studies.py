"""LDM's experiments as studies: a scene, many parameters, runs to train on and runs to test on."""

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.study.dataset import simulate_snapshots
from mpm_ref.rom.study.study import latin
from mpm_ref.sampling import Regular
from mpm_ref.scene import build

from ..common.scenes import catalogue_scene, threads_for, with_

PHI = 2.0 * pi / 3.0        # polar angle of the poke (LDM-X5)
POKE = 0.48                 # its speed [m/s]


class LdmStudy(NamedTuple):
    """Parameters mu of all runs, the numbers of those that are tested, and the scene of one."""

    name: str
    mu: np.ndarray          # (runs, parameters)
    test: tuple
    scene: callable         # parameters of a run -> scene
    every: int = 1          # one point in so many is recorded

    @property
    def train(self):
        """Numbers of the runs that networks are trained on."""
        return tuple(k for k in range(len(self.mu)) if k not in self.test)

    def problem(self, k):
        """Return the `Problem` of a run."""
        return build(self.scene(*self.mu[k]))

    def run(self, numbers):
        """Return the `Snapshots` of the full-order runs of these numbers."""
        first = self.problem(numbers[0])
        with threads_for(first.bodies):
            return simulate_snapshots((self.problem(k) for k in numbers), self.mu[list(numbers)],
                                      self.every)


def draw_tests(count, runs, seed=0):
    """Draw the numbers of `count` test runs of `runs` runs at random."""
    return tuple(sorted(np.random.default_rng(seed).permutation(runs)[:count].tolist()))


def fallen(g):
    """LDM-sec5.1: the cylinder under gravity g [m/s^2]."""
    return catalogue_scene("ldm_gravity", gravity=(0.0, 0.0, -float(g)))


def twisted(v, w):
    """LDM-sec5.2: the block pulled at v [m/s] and twisted at w [rad/s]."""
    scene = catalogue_scene("ldm_torsion")
    bottom, top = scene.fixed
    motion = with_(top.motion, translation=with_(top.motion.translation, rate=(0.0, 0.0, float(v))),
                   rotation=with_(top.motion.rotation, rate=float(w)))
    return with_(scene, fixed=(bottom, with_(top, motion=motion)))


def poked(theta):
    """LDM-sec5.3: the cylinder poked at its rim, at an angle theta [rad]."""
    scene = catalogue_scene("ldm_poke")
    base, poke = scene.fixed
    return with_(scene, fixed=(base, at_rim(poke, float(theta))))


def poked_again(thetas):
    """LDM-sec5.3.2: the cylinder poked at one angle after the other [rad], each time let go for as
    long as a single poke's run lasts.
    """
    scene = catalogue_scene("ldm_poke")
    base, poke = scene.fixed
    length = scene.steps * scene.dt
    pokes = (at_rim(poke, float(theta), k * length) for k, theta in enumerate(thetas))
    return with_(scene, steps=scene.steps * len(thetas), fixed=(base, *pokes))


def leaning(r, theta, phi):
    """LDM-sec5.4: the tower's top moved at r [m/s] in a direction of angles theta and phi [rad]."""
    scene = catalogue_scene("ldm_tower")
    bottom, top = scene.fixed
    along = (cos(phi) * cos(theta), cos(phi) * sin(theta), sin(phi))
    path = with_(top.motion.translation, rate=tuple(float(r) * a for a in along))
    return with_(scene, fixed=(bottom, with_(top, motion=with_(top.motion, translation=path))))


def refined(scene, dx, per_cell):
    """A scene on a grid of spacing dx [m], with so many particles per cell and axis."""
    body = with_(scene.body[0], sampling=Regular(per_cell=per_cell))
    return with_(scene, dx=dx, body=(body,))


def latin_twice(ends, train, test, seed=0):
    """Parameters of training runs and then test runs, a Latin hypercube each."""
    rngs = np.random.default_rng(seed).spawn(2)
    return np.vstack([latin(n, ends, rng) for n, rng in zip((train, test), rngs, strict=True)])


def at_rim(poke, theta, begin=0.0):
    """A poke at an angle theta [rad] that begins at a time [s]."""
    R, H = scene_size(poke)
    along = (sin(PHI) * cos(theta), sin(PHI) * sin(theta), cos(PHI))
    path = with_(poke.motion.translation, rate=tuple(POKE * a for a in along), start=begin)
    region = with_(poke.region, center=(-R * cos(theta), -R * sin(theta), H))
    return with_(poke, region=region, motion=with_(poke.motion, translation=path), since=begin,
                 until=begin + poke.until)


def scene_size(poke):
    """Radius and height of the rim that a poke at theta = 0 is on [m]."""
    x, _, z = poke.region.center
    return -x, z


GRAVITY = LdmStudy("gravity", np.linspace(1.0, 10.0, 30)[:, None], draw_tests(6, 30), fallen)
TORSION = LdmStudy("torsion", np.array([(v, w) for v in np.linspace(0.0, 0.6, 6)
                                        for w in np.linspace(0.0, 2.0, 6)]), draw_tests(7, 36),
                   twisted)
POKES = LdmStudy("poke", np.arange(36)[:, None] * pi / 18.0, tuple(k for k in range(36) if k % 3),
                 poked)
TOWER = LdmStudy("tower", latin_twice(((0.6, 0.8), (0.0, pi / 2.0), (-pi / 3.0, -pi / 6.0)), 16, 4),
                 (16, 17, 18, 19), leaning, every=16)
STUDIES = {study.name: study for study in (GRAVITY, TORSION, POKES, TOWER)}
