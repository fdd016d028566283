"""Effects that are left out where they cannot matter, against everything on: the same result, and the time
saved.

Usage: ``python benches/auto_against_on.py [--json] [--steps 150] [--cloths 16]``. Four parts:

- ``effects.self_collision`` and ``effects.ccd`` = "auto" against "on" in four scenes. Both are stepped in
  turns, one step each, and must have the same bits after every step. Processor milliseconds of a step on one
  thread.
- ``effects.friction`` = "auto" against "on" with laws of several coefficients, on a slope where cloth sticks, creeps
  and slides. What it may change is stated: friction per mass is wrong by at most ``friction_tolerance`` μ_s g, against
  a drag c per mass over the time t, so positions by at most ``friction_tolerance`` μ_s g t/c, and by 2e-6 m/s t as
  contacts settle to 1e-6 m/s.
- ``effects.history`` = "auto" against "on", with strips that are clamped at one end and bend under their
  weight. With the plastic law no vertex may differ. With hysteresis the moment per width of a hinge is off by at
  most ``history_tolerance`` M_0 on the same path of curvatures. At rest, where moments balance the weight, such an
  error is one of at most ``history_tolerance`` M_0/b_2 in the curvature, as no slope is less than b_2, and of
  ``history_tolerance`` M_0/b_2 L²/2 at the end of a strip of length L: that is allowed.
- ``effects.sleep`` against none: napkins that have come to rest on a floor, alone and beside one that is
  awake. What sleep may change is stated: a sleeping vertex misses what it would have crept, at most ``speed``
  times the time asleep.

Exits 1 if a bit differs, or if friction, history or sleep moves a vertex farther than stated.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

import numpy as np

import clothsim as cs

MATERIAL = {
    "areal_density": 0.2,
    "in_plane": {"model": "baraff-witkin", "warp": 200.0, "weft": 200.0, "shear": 20.0, "damping": 0.002},
    "bending": {"model": "hinge", "rigidity": 1e-5, "damping": 0.002},
}
AUTO = {"self_collision": "auto", "ccd": "auto"}
SLEEP = {"speed": 5e-3, "time": 0.1}
FLOOR = {"name": "floor", "shape": {"type": "plane", "half_size": 4.0}}
CONTACT = {"thickness": 0.005, "friction": 0.4}
STRIBECK = {"law": "stribeck", "mu_c": 0.1, "mu_s": 0.3, "v_s": 0.5, "delta_s": 1.0}
VISCOUS = {**STRIBECK, "law": "viscous", "f_v": 5.0, "delta_v": 1.0}
FRICTION_TOLERANCE = 0.02
HISTORY_TOLERANCE = 0.02
PLASTIC = {"model": "plastic", "rigidity": 4e-5, "elastic_limit": 20.0, "hardening": 1e-5, "damping": 0.05}
HYSTERESIS = {"model": "hysteresis", "b1": 4e-5, "b2": 2e-5, "c1": -2e-7, "plasticity": 0.2, "damping": 0.05}
DRAG = 60.0


def sheet(name: str, size: float, n: int, **more: Any) -> dict[str, Any]:
    """A square piece of cloth."""
    mesh = {"generator": "grid", "width": size, "height": size, "nx": n, "ny": n}
    return {"name": name, "mesh": mesh, "material": MATERIAL, **more}


def scenes() -> dict[str, dict[str, Any]]:
    """Scenes from much to nothing that can be left out."""
    ball = {"name": "ball", "shape": {"type": "sphere", "radius": 0.25, "tolerance": 2e-3}}
    turn = {"keyframes": [{"time": 0.5}, {"time": 1.0, "rotation": {"axis": [0, 1, 0], "angle": 1.0}}]}
    tilt = {"axis": [1.0, 0.1, 0.05], "angle": 1.5}
    return {
        "curtain in light wind": {
            "air": {"wind": [0.0, 0.0, 1.0], "density": 1.2, "drag": 1.0},
            "cloth": [
                sheet(
                    "curtain", 1.0, 61, rotation={"axis": [1, 0, 0], "angle": 1.5}, pins=[{"vertices": list(range(61))}]
                )
            ],
            "collider": [{**FLOOR, "position": [0.0, -1.2, 0.0]}],
        },
        "napkins at rest": {
            "air": {"damping": 5.0},
            "cloth": [sheet(f"napkin {k}", 0.3, 21, position=[0.4 * k - 0.6, 0.006, 0.0]) for k in range(4)],
            "collider": [FLOOR],
        },
        "drape on a ball": {
            "cloth": [sheet("cloth", 1.0, 61, position=[0.01, 0.2537, 0.005])],
            "collider": [{**ball, **turn}],
        },
        "crumpling sheet": {
            "cloth": [sheet("cloth", 0.5, 41, rotation=tilt, position=[0.0, 0.3, 0.0])],
            "collider": [FLOOR],
        },
    }


def build(parts: dict[str, Any], effects: dict[str, Any] | None = None) -> cs.Simulation:
    """The simulation of a scene on one thread."""
    more = {"effects": effects} if effects else {}
    contact = {"contact": CONTACT} if "collider" in parts else {}
    scene = cs.Scene(duration=10.0, time={"dt": 0.005}, **{**contact, **parts}, **more)
    return cs.Simulation(scene, threads=1, device="cpu")


def step(sim: cs.Simulation) -> float:
    """Take a step: processor milliseconds."""
    start = time.process_time()
    sim.step()
    return 1e3 * (time.process_time() - start)


def proofs(steps: int) -> list[dict[str, Any]]:
    """Auto against on, scene by scene."""
    rows = []
    for name, parts in scenes().items():
        print(f"{name}: {steps} steps of two", file=sys.stderr)
        on, auto = build(parts), build(parts, AUTO)
        taken, same = [0.0, 0.0], True
        for _ in range(steps):
            taken[0] += step(on)
            taken[1] += step(auto)
            same &= on.positions.tobytes() == auto.positions.tobytes()
            same &= on.velocities.tobytes() == auto.velocities.tobytes()
        seen = [s["contact"] for s in auto.report["steps"]]
        # Each part of a step that is taken in parts counts its triangles.
        substeps = [s["substeps"] for s in auto.report["steps"]]
        triangles = sum(len(b.triangles) for b in auto.bodies if b.kind == "cloth")
        rows.append(
            {
                "scene": name,
                "same_bits": bool(same),
                "step_on_ms": taken[0] / steps,
                "step_auto_ms": taken[1] / steps,
                "flat": sum(c["flat_triangles"] for c in seen) / (triangles * sum(substeps)),
                "detections_left_out": float(np.mean([c["looked_at"] == 0 for c in seen])),
            }
        )
    return rows


def slope(angle: float, law: dict[str, Any]) -> dict[str, Any]:
    """A sheet on a slope [rad], heavily damped."""
    turn = {"axis": [0, 0, 1], "angle": angle}
    place = [-0.0051 * float(np.sin(angle)), 0.0051 * float(np.cos(angle)), 0.0]
    return {
        "air": {"damping": DRAG},
        "contact": {**CONTACT, "friction": law},
        "cloth": [sheet("sheet", 0.5, 41, rotation=turn, position=place)],
        "collider": [{**FLOOR, "rotation": turn}],
    }


def frictions(steps: int) -> list[dict[str, Any]]:
    """Friction that leaves out terms of speed against the whole law."""
    rows = []
    for label, parts in {
        "slope of 0.2, stribeck: sticks": slope(0.2, STRIBECK),
        "slope of 0.2, viscous: sticks": slope(0.2, VISCOUS),
        "slope of 0.302, stribeck: creeps": slope(0.302, STRIBECK),
        "slope of 0.5, stribeck: slides": slope(0.5, STRIBECK),
    }.items():
        print(f"{label}: {steps} steps of two", file=sys.stderr)
        on, auto = build(parts), build(parts, {"friction": "auto", "friction_tolerance": FRICTION_TOLERANCE})
        taken = [0.0, 0.0]
        for _ in range(steps):
            taken[0] += step(on)
            taken[1] += step(auto)
        away = np.linalg.norm(on.positions - auto.positions, axis=1).max()
        allowed = 0.005 * steps * (FRICTION_TOLERANCE * STRIBECK["mu_s"] * 9.81 / DRAG + 2e-6)
        rows.append(
            {
                "scene": label,
                "slow": float(np.mean([s["contact"]["slow_friction"] > 0 for s in auto.report["steps"]])),
                "step_on_ms": taken[0] / steps,
                "step_auto_ms": taken[1] / steps,
                "farthest_mm": 1e3 * float(away),
                "allowed_mm": 1e3 * allowed,
            }
        )
    return rows


def strip(length: float, law: dict[str, Any]) -> dict[str, Any]:
    """A strip 3 cm wide, clamped at its left end [m]."""
    n = round(length / 0.005) + 5
    mesh = {"generator": "grid", "width": 0.005 * (n - 1), "height": 0.03, "nx": n, "ny": 7}
    clamp = {"vertices": [n * row + column for row in range(7) for column in range(5)]}
    cloth = {"name": "strip", "mesh": mesh, "material": {**MATERIAL, "bending": law}, "pins": [clamp]}
    return {"air": {"damping": 10.0}, "cloth": [cloth]}


def histories(steps: int) -> list[dict[str, Any]]:
    """Memory where it is needed against memory everywhere."""
    rows = []
    for label, length, law in [
        ("plastic, 4 cm", 0.04, PLASTIC),
        ("plastic, 15 cm", 0.15, PLASTIC),
        ("hysteresis, 1 cm", 0.01, HYSTERESIS),
        ("hysteresis, 4 cm", 0.04, HYSTERESIS),
        ("hysteresis, 15 cm", 0.15, HYSTERESIS),
    ]:
        print(f"{label}: {steps} steps of two", file=sys.stderr)
        parts = strip(length, law)
        on = build(parts)
        auto = build(parts, {"history": "auto", "history_tolerance": HISTORY_TOLERANCE})
        taken = [0.0, 0.0]
        for _ in range(steps):
            taken[0] += step(on)
            taken[1] += step(auto)
        away = np.linalg.norm(on.positions - auto.positions, axis=1).max()
        is_exact = law is PLASTIC
        slack = 0.0 if is_exact else HISTORY_TOLERANCE * (law["b1"] - law["b2"]) ** 2 / (-4.0 * law["c1"] * law["b2"])
        effects = {e["name"]: e for e in auto.report["effects"]}
        whole = {e["name"]: e for e in on.report["effects"]}[law["model"]]
        kept = effects["elastic hinges"]
        rows.append(
            {
                "scene": label,
                "remembering": auto.report["steps"][-1]["remembering"],
                "hinges": kept["elements"],
                "bytes_on": whole["bytes"] - effects[law["model"]]["bytes"],
                "bytes_auto": kept["bytes"],
                "step_on_ms": taken[0] / steps,
                "step_auto_ms": taken[1] / steps,
                "farthest_mm": 1e3 * float(away),
                "allowed_mm": 1e3 * slack * 0.5 * length**2,
            }
        )
    return rows


def napkins(count: int, *, with_swing: bool) -> dict[str, Any]:
    """Napkins on a floor, and on request one that swings above and stays awake."""
    side = int(np.ceil(np.sqrt(count)))
    place = [[0.4 * (k % side), 0.006, 0.4 * (k // side)] for k in range(count)]
    cloth = [sheet(f"napkin {k}", 0.3, 21, position=p) for k, p in enumerate(place)]
    if with_swing:
        key = [{"time": float(t), "position": [0.05 * (t % 2), 0.0, 0.0]} for t in range(10)]
        cloth.append(sheet("flag", 0.3, 21, position=[0.0, 1.0, 0.0], pins=[{"vertices": [0, 20], "keyframes": key}]))
    return {"air": {"damping": 5.0}, "cloth": cloth, "collider": [FLOOR]}


def sleeping(count: int, steps: int) -> list[dict[str, Any]]:
    """The cost of a step once the napkins rest, awake and asleep."""
    rows = []
    for label, parts in {
        f"{count} napkins": napkins(count, with_swing=False),
        f"{count} napkins and a flag awake": napkins(count, with_swing=True),
        "the flag alone": napkins(0, with_swing=True),
    }.items():
        print(f"{label}: until they rest, then {steps} steps of two", file=sys.stderr)
        awake, asleep = build(parts), build(parts, {"sleep": SLEEP})
        since = None
        for k in range(120):
            awake.step()
            asleep.step()
            if since is None and asleep.report["steps"][-1]["asleep"] > 0:
                since = k
        taken = [0.0, 0.0]
        for _ in range(steps):
            taken[0] += step(awake)
            taken[1] += step(asleep)
        still = slice(0, 21 * 21 * (count if count and "napkins" in label else 0))
        away = np.linalg.norm(awake.positions[still] - asleep.positions[still], axis=1)
        seconds = 0.0 if since is None else 0.005 * (120 + steps - since)
        rows.append(
            {
                "scene": label,
                "asleep": asleep.report["steps"][-1]["asleep"],
                "step_awake_ms": taken[0] / steps,
                "step_asleep_ms": taken[1] / steps,
                "farthest_mm": 1e3 * float(away.max()) if len(away) else 0.0,
                "allowed_mm": 1e3 * SLEEP["speed"] * seconds,
            }
        )
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--cloths", type=int, default=16)
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    first, friction, history = proofs(options.steps), frictions(options.steps), histories(4 * options.steps)
    second = sleeping(options.cloths, max(20, options.steps // 4))
    if options.json:
        print(json.dumps({"auto": first, "friction": friction, "history": history, "sleep": second}, indent=2))
    else:
        print("| scene | same bits | step on, auto [ms] | proved flat | CCD left out |\n|---|---|---|---|---|")
        for r in first:
            print(
                f"| {r['scene']} | {'yes' if r['same_bits'] else 'NO'} | "
                f"{r['step_on_ms']:.2f}, {r['step_auto_ms']:.2f} | "
                f"{100 * r['flat']:.0f} % of triangles | "
                f"{100 * r['detections_left_out']:.0f} % of steps |"
            )
        print("\n| scene | slow friction | step on, auto [ms] | farthest from on, allowed [mm] |\n|---|---|---|---|")
        for r in friction:
            print(
                f"| {r['scene']} | {100 * r['slow']:.0f} % of steps | "
                f"{r['step_on_ms']:.2f}, {r['step_auto_ms']:.2f} | {r['farthest_mm']:.4f}, {r['allowed_mm']:.4f} |"
            )
        print(
            "\n| strip | hinges that remember | bytes for it on, auto | step on, auto [ms] "
            "| farthest from on, allowed [mm] |\n|---|---|---|---|---|"
        )
        for r in history:
            print(
                f"| {r['scene']} | {r['remembering']} of {r['hinges']} | {r['bytes_on']:,}, {r['bytes_auto']:,} | "
                f"{r['step_on_ms']:.2f}, {r['step_auto_ms']:.2f} | {r['farthest_mm']:.4f}, {r['allowed_mm']:.4f} |"
            )
        print(
            "\n| scene | asleep | step awake, with sleep [ms] | farthest from awake, allowed [mm] |\n|---|---|---|---|"
        )
        for r in second:
            print(
                f"| {r['scene']} | {r['asleep']} | {r['step_awake_ms']:.2f}, {r['step_asleep_ms']:.3f} | "
                f"{r['farthest_mm']:.3f}, {r['allowed_mm']:.3f} |"
            )
    if not all(r["same_bits"] for r in first) or any(
        r["farthest_mm"] > r["allowed_mm"] for r in friction + history + second
    ):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
