"""Settings that HOT prints, as the scenes and the methods here carry them.

The spacings and numbers of particles of Table 2 are those of the scenes at the paper's size (see
`sizes`). The soft tissue of the wheel, which even the release leaves out, is not compared. Of the
materials of Table 1, scenes name metal alone.
"""

from math import log10

import numpy as np

from mpm_ref.hot.assembly import pattern_of
from mpm_ref.hot.krylov import newton_tolerance
from mpm_ref.hot.methods import METHODS
from mpm_ref.hot.multigrid.embedding import embed
from mpm_ref.hot.norms import surface
from mpm_ref.scene import build, load
from mpm_ref.timestep import advective

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import SCENES, record_settings
from . import stiffness, stretched_box, warm_states
from .sizes import entered, sized

PARTS = {       # the bodies that are parts 0, 1, .. of Table 2
    "twist": ("pillars", "balls"),
    "boxes": ("left", "metal"),
    "donut": ("ring", "left bar"),
    "armacat": ("armadillo", "trampoline", "cat"),
    "chain": ("soft", "stiff"),
    "wheel": (None, "wheel"),
    "faceless": ("bust",),
    "sauce": ("sauce",),
}
METALS = {"boxes": ("metal",), "donut": ("left bar", "right bar"), "wheel": ("wheel",),
          "aluminium": ("aluminium",)}
UNCOUNTED = ("grains",)     # poured onto the boards, which have the printed number without them


@experiment("hot.settings", title="Settings of HOT's scenes and methods",
            profiles=("quick", "standard"), budget={"quick": 2, "standard": 2})
def settings(run):
    """Record materials of Tables 1 and 2, sizes, rules of the time step, and solver constants."""
    for name in PARTS:
        record_settings(run, f"hot_{name}", materials(name))
    for name, values in SINGLE.items():
        record_settings(run, f"hot_{name}", values(bodies(name)))
    for name, values in CLOCKS.items():
        record_settings(run, f"hot_{name}", values(scene(name)))
    for target, value in {**solver(), **sparsity(), **stretches()}.items():
        run.record(target, value, scale="as it is without options")
    for target, value in {**variants(), **sweep()}.items():
        run.record(target, value, scale="as the experiments change the scene")
    for name in (*PARTS, "boards"):
        record_size(run, name)
    record_metals(run)
    for target, name in (("hot.fig2.aluminium_youngs", "aluminium"),
                         ("hot.sec3_2.wheel_youngs", "wheel")):
        run.record(target, bodies(name)[name].material.E,
                   scale=f"scenes/hot_{name}.toml",
                   note="that of aluminium, not the printed one (HOT-X2)")


def scene(name):
    """Return the scene of the catalogue with a name."""
    return load(SCENES / f"hot_{name}.toml")


def bodies(name):
    """Return the bodies of a scene by name."""
    return {body.name: body for body in scene(name).body}


def materials(name):
    """Return {target: value} of the materials in Table 2, by part (HOT-X1, HOT-X3, HOT-X4)."""
    printed, values, by_name = targets.load(), {}, bodies(name)
    for k, body in enumerate(PARTS[name]):
        if body is not None:
            values |= part(f"hot.table2.{name}", k, by_name[body])
    return {target: value for target, value in values.items() if target in printed}


def part(table, k, body):
    """Return density, Young's modulus and Poisson's ratio of part k; nu is not always printed."""
    return {f"{table}.density.{k}": body.density, f"{table}.youngs.{k}": body.material.E,
            f"{table}.poisson.{k}": body.material.nu}


def boards(by_name):
    """Return the values of Boards: Table 2 prints ranges of moduli and the flow of the grains."""
    flow = by_name["grains"].material.flow
    moduli = [body.material.E for body in by_name.values()]
    return {"hot.table2.boards.density.0": by_name["upper board"].density,
            "hot.table2.boards.youngs.0": min(moduli), "hot.table2.boards.youngs.1": max(moduli),
            "hot.table2.boards.poisson.0": by_name["upper board"].material.nu,
            "hot.table2.boards.clamp_min": flow.s_min, "hot.table2.boards.clamp_max": flow.s_max}


def sheets(by_name):
    """Return the values of Figure 2: moduli relative to that of aluminium, and its yield stress."""
    E = {name: body.material.E for name, body in by_name.items()}
    names = {10: "a tenth", 100: "a hundredth", 1000: "a thousandth"}
    values = {f"hot.fig2.divisor.{n}": E["aluminium"] / E[name] for n, name in names.items()}
    return values | {"hot.fig2.aluminium_yield": by_name["aluminium"].material.flow.sigma_y}


