"""Energy that symplectic Euler conserves, H - (dt/2) dU/dt, over a long run of oscillators at half
the stable time step, with the state stored in double (f64) and in single precision (f32, emulated
by rounding). A particle by itself is not damped; a block is, by the filter of its transfer.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import EngFormatter

from ..common.style import TRANSFERS, legend_below, scales

NEEDS = ["extremes.explicit.long_run"]
SHARES = {"f64": 1.0, "f32": 0.45}


def scale(results):
    return f"2D; {scales(results, NEEDS[0])}"


def draw(results):
    table = results.table(NEEDS[0], "energy")
    names = list(dict.fromkeys(table["run"]))
    parts = [[n for n in names if n.startswith(w)] for w in ("one", "block")]
    parts = [part for part in parts if part]
    figure, axes = plt.subplots(1, len(parts), figsize=(7.0, 3.2), squeeze=False)
    for ax, part in zip(axes[0], parts, strict=True):
        for name in part:
            rows = table["run"] == name
            what, transfer, storage = name.split(".")
            ax.plot(table["step"][rows], table["kept"][rows], color=TRANSFERS[transfer],
                    alpha=SHARES[storage], label=f"{what}, {transfer}, {storage}")
        ax.set(xlabel="step", ylabel="conserved energy / initial")
        ax.ticklabel_format(useOffset=False)
        if part[0].startswith("block") and np.nanmin(table["kept"]) > 0.0:
            ax.set_yscale("log")
        ax.xaxis.set_major_formatter(EngFormatter(sep=" "))
    legend_below(figure, axes[0])
    return figure
