"""Writes targets.csv: what is compared with, where it comes from.

Solutions of equations are computed; measured values are copied, in the units of their source, and converted.
"""

from __future__ import annotations

import numpy as np

from . import cantilever, elastica, friction, loop, tables

NAMES = (
    "test",
    "case",
    "quantity",
    "unit",
    "target",
    "kind",
    "density",
    "rigidity",
    "coercive_couple",
    "nodes",
    "source",
    "note",
)
UNKNOWN = (None,) * 4

ELASTICA = (
    "heavy elastica, theta'' = -Gamma (1 - s) cos theta, theta(0) = theta'(1) = 0, solved in validation/elastica.py to "
    "1e-8; W. G. Bickley 1934, The heavy elastica, Philosophical Magazine 17, 603-622"
)
LOOP = (
    "planar heavy elastica with both ends in one grip, solved in validation/elastica.py to 1e-8; the tests: "
    "F. T. Peirce 1930; R. H. Plaut 2015, Textile Research Journal, doi:10.1177/0040517514553877"
)
PEIRCE = (
    "F. T. Peirce 1930, The 'handle' of cloth as a measurable quantity, Journal of the Textile Institute 21, T377-T416"
)
REPEATED = "an approximation, as textbooks repeat it; the paper itself was not at hand"
MATSUDAIRA = (
    "M. Matsudaira, T. Masuda, M. Wada, H. Yokura 2015, Shape Factor of Flared Skirts Compared with That of "
    "Circular Fabrics, Journal of Textile Engineering 61(6) 69-73, doi:10.4188/jte.61.69, tables 1 (KES) and 2 (drape)"
)
SECOND_HAND = (
    "second-hand: from the transcription in github.com/antonbj3/3fold-motion-engine, commit 72e280ae; it does not "
    "state the diameters of specimen and pedestal, nor the shear stiffness"
)
# KES units of the source in SI: gf cm²/cm in N m, gf cm/cm in N m/m, mg/cm² in kg/m².
GF_CM2, GF_CM, MG_CM2 = 9.80665e-5, 9.80665e-3, 1e-2
# Name, B [gf cm²/cm], 2HB [gf cm/cm], W [mg/cm²], drape coefficient [%], nodes.
FABRICS = (
    ("cotton broad", 0.118, 0.124, 12.38, 82.9, 2),
    ("wool tropical", 0.067, 0.033, 16.29, 49.8, 5),
    ("polyester tropical", 0.077, 0.029, 11.65, 50.7, 5),
    ("polyester faille", 0.019, 0.007, 10.43, 28.3, 7),
)


def rows() -> list[tuple[object, ...]]:
    """Rows of targets.csv."""
    solved, formula = "solution of an equation", "formula"
    out: list[tuple[object, ...]] = []
    for gamma in cantilever.GAMMAS:
        for name, value in zip(("reach/L", "droop/L"), elastica.cantilever(gamma).tip, strict=True):
            out.append(("cantilever", f"gamma {gamma:g}", name, "-", value, solved, *UNKNOWN, ELASTICA, ""))
    exact = elastica.gamma_of_slope(float(np.tan(np.radians(elastica.PEIRCE_ANGLE))))
    overhang = "overhang at 41.5 degrees"
    out.append(
        (
            "peirce",
            overhang,
            "w g l^3/B",
            "-",
            exact,
            solved,
            *UNKNOWN,
            ELASTICA,
            "c = l/2, as ASTM D1388 has it, means 8",
        )
    )
    factor = elastica.peirce_factor(elastica.PEIRCE_ANGLE)
    text = f"{PEIRCE}: c = l (cos(theta/2)/(8 tan theta))^(1/3)"
    out.append(("peirce", overhang, "c/l", "-", factor, formula, *UNKNOWN, text, REPEATED))
    for form, slope in loop.FORMS.items():
        for load in loop.LOADS:
            height = float(elastica.loop(slope, load / 8.0).y[-1] / 2.0)
            out.append(("loop", f"{form}, w g L^3/B {load:g}", "height/L", "-", height, solved, *UNKNOWN, LOOP, ""))
            if form != "pear":
                length = elastica.peirce_loop(form, height)
                text = f"{PEIRCE}: formula of the {form} loop (validation/elastica.py)"
                case = f"{form}, w g L^3/B {load:g}, of the elastica's height"
                out.append(("loop", case, "c/L", "-", length, formula, *UNKNOWN, text, REPEATED))
    for name, rigidity, couple, weight, drape, nodes in FABRICS:
        values = (weight * MG_CM2, rigidity * GF_CM2, couple * GF_CM, nodes)
        out.append(("drape", name, "drape coefficient", "%", drape, "measured", *values, MATSUDAIRA, SECOND_HAND))
    return out + friction.rows()


def write() -> None:
    """Write targets.csv."""
    tables.write(tables.TARGETS, NAMES, rows())