SINGLE = {
    "armacat": lambda b: {"hot.table2.armacat.youngs.cat_stiff": b["cat"].material.E},
    "boards": boards,
    "boxes": lambda b: {"hot.table2.yield.metal": b["metal"].material.flow.sigma_y},
    "faceless": lambda b: {"hot.sec7_2.faceless.youngs": b["bust"].material.E},
    "sauce": lambda b: {"hot.table2.yield.sauce": b["sauce"].material.flow.sigma_y,
                        "hot.sec7_2.sauce_youngs": b["sauce"].material.E},
    "aluminium": sheets,
    "stiffness": lambda b: {"hot.sec7_4.ends_youngs": b["lower end"].material.E},
}
CLOCKS = {      # HOT-dt
    "twist": lambda s: {"hot.sec7_1.cfl": s.cfl, "hot.sec7_1.frame": s.longest,
                        "hot.intro.cfl_grid": cells(s)},
    "boxes": lambda s: {"hot.sec7_1.frame_boxes_donut": s.longest},
    "wheel": lambda s: {"hot.sec7_1.frame_wheel": s.longest},
}


def cells(scene):
    """Return the cells crossed by the fastest particle of a scene in its longest step (HOT-cfl).

    Its particles get 1 m/s, without gravity.
    """
    particles = build(scene).bodies[0].particles
    particles.v[:] = np.eye(scene.dim)[0]
    return advective(particles, scene.dx, 0.0, np.zeros(scene.dim)) / scene.dx


def variants():
    """Return the modulus of the soft cat, as section 7.2 and the caption of Figure 15 give it."""
    cat, = (body for body in warm_states.scene("armacat_soft", "quick").body if body.name == "cat")
    return dict.fromkeys(("hot.table2.armacat.youngs.cat_soft", "hot.sec7_2.armacat_youngs"),
                         cat.material.E)


def sweep():
    """Return Figure 20's moduli of the bar's middle (HOT-X17) and its number of methods."""
    moduli = {f"hot.sec7_4.middle.1e{round(log10(E))}": E for E in stiffness.SWEEP}
    return moduli | {"hot.sec7_4.methods": len(stiffness.METHODS)}


def solver():
    """Return the constants of the methods without options (HOT-X5, HOT-X11)."""
    hot = METHODS["hot"]
    return {
        "hot.sec7_1.eps": hot.eps, "hot.sec7_1.levels": hot.levels,
        "hot.sec7_1.window": hot.window, "hot.sec7_1.gs_sweeps": hot.cycle.sweeps,
        "hot.alg2.coarse_tol": hot.cycle.tolerance, "hot.alg1.k_max": newton_tolerance(1.0, 0.0),
        "hot.sec7_3.pcg_cap": METHODS["lbfgs-h"].max_cg_iterations,
        "hot.sec7_1.gast_tol": METHODS["gast15"].eps,
        "hot.sec7_2.gast_tol_faceless": METHODS["gast15"].eps,
        "hot.sec5_2.ell_3d": surface(1.0, 3), "hot.sec5_2.ell_2d": surface(1.0, 2)}


def sparsity():
    """Return the bases of the most blocks in a row of matrix and restriction (HOT-nnz)."""
    n, d = 9, 3
    embedding = embed(np.indices((n,) * d).reshape(d, -1).T)
    rows = {"fine": pattern_of(np.arange(n**d).reshape((n,) * d), 2).indptr,
            "transfer": embedding.W.T.tocsr().indptr}
    return {f"hot.sec6.nnz_{name}": np.diff(start).max() ** (1.0 / d)
            for name, start in rows.items()}


def stretches():
    """Return the bounds of the deformation gradient in Figure 18."""
    return {"hot.fig18.stretch_min": stretched_box.LOW, "hot.fig18.stretch_max": stretched_box.HIGH}


def record_size(run, name):
    """Record grid spacing and particles of Table 2, of a scene at the paper's size."""
    scene = sized(f"hot_{name}", "paper")
    scale = f"scenes/hot_{name}.toml at the paper's size"
    run.record(f"hot.table2.{name}.dx", scene.dx, scale=scale)
    count = sum(entered(body) for body in scene.body if body.name not in UNCOUNTED)
    run.record(f"hot.table2.{name}.particles", count, scale=scale)


def record_metals(run):
    """Record the least and greatest constants of metals, in the ranges of Table 1 (HOT-X12)."""
    metal = [bodies(name)[body] for name, metals in METALS.items() for body in metals]
    constants = {"density": [b.density for b in metal], "youngs": [b.material.E for b in metal],
                 "poisson": [b.material.nu for b in metal],
                 "yield": [b.material.flow.sigma_y for b in metal]}
    scale = f"{len(metal)} metal bodies of {', '.join(METALS)}"
    for word, values in constants.items():
        run.record(f"hot.table1.metal.{word}_min", min(values), scale=scale)
        run.record(f"hot.table1.metal.{word}_max", max(values), scale=scale)
    run.note("Table 1 also prints ranges for tissue, rubber, bone, PVC and ceramic: no scene says "
             "that a body is of these, so nothing is compared with them")
