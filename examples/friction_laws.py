"""The four friction laws alone: force over sliding speed, and over the pull on a body at rest.

Run: python examples/friction_laws.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import clothsim as cs

SMOOTH = {"mu_c": 0.1, "mu_s": 0.2, "v_s": 0.4, "delta_s": 0.2}
COEFFICIENTS = {
    "coulomb": {"mu_c": 0.1},
    "coulomb-stiction": {"mu_c": 0.1, "mu_s": 0.2},
    "stribeck": SMOOTH,
    "viscous": {**SMOOTH, "f_v": 0.02, "delta_v": 1.0},
}
COLOURS = {"coulomb": "#3f7a57", "coulomb-stiction": "#9c2f35", "stribeck": "#2f5d8c", "viscous": "#c08a2e"}


def main(out: Path) -> None:
    """Draw both plots for 1 N of normal force over 1 m²."""
    from matplotlib.figure import Figure

    speed, pull = np.geomspace(1e-4, 2.0, 400), np.linspace(0.0, 0.3, 301)
    figure = Figure(figsize=(9.0, 3.6), dpi=150, layout="constrained")
    sliding, resting = figure.subplots(1, 2, sharey=True)
    for law, keys in COEFFICIENTS.items():
        style = {"color": COLOURS[law], "linewidth": 1.8, "label": law}
        sliding.plot(speed, -cs.friction.force(law, 1.0, speed[:, None], **keys)[:, 0], **style)
        if law in ("coulomb", "coulomb-stiction"):
            label = "coulomb" if law == "coulomb" else "the other three"
            resting.plot(
                pull, -cs.friction.force(law, 1.0, 0.0, pull[:, None], **keys)[:, 0], **{**style, "label": label}
            )
    sliding.set(title="sliding", xlabel="speed [m/s]", ylabel="friction over normal force", ylim=(0.0, 0.24))
    resting.set(title="at rest", xlabel="pull over normal force")
    for axis in (sliding, resting):
        axis.grid(color="#e4e1db", linewidth=0.8)
        axis.spines[["top", "right"]].set_visible(False)
        axis.legend(frameon=False, fontsize=9)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/friction_laws.png"))
