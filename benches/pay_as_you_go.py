"""An effect that is off costs nothing: instructions of a step and bytes of the state, counted.

Usage: ``python benches/pay_as_you_go.py [--vertices 41] [--json]``. Builds
``crates/cloth-sim/examples/pay_as_you_go.rs`` and counts the instructions of a step under ``valgrind
--tool=callgrind`` on one thread, as the difference of a run of 12 steps and one of 4, so that the build is
not in it. Two questions:

- *minimal*: the whole engine on a scene that asks for nothing but springs, gravity and two held corners, against
  the integrator of cloth-core stepped by hand. What is always on is counted apart: the guard, and the integrator's
  test for turns so fast that they make energy;
- each effect named in the scene with the value that turns it off, every law of friction among them, against the
  scene that does not mention it: instructions within 0.5 %, and less than a byte per vertex more in use after the
  build (the scene's own text).

The plan of the bare scene says which effects are off: they are listed under the table, and none of them may hold a
byte. Counts do not depend on what else the machine does. Exits 1 if a row is beyond that.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIMIT = 0.005
"""Largest difference of instructions."""
STEPS = (4, 12)

SCENE = """
name = "sheet"
duration = 1.0
{top}
[time]
dt = 0.005
{tables}
[[cloth]]
name = "sheet"
mesh = {{ generator = "grid", width = 1.0, height = 1.0, nx = {n}, ny = {n} }}
pins = [{{ vertices = [0, {last}] }}]
{material}
{cloth}
"""
MATERIAL = 'material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 }%s }'
CONTACT = "[contact]\nthickness = 0.004\nfriction = %s\nself_friction = %s\n"
FLOOR = '[[collider]]\nname = "floor"\nshape = { type = "plane", half_size = 1.0 }\nposition = [0, -0.004, 0]\n'

# Name of the effect: what differs from the scene without it, by part of the scene.
WITHOUT_CONTACT = {
    "wind": {"tables": "[air]\nwind = [3.0, 0.0, 0.0]\ndensity = 0.0\ndrag = 1.0\nlift = 1.0\n"},
    "air drag and lift": {"tables": "[air]\nwind = [3.0, 0.0, 0.0]\ndensity = 1.2\ndrag = 0.0\nlift = 0.0\n"},
    "air-damping": {"tables": "[air]\ndamping = 0.0\n"},
    "bending-spring": {"bending": ', bending = { model = "bending-spring", stiffness = 0.0, damping = 0.0 }'},
    "hinge": {"bending": ', bending = { model = "hinge", rigidity = 0.0 }'},
    "bending none": {"bending": ', bending = { model = "none" }'},
    "flatness and gap proofs": {"tables": '[effects]\nself_collision = "on"\nccd = "on"\n'},
    "proofs without contact": {"tables": '[effects]\nself_collision = "auto"\nccd = "auto"\n'},
    "slow friction without contact": {"tables": '[effects]\nfriction = "auto"\n'},
    "elastic hinges": {"tables": '[effects]\nhistory = "on"\n'},
    "elastic hinges without memory": {"tables": '[effects]\nhistory = "auto"\n'},
    "energy account": {"tables": "[effects]\nenergy_account = false\n"},
    "hinge coupling": {"bending": ', bending = { model = "hinge", rigidity = 0.0, hinges = "coupled" }'},
    "stitches": {"cloth": "seams = []\n"},
    "regions": {"cloth": "regions = []\n"},
    "untangled start": {"top": 'start = "as-given"\n'},
}
WITH_CONTACT = {
    "flatness proofs": {"tables": '[effects]\nself_collision = "on"\n'},
    "gap proofs": {"tables": '[effects]\nccd = "on"\n'},
    "slow friction": {"tables": '[effects]\nfriction = "on"\n'},
    "constraints": {"contact": 'method = "velocity-filter"\n'},
    "intersection count": {"contact": "allow_intersections = false\n"},
    "friction of a pair": {
        "contact": '[[contact.pairs]]\nbetween = ["sheet", "floor"]\nfriction = { law = "coulomb", mu_c = 0.3 }\n'
    },
    "moving colliders": {"floor": "keyframes = []\n"},
    "repulsion": {"contact": "repulsion_stiffness = 0.0\n"},
}
LAWS = {
    "coulomb": "mu_c = 0.0",
    "coulomb-stiction": "mu_c = 0.0, mu_s = 0.0",
    "viscous": "mu_c = 0.0, mu_s = 0.0, v_s = 0.1, delta_s = 1.0, f_v = 0.0, delta_v = 1.0",
    "stribeck": "mu_c = 0.0, mu_s = 0.0, v_s = 0.1, delta_s = 1.0",
}
"""Coefficients with which a law of friction does nothing."""


def scene(n: int, parts: dict[str, str], contact: bool) -> str:
    """The scene's text with the parts of one effect."""
    friction = parts.get("friction", "0.3"), parts.get("friction", "0.2")
    tables = (CONTACT % friction + parts.get("contact", "") if contact else "") + parts.get("tables", "")
    return SCENE.format(
        n=n,
        last=n - 1,
        top=parts.get("top", ""),
        tables=tables,
        material=MATERIAL % parts.get("bending", ""),
        cloth=parts.get("cloth", "") + (FLOOR + parts.get("floor", "") if contact else ""),
    )


