"""What every effect of the engine costs: milliseconds and share of a step, and bytes, on two named scenes.

Usage: ``python benches/effect_prices.py [--write] [--json] [--repeats 3] [--steps 30]``. ``--write`` puts the
table into README.md between its markers and the time per element into
``crates/cloth-sim/src/cost_model.json``, from which plans estimate (rebuild the extension for that). One
thread.

An effect with a row of its own in the report is priced by that row: its milliseconds in a step and its share
of the step's. An effect that is timed as part of another is priced by the difference of two runs, with it and
without, taken in turns; the motion of the two differs, and with it what contact has to do. What is done once,
before the first step, is priced by the difference of two builds. Each number is the least of the repeats, as
whatever else the machine does can only add.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import clothsim as cs

ROOT = Path(__file__).parents[1]
MODEL = ROOT / "crates" / "cloth-sim" / "src" / "cost_model.json"
README = ROOT / "README.md"
BEGIN, END = "<!-- effect prices: begin -->", "<!-- effect prices: end -->"
COMMAND = "python benches/effect_prices.py --write"
WARM_UP = 5
"""Steps before the clock starts."""

Table = dict[str, object]


def hanging(bending: Table | str = "hinge", in_plane: str = "baraff-witkin", **more: object) -> Table:
    """A sheet of 61 × 61 vertices that hangs from two corners in the wind."""
    laws: dict[str, Table] = {
        "none": {"model": "none"},
        "hinge": {"model": "hinge", "rigidity": 1e-5},
        "independent": {"model": "hinge", "rigidity": 1e-5, "hinges": "independent"},
        "bending-spring": {"model": "bending-spring", "stiffness": 0.1},
        "nonlinear": {"model": "nonlinear", "rigidity": 1e-5, "coercive_couple": 4e-4},
        "plastic": {"model": "plastic", "rigidity": 1e-5, "elastic_limit": 20.0},
        "hysteresis": {"model": "hysteresis", "rigidity": 1e-5, "coercive_couple": 4e-4, "plasticity": 0.1},
    }
    stretch: dict[str, Table] = {
        "spring": {"model": "spring", "stiffness": 100.0},
        "baraff-witkin": {"model": "baraff-witkin", "warp": 200.0, "weft": 200.0, "shear": 20.0, "damping": 0.002},
    }
    law = laws[bending] if isinstance(bending, str) else bending
    return {
        "duration": 1.0,
        "time": {"dt": 0.005},
        "air": {"wind": [1.0, 0.0, 2.0], "density": 1.2, "drag": 1.0, "lift": 0.5, "damping": 0.5},
        "cloth": [
            {
                "name": "sheet",
                "mesh": {"generator": "grid", "width": 1.0, "height": 1.0, "nx": 61, "ny": 61},
                "material": {"areal_density": 0.2, "in_plane": stretch[in_plane], "bending": law},
                "pins": [{"vertices": [0, 60]}],
            }
        ],
        **more,
    }


def draped(contact: Table | None = None, cloth: Table | None = None, **more: object) -> Table:
    """The same sheet as it comes down on a ball that turns."""
    scene = hanging(**more)
    sheet = dict(scene["cloth"][0])  # type: ignore[index]
    del sheet["pins"], scene["air"]
    scene["contact"] = {"detector": "bvh", "thickness": 0.005, "friction": 0.3, "self_friction": 0.2, **(contact or {})}
    scene["cloth"] = [{**sheet, "position": [0.01, 0.2537, 0.005], **(cloth or {})}]
    turn = {"axis": [0, 1, 0], "angle": 3.0}
    scene["collider"] = [
        {
            "name": "ball",
            "shape": {"type": "sphere", "radius": 0.25, "tolerance": 2e-3},
            "keyframes": [{"time": 0.0}, {"time": 1.0, "rotation": turn}],
        }
    ]
    return scene


def sewn() -> Table:
    """The hanging sheet with its left side sewn to its right side: 61 stitches."""
    scene = hanging()
    sheet = dict(scene["cloth"][0])  # type: ignore[index]
    seam = {"pairs": [[61 * row, 61 * row + 60] for row in range(61)], "duration": 10.0}
    scene["cloth"] = [{**sheet, "seams": [seam]}]
    return scene


def blind() -> Table:
    """The drape as it would go through the ball: no contact at all."""
    scene = draped()
    del scene["contact"]
    return scene


def law(name: str, **values: float) -> Table:
    """The contact table's entry of a friction law."""
    return {"friction": {"law": name, **values}}


STRIBECK = law("stribeck", mu_c=0.3, mu_s=0.4, v_s=0.1, delta_s=1.0)


