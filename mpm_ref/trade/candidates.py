"""The settings that a search tries: single knobs, grids between the halved ones, and pairs."""

from ..body import AFFINE
from ..scene.crossing import crossing_time
from ..sweep.setting import USUAL_PER_CELL, setting

CFL, CELLS = (0.9, 0.5, 0.25), (0.9, 0.6, 0.3)      # of the explicit bound; of implicit steps
PARTICLES = (0.5, 2 / 3, 1.5, 2.0)                  # per cell and axis, times the scene's
TRANSFERS = ("mls", "apic", "apic rpic 0.1", "flip 0.95", "flip", "pic")
DEGREES = (1, 2, 3)
LOCKING = 0.45                      # Poisson's ratio from which on averaged volumes are tried
TOLERANCES = (1e-3, 1e-5, 1e-7)     # of implicit steps; the last is HOT's
IMPLICIT = "hot-plus"
GRIDS = (4.0, 3.0, 2.0, 1.5, 1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125)    # factors of dx


def single_knobs(scene):
    """Return the settings that change one knob of a scene, cheapest first by experience."""
    cells = CFL if scene.integrator == "explicit" else CELLS
    cfl = [value for value in cells if scene.dt is not None or value != (scene.cfl or 0.5)]
    transfer, given = scene.step_scheme.transfer, transfer_text(scene.step_scheme)
    settings = [setting(cfl=value) for value in cfl]
    settings += [setting(particles=factor) for factor in PARTICLES]
    settings += [setting(transfer=text) for text in (*TRANSFERS, *relaxed_transfers(scene))
                 if text != given]
    settings += [with_degree(degree, transfer) for degree in DEGREES
                 if degree != scene.scheme.degree]
    settings += [setting(sampling=kind) for kind in other_samplings(scene)]
    if scene.collider and scene.integrator == "explicit":
        settings += [setting(boundary="nodes" if scene.boundary == "surface" else "surface")]
    if scene.integrator == "explicit":
        settings += [*volume_settings(scene), *gimp_settings(scene), *precision_settings(scene)]
    else:
        solver = scene.solver
        tolerance = TOLERANCES[-1] if solver is None or solver.eps is None else solver.eps
        settings += [setting(eps=eps) for eps in TOLERANCES if eps != tolerance]
    other = IMPLICIT if scene.integrator == "explicit" else "explicit"
    return [*settings, setting(integrator=other, cfl=CELLS[1] if other == IMPLICIT else CFL[1])]


def transfer_text(scheme):
    """Return the text of a scheme's transfer with its blend, as the knob `transfer` has it."""
    if scheme.relaxation:
        return f"{scheme.transfer} relaxation {scheme.relaxation:.3g}"
    if scheme.rpic:
        return f"{scheme.transfer} rpic {scheme.rpic:g}"
    if scheme.transfer == "flip" and scheme.flip < 1.0:
        return f"flip {scheme.flip:g}"
    return scheme.transfer


def relaxed_transfers(scene):
    """Return the affine transfers with the time in which a wave crosses a cell as relaxation, for
    explicit scenes whose bodies all have a density and a law that is no network.
    """
    crossing = crossing_time(scene) if scene.integrator == "explicit" else None
    if crossing is None:
        return []
    return [f"{name} relaxation {crossing:.3g}" for name in AFFINE]


def volume_settings(scene):
    """Return the settings without averaged volumes where an explicit scene has them, or with them
    where one of its bodies is nearly incompressible.
    """
    if scene.scheme.f_bar:
        return [setting(f_bar=False)]
    ratios = [body.material.nu or 0.0 for body in scene.body]
    return [setting(f_bar=True)] if max(ratios) >= LOCKING else []


def precision_settings(scene):
    """Return the setting with the other precision, for scenes without a learned law or contact."""
    if scene.contact or any(body.material.is_neural for body in scene.body):
        return []
    other = "double" if scene.scheme.precision == "single" else "single"
    return [setting(precision=other)]


def gimp_settings(scene):
    """Return the setting without GIMP where an explicit scene has it, else the one with it where
    several points fill a cell along an axis; with one it is the quadratic spline.
    """
    if scene.scheme.gimp:
        return [setting(gimp=0.0)]
    numbers = [getattr(body.sampling, "per_cell", None) or USUAL_PER_CELL
               for body in scene.body if body.shape is not None]
    if not numbers or numbers[0] == 1:
        return []
    without_field = without_affine_field(scene.step_scheme.transfer)
    return [setting(degree=2, gimp=float(numbers[0])) | without_field]


def with_degree(degree, transfer):
    """Return the setting of a degree; linear splines carry no affine field."""
    chosen = setting(degree=degree)
    return chosen | without_affine_field(transfer) if degree == 1 else chosen


def without_affine_field(transfer):
    """Return the setting in which an affine transfer becomes FLIP."""
    return setting(transfer="flip 0.95") if transfer in AFFINE else setting()


def other_samplings(scene):
    """Return the kinds of sampling that differ from that of the first body with a shape."""
    kinds = [body.sampling.__struct_config__.tag for body in scene.body if body.shape is not None]
    return [kind for kind in ("regular", "poisson") if kinds and kind != kinds[0]]


def pairs(settings):
    """Return the unions of two settings that change different knobs."""
    return [a | b for k, a in enumerate(settings) for b in settings[k + 1:]
            if not {name for name, _ in a.items if name != "dx"}
            & {name for name, _ in b.items if name != "dx"}]
