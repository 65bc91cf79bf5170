"""Every method by its name: HOT, its comparators, and all their options (HOT-methods).

"hot-plus" is ours: HOT with four levels, the coarsest solved exactly, and a new Hessian where the
old one proves wrong; `trade.hot.knobs` and `trade.hot.energy` compare the two.
"""

from dataclasses import dataclass, replace

import numpy as np

from .admm import ADMM
from .descent import StoppingRule, gradient_size, iterate, line_search_steps
from .displacement_stop import iterate_to_displacement, lazy_v_cycle
from .krylov import JACOBI, stiffest_tolerance
from .lbfgs import LBFGS, REBUILD_RULES
from .line_search import Iterate, LineSearchOptions
from .linearization import INVERSES, initial_inverse, linearizer
from .multigrid.options import CycleOptions, cycle_options
from .newton import Forcing, Newton
from .norms import scaled_norm
from .report import ProfiledSystem, Profiler, Solution

RULES, CYCLE = LineSearchOptions(), CycleOptions()
PRINTED = {"start": "zero", "balance": "none"}      # where HOT as printed is not our default
RELEASED = {"start": "gravity", "balance": "none", "window": 8}     # of the authors' public code
BALANCES = 5        # rounds of a method and a balance of rigid motions, at most
CHOICES = {
    "descent": ("lbfgs", "newton", "admm"),
    "inverse": (*INVERSES, "geometric"),
    "operator": ("matrix", "matrix-free"),
    "jacobi": tuple(JACOBI),
    "forcing": ("energy", "L2"),
    "norm": ("characteristic", "L2"),
    "start": ("gravity", "zero"),
    "balance": ("rigid", "none"),
    "rebuild_when": REBUILD_RULES,
    "return_map": ("lagged", "implicit"),
    "kernel": ("linear", "quadratic"),
    "implementation": ("blocks", "scipy"),
}