@dataclass
class Case:
    """An effect, the scene that prices it, and the scene without it where it has no row of its own."""

    effect: str
    scene: Callable[[], Table]
    where: str
    without: Callable[[], Table] | None = None
    once: bool = False
    """Whether it works before the first step alone."""


AUTO = {"self_collision": "auto", "ccd": "auto"}
LEAN = {"history": "auto"}
CASES = [
    Case("moving colliders", draped, "drape"),
    Case("pins", hanging, "hanging"),
    Case("baraff-witkin", hanging, "hanging"),
    Case("spring", lambda: hanging("bending-spring", "spring"), "hanging"),
    Case("bending-spring", lambda: hanging("bending-spring", "spring"), "hanging"),
    Case("hinge", lambda: hanging("independent"), "hanging"),
    Case("hinge coupling", hanging, "hanging", lambda: hanging("independent")),
    Case("nonlinear", lambda: hanging("nonlinear"), "hanging"),
    Case("plastic", lambda: hanging("plastic"), "hanging"),
    Case("hysteresis", lambda: hanging("hysteresis"), "hanging"),
    Case("elastic hinges", lambda: hanging("hysteresis", effects=LEAN), "hanging", lambda: hanging("hysteresis")),
    Case("stitches", sewn, "hanging"),
    Case("wind", hanging, "hanging"),
    Case("gravity", hanging, "hanging"),
    Case("air-damping", hanging, "hanging"),
    Case("integrator", hanging, "hanging"),
    Case("linear solver", hanging, "hanging"),
    Case("guard", hanging, "hanging"),
    Case("energy account", lambda: hanging(effects={"energy_account": True}), "hanging", hanging),
    Case("adaptive step", draped, "drape", lambda: draped(time={"dt": 0.005, "max_halvings": 0})),
    Case("error-controlled step", lambda: hanging(time={"dt": "auto"}), "hanging", hanging),
    Case("contact", draped, "drape"),
    Case("self-contact", draped, "drape", lambda: draped({"self": False})),
    Case("collider contact", lambda: draped({"self": False}), "drape", blind),
    Case("friction", draped, "drape", lambda: draped({"friction": 0.0, "self_friction": 0.0})),
    Case("friction coulomb", draped, "drape", lambda: draped({"friction": 0.0, "self_friction": 0.0})),
    Case("friction coulomb-stiction", lambda: draped(law("coulomb-stiction", mu_c=0.3, mu_s=0.4)), "drape", draped),
    Case(
        "friction viscous",
        lambda: draped(law("viscous", mu_c=0.3, mu_s=0.4, v_s=0.1, delta_s=1.0, f_v=1.0, delta_v=1.0)),
        "drape",
        draped,
    ),
    Case(
        "friction stribeck",
        lambda: draped(STRIBECK),
        "drape",
        draped,
    ),
    Case("contact constraints", lambda: draped({"method": "constraints"}), "drape"),
    Case("strain limit", lambda: draped(cloth={"strain_limit": 0.1}), "drape", draped),
    Case("untangled start", lambda: draped(start="untangle"), "drape", draped, once=True),
    Case("intersection count", lambda: draped({"allow_intersections": True}), "drape"),
    Case("flatness proofs", lambda: draped(effects={"self_collision": "auto"}), "drape", draped),
    Case("gap proofs", lambda: draped(effects={"ccd": "auto"}), "drape", draped),
    Case("both proofs", lambda: draped(effects=AUTO), "drape", draped),
    Case(
        "slow friction",
        lambda: draped(STRIBECK, effects={"friction": "auto"}),
        "drape",
        lambda: draped(STRIBECK),
    ),
    Case("sleep", lambda: draped(effects={"sleep": {}}), "drape", draped),
]


@dataclass
class Run:
    """What one run took per step."""

    step: float
    """Processor milliseconds of a step."""
    wall: float
    """Milliseconds of a step, to which the effects' add up."""
    build: float
    """Processor milliseconds before the first step."""
    effects: dict[str, float | None]
    bytes: dict[str, int]
    elements: dict[str, int]


@dataclass
class Price:
    """What an effect costs in a step."""

    effect: str
    where: str
    milliseconds: float
    share: float | None
    """None where it is not in a step."""
    bytes: int
    how: str
    elements: int = field(default=0)


