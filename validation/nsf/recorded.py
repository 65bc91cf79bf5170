"""Settings of the sand column and the metal block that NSF prints (NSF-X1, NSF-X11)."""

from mpm_ref.scene import build

from ..registry import experiment
from ..settings import record_settings
from ..verification.scenes import shipped

ROUNDED = 0.01      # dx = 1/150 is printed with two digits, 0.0067


@experiment("nsf.settings", title="Settings of NSF's sand column and metal block",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 5})
def settings(run):
    """Settings of the scenes nsf_sand.toml and nsf_metal.toml."""
    sand, metal = shipped("nsf_sand"), shipped("nsf_metal")
    record_settings(run, "nsf_sand", {
        "nsf.sand.particles_text": particles(sand), "nsf.table1.sand.dx": sand.dx,
        "nsf.table1.sand.dt": sand.dt}, nsf_table1_sand_dx=ROUNDED)
    record_settings(run, "nsf_metal", {
        "nsf.table1.metal.dx": metal.dx, "nsf.table1.metal.dt": metal.dt,
        "nsf.table1.metal.tau_y": metal.body[0].material.flow.tau_y})
    run.record("nsf.metal.particles", particles(metal), scale="scenes/nsf_metal.toml",
               note="a block with particles of the paper's size: the shape of its metal frame is "
               "not published")


def particles(scene):
    """Number of particles of a scene."""
    return sum(len(body.particles.x) for body in build(scene).bodies)
