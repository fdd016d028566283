"""``clothsim materials``."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from clothsim.material import Fabric, Value, materials

__all__ = ["EXAMPLE", "HELP", "NAME", "add_arguments", "execute"]

NAME = "materials"
HELP = "Print the fabrics of the library: every value with its unit, and what is published and what is an estimate."
EXAMPLE = "clothsim materials cotton silk"

_HEAD = """# Fabrics of the library

`clothsim materials > docs/fabrics.md` writes this page.

A value without a mark is published; **~** marks an estimate, not measured on this fabric: below it says what it rests
on. Everything is in SI units and per width of cloth. The rigidity B is the slope of the moment over curvature once the
friction between the yarns is overcome; 2HB is the gap between the two straight sides of the loop, and K0 the curvature
at which the first loading becomes straight. Linear bending has B alone, so it is softer than the fabric at the first,
small curvatures, where friction holds the yarns: there the rigidity is B + 2HB/K0. The engine bends isotropically; each
source, as it was read, gives one value for both directions (of two, √(warp · weft) would be taken). Friction is the
kinetic coefficient of the fabric on itself: no measured one was found. It is not part of a material; contact has its
own.
"""

# Column heads of the table and the values under them.
_COLUMNS = {
    "density [kg/m²]": "areal_density",
    "thickness [m]": "thickness",
    "warp [N/m]": "tensile_warp",
    "weft [N/m]": "tensile_weft",
    "shear [N/m]": "shear",
    "B [N m]": "bending_rigidity",
    "2HB [N m/m]": "coercive_couple",
    "K0 [1/m]": "transition_curvature",
    "friction": "friction",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which fabrics."""
    parser.add_argument("names", metavar="NAME", nargs="*", help="fabrics of the library; all of them by default")


def execute(options: argparse.Namespace) -> int:
    """Print the fabrics."""
    fabrics = [materials.fabric(name) for name in options.names or materials.names()]
    if options.json:
        print(json.dumps({"fabrics": [asdict(f) for f in fabrics], "sources": materials.sources()}, ensure_ascii=False))
    else:
        print(_page(fabrics) if not options.names else "\n\n".join(map(str, fabrics)))
    return 0


def _page(fabrics: list[Fabric]) -> str:
    """All fabrics as Markdown."""
    blocks = [_HEAD, _table(fabrics), "\n## Sources\n"]
    blocks += [f"- **{key}**: {about}" for key, about in materials.sources().items()]
    blocks += ["\n## Where each value comes from"]
    for fabric in fabrics:
        blocks += [f"\n### {fabric.name}\n\n{fabric.about[0].upper()}{fabric.about[1:]}.\n"]
        blocks += [f"- {', '.join(names)}: {where}" for where, names in _by_source(fabric).items()]
    return "\n".join(blocks)


def _table(fabrics: list[Fabric]) -> str:
    rows = [["fabric", *_COLUMNS], ["---"] * (len(_COLUMNS) + 1)]
    rows += [[f.name, *(_cell(getattr(f, name)) for name in _COLUMNS.values())] for f in fabrics]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _cell(value: Value | None) -> str:
    if value is None:
        return "–"
    return f"{'~' if value.is_estimate else ''}{value.value:.3g}"


def _by_source(fabric: Fabric) -> dict[str, list[str]]:
    """Names of the values that share a source, published ones first."""
    groups: dict[str, list[str]] = {}
    values = sorted(fabric.values().items(), key=lambda item: item[1].is_estimate)
    for name, value in values:
        where = f"~ {value.note}" if value.is_estimate else f"{value.source}, {value.note}"
        groups.setdefault(where, []).append(name.replace("_", " "))
    return groups
