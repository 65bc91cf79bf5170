"""Settings of NSF's scenes: table 1 and section 6, as far as they are printed (NSF-X1 to NSF-X18).

What differs between runs of a scene (E, xi, angles) is that of the studies (`studied`).
"""

from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import catalogue_scene, record_settings
from .study_settings import of_networks, of_studies

ROUNDED = 0.01      # dx = 1/150 and 1/160 are printed with two digits, 0.0067 and 0.0063
NAMES = ("bread", "cake", "sand", "metal", "toothpaste", "jelly", "ball")
PARTICLES = {       # where the scene has the printed number
    "bread": ("table1.bread.particles", "bread.particles"),
    "cake": ("table1.cake.particles", "cake.particles"),
    "sand": ("sand.particles_text",),                   # NSF-X1
    "toothpaste": ("toothpaste.particles_text",),       # NSF-X2
    "jelly": ("table1.jelly.particles", "jelly.particles"),
}
STAND_INS = {       # where the shape is not published, and ours has nearly as many
    "metal": ("metal.particles", "a lattice of beams with particles of the paper's size: the "
              "shape of its metal frame is not published"),
    "ball": ("table1.ball.particles", "a sphere with 32 tentacles: the ball's mesh is not "
             "published"),
}


@experiment("nsf.settings", title="Settings of NSF's scenes",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 10})
def settings(run):
    """Settings of the scenes nsf_*.toml, of the studies of them, and of the networks."""
    for name in NAMES:
        scene = catalogue_scene(f"nsf_{name}")
        dx = f"nsf.table1.{name}.dx"
        record_settings(run, f"nsf_{name}", printed(name, scene),
                        **{dx.replace(".", "_"): ROUNDED})
        if name in STAND_INS:
            target, note = STAND_INS[name]
            run.record(f"nsf.{target}", particles(scene), scale=f"scenes/nsf_{name}.toml",
                       note=note)
    for values, of in ((of_studies(), "studies of the standard profile at the printed resolution"),
                       (of_networks(), "rom/architecture.py, rom/train/schedule.py")):
        for target, value in values.items():
            run.record(target, value, scale=of)


def printed(name, scene):
    """{target id: our value} of a scene's printed settings."""
    found = {f"nsf.table1.{name}.dx": scene.dx, f"nsf.table1.{name}.dt": scene.dt}
    found |= {f"nsf.{target}": particles(scene) for target in PARTICLES.get(name, ())}
    return found | {f"nsf.{target}": value for target, value in own(name, scene).items()}


def own(name, scene):
    """{target id without "nsf.": value} of what only this scene has."""
    material = scene.body[0].material
    flow = material.flow
    match name:
        case "cake":
            return {"table1.cake.tau_y": flow.tau_y, "table1.cake.theta": flow.theta,
                    "cake.steps_full": scene.steps}
        case "metal":
            return {"table1.metal.tau_y": flow.tau_y, "metal.steps_full": scene.steps}
        case "toothpaste":
            return {"table1.toothpaste.tau_y": flow.sigma_y, "table1.toothpaste.eta": flow.eta,
                    "fig11.angle": scene.collider[0].motion.angle}
        case "jelly" | "ball":
            return {f"table1.{name}.E": material.E}
        case _:
            return {}


def particles(scene):
    """Number of particles of a scene."""
    return sum(len(body.particles.x) for body in build(scene).bodies)