@dataclass(frozen=True)
class SolverOptions:
    """Options of all methods; the defaults are those of HOT as printed, but for `PRINTED`.

    Raises ValueError for an unknown word or a number out of its range.
    """

    method: str = "hot"                 # name in the report
    descent: str = "lbfgs"              # quasi-Newton, "newton", or no descent: "admm"
    inverse: str = "cycle"              # first inverse of L-BFGS, preconditioner of Newton's CG
    operator: str = "matrix"            # or "matrix-free": products without assembly
    jacobi: str = "block"               # diagonal blocks as in the release, or "scalar", "none"
    forcing: str = "energy"             # norm that the tolerance of Newton's CG depends on
    norm: str = "characteristic"        # in which the gradient is measured, or "L2" [kg m/s]
    eps: float = 1e-7                   # its tolerance
    displacement_tolerance: float = 0.0     # error of the particles' displacement in a step [dx],
                                        # with eps as a first guess (see `displacement_stop`);
                                        # 0: eps alone decides
    start: str = "gravity"              # of the increment: g dt (the release), or "zero" (printed)
    balance: str = "rigid"              # rigid motions balance to round-off, or "none" (printed):
                                        # within the tolerance alone (see `rigid`)
    window: int = 8                     # pairs of L-BFGS
    rebuild_every: int = 0              # steps after which L-BFGS takes a new Hessian; 0: never
    return_map: str = "lagged"          # of plastic flow: after the solve (printed), or "implicit",
                                        # in the potential (see `return_map`)
    creep: float = 1e-4                 # sliding in a step [dx] below which friction is not full
    rebuild_when: str = "never"         # also where a step was "shortened", or shows it "stale"
    max_iterations: int = 10000         # outer (the release)
    max_cg_iterations: int = 10000      # per linear solve (the release)
    flexible: bool = False              # CG that bears a preconditioner that varies
    patience: int = 50                  # see `descent.StoppingRule`
    search: LineSearchOptions = RULES   # of the line search
    penalty: float = 1.0                # of ADMM, over the stiffness: see `Splitting`
    levels: int = 3                     # of multigrid
    kernel: str = "linear"              # of its embedding
    implementation: str = "blocks"      # of it; "scipy" is the readable reference
    cycle: CycleOptions = CYCLE         # of its V-cycle: smoother, coarsest solver ...

    def __post_init__(self):
        for name, words in CHOICES.items():
            if getattr(self, name) not in words:
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected one of {words}")
        if not 0.0 <= self.displacement_tolerance < np.inf:
            raise ValueError(f"displacement_tolerance = {self.displacement_tolerance}: expected "
                             ">= 0, an error in grid spacings")
        if not 0.0 < self.creep < np.inf:
            raise ValueError(f"creep = {self.creep}: expected > 0, a sliding in grid spacings")
        if not self.eps > 0.0:
            raise ValueError(f"eps = {self.eps}: expected > 0")
        if not (self.patience >= 1 and 0.0 < self.penalty < np.inf):
            raise ValueError(f"patience = {self.patience}, penalty = {self.penalty}: expected "
                             "patience >= 1, penalty > 0")
        if min(self.window, self.rebuild_every, self.max_iterations, self.max_cg_iterations) < 0:
            raise ValueError("window, rebuild_every, max_iterations and max_cg_iterations: "
                             "expected none < 0")
        cycle_options(self.levels, self.cycle._asdict())
        if self.descent == "newton" and self.inverse == "cg":
            raise ValueError('inverse = "cg" is a first inverse of L-BFGS: expected another one as '
                             "preconditioner of Newton's CG")
        if self.descent == "admm" and (self.inverse, self.operator) != ("jacobi", "matrix"):
            raise ValueError('descent = "admm" has its own matrix: expected inverse = "jacobi" '
                             'and operator = "matrix"')
        if self.descent == "admm" and self.return_map == "implicit":
            raise ValueError("return_map = 'implicit' with the method 'admm', which splits an "
                             "elastic energy: expected another method, such as 'hot-plus'")
        if self.operator == "matrix-free" and self.inverse in ("cycle", "sgs", "geometric"):
            raise ValueError(f"inverse = {self.inverse!r} needs a matrix: expected operator = "
                             '"matrix", or inverse = "jacobi" or "cg"')


_PN = SolverOptions("pn-pcg", "newton", inverse="jacobi")
METHODS = {options.method: options for options in (
    SolverOptions(),
    SolverOptions("hot-quadratic", kernel="quadratic"),
    SolverOptions("hot-plus", rebuild_when="stale", levels=4,
                  cycle=CYCLE._replace(coarsest="direct")),
    SolverOptions("lbfgs-h", inverse="cg"),
    _PN,
    replace(_PN, method="pn-pcg-mf", operator="matrix-free"),
    replace(_PN, method="pn-mgpcg", inverse="cycle"),
    replace(_PN, method="sgs-pcg", inverse="sgs"),
    replace(_PN, method="gast15", operator="matrix-free", forcing="L2", norm="L2", eps=1e-3),
    SolverOptions("lbfgs-gmg", inverse="geometric"),
    replace(_PN, method="pn-gmg-pcg", inverse="geometric"),
    SolverOptions("admm", "admm", inverse="jacobi"),
)}


def options_of(method, **changes):
    """`SolverOptions` of a method by its name, with changes. Raises ValueError for unknown ones."""
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: expected one of {tuple(METHODS)}")
    return replace(METHODS[method], **changes)


def printed(method, **changes):
    """Return the `SolverOptions` of a method by its name with `PRINTED` and changes.

    Raises ValueError for unknown ones.
    """
    return options_of(method, **{**PRINTED, **changes})