def run(scene: Table, steps: int) -> Run:
    """Steps after the warm-up, on one thread of the CPU."""
    start = time.process_time()
    sim = cs.Simulation(cs.Scene(**scene), threads=1, device="cpu")
    build = 1e3 * (time.process_time() - start)
    for _ in range(WARM_UP):
        sim.step()

    def taken() -> tuple[float, dict[str, float | None]]:
        report = sim.report
        return report["totals"]["wall_seconds"], {e["name"]: e["milliseconds"] for e in report["effects"]}

    (wall, before) = taken()
    start = time.process_time()
    for _ in range(steps):
        sim.step()
    step = 1e3 * (time.process_time() - start) / steps
    (later, after) = taken()
    each = {n: None if ms is None else (ms - (before[n] or 0.0)) / steps for n, ms in after.items()}
    rows = sim.report["effects"]
    return Run(
        step,
        1e3 * (later - wall) / steps,
        build,
        each,
        {e["name"]: e["bytes"] for e in rows},
        {e["name"]: e["elements"] for e in rows},
    )


def measure(cases: list[Case], repeats: int, steps: int) -> dict[str, list[Run]]:
    """The runs of each scene that the cases name, by its JSON; all scenes in turns, with a word on the way."""
    scenes = [s() for case in cases for s in (case.scene, case.without) if s is not None]
    unique = {json.dumps(scene): scene for scene in scenes}
    runs: dict[str, list[Run]] = {key: [] for key in unique}
    for repeat in range(repeats):
        for k, (key, scene) in enumerate(unique.items(), 1):
            print(f"round {repeat + 1} of {repeats}, scene {k} of {len(unique)}", file=sys.stderr)
            runs[key].append(run(scene, steps))
    return runs


def price(case: Case, measured: dict[str, list[Run]]) -> Price:
    """The least of the repeats."""
    runs = measured[json.dumps(case.scene())]
    bare = [] if case.without is None else measured[json.dumps(case.without())]
    step = min(r.step for r in runs)
    first = runs[0]
    elements = first.elements.get(case.effect, 0)
    if case.without is None:
        own, share = min(((ms := r.effects[case.effect] or 0.0), ms / r.wall) for r in runs)
        return Price(case.effect, case.where, own, share, first.bytes[case.effect], "row", elements)
    more = sum(first.bytes.values()) - sum(bare[0].bytes.values())
    if case.once:
        built = min(r.build for r in runs) - min(r.build for r in bare)
        return Price(case.effect, case.where, built, None, more, "difference, once", elements)
    without = min(r.step for r in bare)
    return Price(case.effect, case.where, step - without, step / without - 1.0, more, "difference", elements)


def table(prices: list[Price]) -> str:
    """The prices as Markdown."""
    lines = ["| effect | scene | ms in a step | of the step | bytes | priced by |", "|---|---|---|---|---|---|"]
    lines += [
        f"| {p.effect} | {p.where} | {p.milliseconds:.3f} | {'–' if p.share is None else f'{100 * p.share:.1f} %'} "
        f"| {p.bytes:,} | {p.how} |"
        for p in prices
    ]
    return "\n".join(lines)


def machine() -> str:
    """The processor's name."""
    try:
        names = [
            line.split(":")[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def write(prices: list[Price], steps: int, repeats: int) -> None:
    """Put the table into the README and the time per element into the cost model."""
    done = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=ROOT, check=False
    )
    commit = done.stdout.strip() or "an unknown commit"
    model = {
        "machine": machine(),
        "commit": commit,
        "command": COMMAND,
        "nanoseconds": {
            p.effect: round(1e6 * max(p.milliseconds, 0.0) / p.elements, 2)
            for p in prices
            if p.how == "row" and p.elements
        },
    }
    MODEL.write_text(json.dumps(model, indent=2, sort_keys=True) + "\n")
    text = README.read_text()
    head, rest = text.split(BEGIN)
    tail = rest.split(END)[1]
    intro = (
        f"61 × 61 vertices, dt 5 ms, one thread of {machine()} ({os.cpu_count()} CPUs), "
        f"least of {repeats} runs of {steps} steps. A difference is relative to the step without the effect, and may "
        "be negative: without it, cloth moves otherwise. The laws of friction other than Coulomb's are priced against "
        'his; "once": before the first step.'
    )
    README.write_text(f"{head}{BEGIN}\n{intro}\n\n{table(prices)}\n{END}{tail}")


def main() -> None:
    """Print the table, and write it if asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--only", default="", help="effects whose name has this in it")
    parser.add_argument("--write", action="store_true", help="into README.md and the cost model")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    chosen = [case for case in CASES if options.only in case.effect]
    measured = measure(chosen, options.repeats, options.steps)
    prices = [price(case, measured) for case in chosen]
    print(json.dumps([vars(p) for p in prices], indent=2) if options.json else table(prices))
    if options.write:
        if len(chosen) < len(CASES):
            raise SystemExit("--write: expected all effects, got --only")
        write(prices, options.steps, options.repeats)


if __name__ == "__main__":
    main()