def count(arguments: list[str], binary: Path, only: str = "") -> tuple[int, int]:
    """Instructions of a step, of one function where it is named, and bytes in use after the build."""
    instructions, held = [], 0
    for steps in STEPS:
        with tempfile.TemporaryDirectory() as folder:
            command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out"]
            command += [f"--toggle-collect={only}"] if only else []
            command += [str(binary)]
            done = subprocess.run(
                [*command, arguments[0], str(steps), *arguments[1:]], capture_output=True, text=True, check=True
            )
        found = re.search(r"Collected : (\d+)", done.stderr)
        if found is None:
            raise SystemExit(f"callgrind printed no count: {done.stderr}")
        instructions.append(int(found[1]))
        held = int(done.stdout.split()[0])
    return (instructions[1] - instructions[0]) // (STEPS[1] - STEPS[0]), held


def build() -> Path:
    """The example's path."""
    command = ["cargo", "build", "--release", "--locked", "-p", "cloth-sim", "--example", "pay_as_you_go"]
    subprocess.run(command, check=True, cwd=ROOT)
    return ROOT / "target" / "release" / "examples" / "pay_as_you_go"


def rows(n: int, binary: Path) -> tuple[list[dict[str, object]], list[str]]:
    """One row per question, printed as it comes; and the effects that the bare scene's plan has off."""
    table: list[dict[str, object]] = []

    def add(effect: str, base: tuple[int, int], own: tuple[int, int], is_strict: bool) -> None:
        change = own[0] / base[0] - 1.0
        row = {"effect": effect, "instructions": own[0], "change": change, "bytes_more": own[1] - base[1]}
        table.append({**row, "fine": change <= LIMIT and (not is_strict or own[1] - base[1] < n * n)})
        print(f"{effect:32} {own[0]:12} {100 * change:+8.3f} % {own[1] - base[1]:+9} B", file=sys.stderr)

    with tempfile.TemporaryDirectory() as folder:

        def measure(parts: dict[str, str], contact: bool, only: str = "") -> tuple[int, int]:
            path = Path(folder) / "scene.toml"
            path.write_text(scene(n, parts, contact))
            return count([str(path)], binary, only)

        least = count(["minimal", str(n)], binary)
        base = measure({}, False)
        add("minimal engine", least, least, False)
        turns = least[0] - count(["linear", str(n)], binary)[0]
        guard = measure({}, False, "cloth_sim::guard::Guard::check*")[0]
        add("engine, all effects off", least, (base[0] - guard, base[1]), False)
        for name, own in (("the guard, always on", guard), ("the test for turns, always on", turns)):
            print(f"{name:32} {own:12}", file=sys.stderr)
            table.append({"effect": name, "instructions": own, "change": own / least[0], "bytes_more": 0, "fine": True})
        for name, parts in WITHOUT_CONTACT.items():
            add(name, base, measure(parts, False), True)
        base = measure({}, True)
        add("engine with contact", base, base, True)
        for name, parts in WITH_CONTACT.items():
            add(f"{name} (with contact)", base, measure(parts, True), True)
        base = measure({"friction": "0.0"}, True)
        add("engine with contact, no friction", base, base, True)
        for name, values in LAWS.items():
            parts = {"friction": f'{{ law = "{name}", {values} }}'}
            add(f"friction {name} of zero", base, measure(parts, True), True)
        path = Path(folder) / "scene.toml"
        path.write_text(scene(n, {}, False))
        plan = subprocess.run([str(binary), "plan", str(path)], capture_output=True, text=True, check=True)
    return table, plan.stdout.splitlines()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=41, help="vertices of a side of the sheet")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    table, off = rows(options.vertices, build())
    if options.json:
        print(json.dumps({"rows": table, "off": off}, indent=2))
    else:
        print("| effect, off | instructions of a step | against without | bytes more |\n|---|---|---|---|")
        for row in table:
            print(f"| {row['effect']} | {row['instructions']:,} | {100 * row['change']:+.3f} % | {row['bytes_more']} |")
        print(f"\nOff in the bare scene, with 0 bytes each: {', '.join(off)}.")
    if not all(row["fine"] for row in table):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