def released(method, **changes):
    """Return the `SolverOptions` of a method by its name as the authors' public code has them, with
    changes: `RELEASED`, that is the start g dt, no balance, a window of 8; and CG of the coarsest
    level is relative to the right-hand side of the cycle.

    Two things are not repeated: that code adds the last accepted step once more at the end of a
    solve, and lets the unit rows of fixed nodes enter the coarser matrices. Raises ValueError for
    unknown names.
    """
    options = options_of(method, **{**RELEASED, **changes})
    return replace(options, cycle=options.cycle._replace(stop="load"))


def solve(system, options, stop, profiler):
    """Return (`Iterate`, None) or (`Iterate`, message) of a system by the method of the options."""
    steps = method_steps(system, options, profiler)

    def minimise_from(start):
        if options.displacement_tolerance > 0.0:
            return iterate_to_displacement(system, start, steps, stop, options, profiler)
        return iterate(system, start, steps[0], stop, profiler)
    if options.balance == "none":
        return minimise_from(system.start)
    return balanced_iterate(system, minimise_from, stop, profiler)


def balanced_iterate(system, minimise_from, stop, profiler):
    """Return (`Iterate`, None) that is within its tolerance and balances rigid motions, or
    (`Iterate`, message); minimise_from(start (n, d)) returns the same without the balance.
    """
    start = system.start
    for _ in range(BALANCES):
        point, message = minimise_from(start)
        dv = point.dv if message is not None else system.balanced(point.dv)
        if dv is point.dv:
            return point, message
        point = Iterate(dv, *system.evaluate(dv))
        if gradient_size(point, system.kappa, stop.norm) <= stop.eps:
            profiler.record(scaled_norm(point.g, system.kappa))
            return point, None
        start = dv
    return point, (f"the tolerance and the balance of rigid motions were not met together in "
                   f"{BALANCES} rounds")


def method_steps(system, options, profiler):
    """Return the function that advances an `Iterate`, and the multigrid for its check."""
    if options.descent == "admm":
        admm = ADMM(system, options.penalty, options.max_cg_iterations, profiler)
        return admm.advance, lazy_v_cycle(system, options, profiler)
    method = descent_method(system, options, profiler)
    advance = line_search_steps(system, method, options.search, profiler)
    if options.descent == "lbfgs" and options.inverse in ("cycle", "geometric"):
        return advance, method.initial_inverse
    return advance, lazy_v_cycle(system, options, profiler)


def descent_method(system, options, profiler):
    """Return the method for `descent` that the options describe."""
    if options.descent == "lbfgs":
        return LBFGS(initial_inverse(system, options, profiler), options.window,
                     options.rebuild_every, options.rebuild_when)
    L2 = options.norm == "L2"
    tau = options.eps if L2 else stiffest_tolerance(options.eps, system.kappa)
    return Newton(linearizer(system, options, profiler), Forcing(options.forcing, tau),
                  options.max_cg_iterations, options.flexible, profiler)


def minimise(system, method="hot", **changes):
    """Return the `Solution` of a `System` by a method: its name or `SolverOptions`, with changes.

    The report of a solve that ends early says why; no error is raised. Raises ValueError for an
    unknown name or option.
    """
    options = replace(method, **changes) if isinstance(method, SolverOptions) else options_of(
        method, **changes)
    profiler = Profiler()
    with profiler.part("other"), np.errstate(all="ignore"):    # what is not finite is reported
        watched = ProfiledSystem(system, profiler)
        stop = StoppingRule(options.eps, options.norm, options.max_iterations, options.patience)
        point, message = solve(watched, options, stop, profiler)
        report = profiler.report(options.method, message)
        stalled = message is None and not report.iterations and stalls(system, options, point.dv)
    return Solution(point.dv, point.E, report._replace(stalled=stalled))


def stalls(system, options, dv):
    """Return whether the balance of rigid motions would displace a particle by more than the
    tolerance of the step, `displacement_tolerance` or else eps [dx], from the increment dv.
    """
    if options.balance == "rigid":
        return False
    balanced, tolerance = system.balanced(dv), options.displacement_tolerance or options.eps
    return balanced is not dv and system.particle_displacement(balanced - dv) > tolerance
