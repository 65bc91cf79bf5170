"""Every method by its word: HOT, what it is compared to, and every knob (HOT-methods).

"hot-plus" is ours: HOT with four levels, the coarsest solved exactly, and a new Hessian where the
old one is seen to be wrong; `trade.hot.knobs` and `trade.hot.energy` compare the two.
"""

from dataclasses import dataclass, replace

import numpy as np

from .admm import ADMM
from .descent import Stop, advance_of, iterate
from .displacement_stop import held, multigrid_once
from .krylov import JACOBI, stiffest_tolerance
from .lbfgs import LBFGS, RENEWALS
from .line_search import Rules
from .linearization import INVERSES, first_inverse, linearised
from .multigrid.options import Choices, checked
from .newton import Forcing, Newton
from .report import Solution, Watch, Watched

RULES, CYCLE = Rules(), Choices()
WORDS = {
    "descent": ("lbfgs", "newton", "admm"),
    "inverse": (*INVERSES, "geometric"),
    "operator": ("matrix", "free"),
    "jacobi": tuple(JACOBI),
    "forcing": ("energy", "L2"),
    "norm": ("characteristic", "L2"),
    "start": ("zero", "gravity"),
    "renew": RENEWALS,
    "kernel": ("linear", "quadratic"),
    "path": ("blocks", "scipy"),
}


@dataclass(frozen=True)
class Options:
    """Every knob of every method; as they stand, those of HOT as printed.

    Raises ValueError for a word that is not known or a number out of its range.
    """

    method: str = "hot"                 # name in the report
    descent: str = "lbfgs"              # quasi-Newton, "newton", or no descent: "admm"
    inverse: str = "cycle"              # first inverse of L-BFGS, preconditioner of Newton's CG
    operator: str = "matrix"            # "free": products with the Hessian without a matrix
    jacobi: str = "block"               # diagonal blocks as in the release, or "scalar", "none"
    forcing: str = "energy"             # norm that the tolerance of Newton's CG depends on
    norm: str = "characteristic"        # in which the gradient is measured, or "L2" [kg m/s]
    eps: float = 1e-7                   # its tolerance
    cells: float = 0.0                  # error of the particles' displacement to hold [dx], with
                                        # eps as a first guess (see `displacement_stop`);
                                        # 0: eps alone decides
    start: str = "zero"                 # of the increment, or "gravity": g dt (the release)
    window: int = 8                     # pairs that L-BFGS keeps
    rebuild: int = 0                    # steps after which L-BFGS takes a new Hessian; 0: never
    renew: str = "never"                # or where a step was "shortened", or shows it "stale", too
    iterations: int = 10000             # outer, at most (the release)
    cg_iterations: int = 10000          # per linear solve, at most (the release)
    flexible: bool = False              # CG that bears a preconditioner that varies
    patience: int = 50                  # see `descent.Stop`
    search: Rules = RULES               # of the line search
    penalty: float = 1.0                # of ADMM, over the stiffness: see `Splitting`
    levels: int = 3                     # of multigrid
    kernel: str = "linear"              # of its embedding
    path: str = "blocks"                # of its implementation; "scipy" is the reference
    cycle: Choices = CYCLE              # of its V-cycle: smoother, coarsest solver ...

    def __post_init__(self):
        for name, words in WORDS.items():
            if getattr(self, name) not in words:
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected one of {words}")
        if not 0.0 <= self.cells < np.inf:
            raise ValueError(f"cells = {self.cells}: expected >= 0, an error in grid spacings")
        if not self.eps > 0.0:
            raise ValueError(f"eps = {self.eps}: expected > 0")
        if not (self.patience >= 1 and 0.0 < self.penalty < np.inf):
            raise ValueError(f"patience = {self.patience}, penalty = {self.penalty}: expected "
                             "patience >= 1, penalty > 0")
        if min(self.window, self.rebuild, self.iterations, self.cg_iterations) < 0:
            raise ValueError("window, rebuild, iterations and cg_iterations: expected none < 0")
        checked(self.levels, self.cycle._asdict())
        if self.descent == "newton" and self.inverse == "cg":
            raise ValueError('inverse = "cg" is a first inverse of L-BFGS: expected another one as '
                             "preconditioner of Newton's CG")
        if self.descent == "admm" and (self.inverse, self.operator) != ("jacobi", "matrix"):
            raise ValueError('descent = "admm" has its own matrix: expected inverse = "jacobi" '
                             'and operator = "matrix"')
        if self.operator == "free" and self.inverse in ("cycle", "sgs", "geometric"):
            raise ValueError(f"inverse = {self.inverse!r} needs a matrix: expected operator = "
                             '"matrix", or inverse = "jacobi" or "cg"')


_PN = Options("pn-pcg", "newton", inverse="jacobi")
METHODS = {options.method: options for options in (
    Options(),
    Options("hot-quadratic", kernel="quadratic"),
    Options("hot-plus", renew="stale", levels=4, cycle=CYCLE._replace(coarsest="direct")),
    Options("lbfgs-h", inverse="cg"),
    _PN,
    replace(_PN, method="pn-pcg-mf", operator="free"),
    replace(_PN, method="pn-mgpcg", inverse="cycle"),
    replace(_PN, method="sgs-pcg", inverse="sgs"),
    replace(_PN, method="gast15", operator="free", forcing="L2", norm="L2", eps=1e-3),
    Options("lbfgs-gmg", inverse="geometric"),
    replace(_PN, method="pn-gmg-pcg", inverse="geometric"),
    Options("admm", "admm", inverse="jacobi"),
)}


def options_of(method, **changes):
    """`Options` of a method by its word, with changes. Raises ValueError for an unknown word."""
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: expected one of {tuple(METHODS)}")
    return replace(METHODS[method], **changes)


def solved(system, options, stop, watch):
    """(`Point`, why not converged or None) of a system by the method that the options describe."""
    advance, inverse = steps(system, options, watch)
    if options.cells > 0.0:
        return held(system, advance, inverse, stop, options, watch)
    return iterate(system, system.start, advance, stop, watch)


def steps(system, options, watch):
    """The steps of the method that the options describe, and the multigrid that checks its end."""
    if options.descent == "admm":
        admm = ADMM(system, options.penalty, options.cg_iterations, watch)
        return admm.advance, multigrid_once(system, options, watch)
    method = made(system, options, watch)
    advance = advance_of(system, method, options.search, watch)
    if options.descent == "lbfgs" and options.inverse in ("cycle", "geometric"):
        return advance, method.first
    return advance, multigrid_once(system, options, watch)


def made(system, options, watch):
    """The method of `descent` that the options describe."""
    if options.descent == "lbfgs":
        return LBFGS(first_inverse(system, options, watch), options.window, options.rebuild,
                     options.renew)
    L2 = options.norm == "L2"
    tau = options.eps if L2 else stiffest_tolerance(options.eps, system.kappa)
    return Newton(linearised(system, options, watch), Forcing(options.forcing, tau),
                  options.cg_iterations, options.flexible, watch)


def minimise(system, method="hot", **changes):
    """`Solution` of a `System` by a method: its word or its `Options`, with changes.

    A solve that ends early says so in its report and raises nothing. Raises ValueError for an
    unknown word or option.
    """
    options = replace(method, **changes) if isinstance(method, Options) else options_of(
        method, **changes)
    watch = Watch()
    with watch.part("other"), np.errstate(all="ignore"):    # what is not finite is reported
        watched = Watched(system, watch)
        stop = Stop(options.eps, options.norm, options.iterations, options.patience)
        point, why = solved(watched, options, stop, watch)
    return Solution(point.dv, point.E, watch.report(options.method, why))
