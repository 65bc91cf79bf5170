"""Labels and line styles of the methods that solve a step, and a panel of their descent."""

EPS = 1e-7          # the paper's tolerance
LABELS = {"iteration": "iteration", "cg": "CG iterations", "cpu": "CPU seconds",
          "residual": "residual", "error": "error of the particles"}
STYLES = {
    "hot": ("HOT", "C0", "o-"),
    "hot-quadratic": ("HOT-quadratic", "C9", "o--"),
    "lbfgs-h": ("LBFGS-H", "C1", "s-"),
    "lbfgs-gmg": ("LBFGS-GMG", "C8", "s--"),
    "admm": ("ADMM", "C3", "-"),
    "pn-pcg": ("PN-PCG", "C2", "^-"),
    "pn-pcg-mf": ("PN-PCG (MF)", "C2", "v:"),
    "pn-mgpcg": ("PN-MGPCG", "C4", "d-"),
    "pn-mgpcg-flexible": ("PN-MGPCG, flexible CG", "C4", "d:"),
    "pn-gmg-pcg": ("PN-MGPCG, geometric", "C6", "p-"),
    "pn-gmg-pcg-flexible": ("PN-MGPCG, geometric, flexible CG", "C6", "p:"),
    "sgs-pcg": ("SGS-PCG", "0.5", "x-"),
}


def draw_methods(ax, table, columns, methods, rows=True):
    """Draw one column of a table of iterates over another, a curve for each method."""
    x, y = columns
    for method in methods:
        at = (table["method"] == method) & rows
        label, color, style = STYLES[method]
        ax.semilogy(table[x][at], table[y][at], style, color=color, label=label, ms=3)
    if y == "residual":
        ax.axhline(EPS, color="0.3", ls="--", lw=0.8)
    ax.set(xlabel=LABELS[x], ylabel=LABELS[y])
    if x == "cpu":
        early = table["cpu"][(table["iteration"] == 1) & rows].min()
        ax.set(xscale="log", xlim=(0.5 * early, None))      # the start is known almost at once
