"""The pictures of the effects: ``python tools/pages/pictures.py [NAME …]`` writes docs/images/effects/NAME.png.

Each is a small scene or a law alone, with and without the effect. A minute for all on an idle machine.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from drawing import BLUE, COLOURS, FOLDER, GREEN, GREY, OCHRE, RED, alone, finish, plot, run, tiles

import clothsim as cs

Table = dict[str, Any]
PICTURES: dict[str, Callable[[], bytes]] = {}

COTTON: Table = {
    "areal_density": 0.15,
    "in_plane": {"model": "baraff-witkin", "warp": 260.0, "weft": 260.0, "shear": 40.0, "damping": 0.002},
    "bending": {"model": "hinge", "rigidity": 1e-5, "damping": 0.002},
}
UPRIGHT = {"axis": [1, 0, 0], "angle": np.pi / 2}


def picture(draw: Callable[[], bytes]) -> Callable[[], bytes]:
    """Put a function into the list under its name."""
    PICTURES[draw.__name__.replace("_", "-")] = draw
    return draw


def grid(size: float = 0.6, count: int = 25, *, depth: float | None = None, rows: int | None = None) -> Table:
    return {"generator": "grid", "width": size, "height": depth or size, "nx": count, "ny": rows or count}


def hung(material: Table | str, **more: Any) -> Table:
    """A sheet that hangs from two corners."""
    cloth = {
        "name": "sheet",
        "mesh": grid(),
        "material": material,
        "rotation": UPRIGHT,
        "pins": [{"vertices": [0, 24]}],
    }
    return {"duration": 5.0, "time": {"dt": 0.005}, "air": {"damping": 1.0}, "cloth": [{**cloth, **more}]}


def ball(**contact: Any) -> Table:
    """A napkin over a ball."""
    cloth = {"name": "napkin", "mesh": grid(0.9, 41), "material": "cotton", "position": [0.01, 0.27, 0.02]}
    shape = {"type": "sphere", "radius": 0.25, "tolerance": 1e-3}
    return {
        "duration": 5.0, "time": {"dt": 0.005}, "air": {"damping": 0.5},
        "contact": {"thickness": 0.004, **contact}, "cloth": [cloth], "collider": [{"name": "ball", "shape": shape}],
    }  # fmt: skip


def stepped(scene: Table, seconds: float) -> list[Table]:
    """The reports of the steps of a run."""
    sim = cs.Simulation(cs.Scene(**scene), device="cpu")
    sim.advance(seconds)
    return list(sim.report["steps"])


@picture
def baraff_witkin() -> bytes:
    figure, axes = plot(2)
    for name, colour in zip(("cotton-jersey", "polyester", "cotton", "denim"), COLOURS, strict=False):
        fabric = cs.materials.fabric(name)
        strain = np.linspace(0.0, 0.05, 50)
        axes[0].plot(100 * strain, fabric.tensile_warp.value * strain, color=colour, label=name)
        angle = np.radians(np.linspace(0.0, 8.0, 50))
        axes[1].plot(np.degrees(angle), fabric.shear.value * np.sin(angle) * np.cos(angle), color=colour)
    axes[0].set(title="stretched along the warp", xlabel="strain [%]", ylabel="force per width [N/m]")
    axes[1].set(title="sheared", xlabel="shear angle [°]")
    return finish(figure)


@picture
def spring() -> bytes:
    springs = {**COTTON, "in_plane": {"model": "spring", "stiffness": 20.0, "damping": 0.02}}
    shown = [(name, run(hung(material), 2.0), -1) for name, material in
             (("baraff-witkin: cotton", COTTON), ("spring: 20 N/m an edge", springs))]  # fmt: skip
    return tiles(shown)


@picture
def hinge() -> bytes:
    figure, axis = plot()
    for label, rigidity, colour in (("B = 1e-5 N m", 1e-5, OCHRE), ("1e-4", 1e-4, BLUE), ("1e-3", 1e-3, RED)):
        bending = {"model": "hinge", "rigidity": rigidity} if rigidity else {"model": "none"}
        sheet = {
            "name": "strip", "mesh": grid(0.24, 25, depth=0.04, rows=5), "material": {**COTTON, "bending": bending},
            "position": [0.08, 0.0, 0.0], "pins": [{"box": {"min": [-0.1, -1, -1], "max": [0.0001, 1, 1]}}],
        }  # fmt: skip
        x = run({"duration": 9, "time": {"dt": 0.005}, "air": {"damping": 4.0}, "cloth": [sheet]}, 3.0, 1.0)
        line = x.positions("strip", -1).reshape(5, 25, 3)[2]
        axis.plot(100 * line[:, 0], 100 * line[:, 1], color=colour, label=label)
    axis.set(title="a strip of 20 cm, clamped at 0", xlabel="[cm]", ylabel="[cm]", aspect="equal")
    return finish(figure)


@picture
def hinge_coupling() -> bytes:
    figure, axis = plot()
    names = ("union jack", "equilateral", "edges along", "one diagonal")
    place = np.arange(4)
    axis.bar(place - 0.2, (1.000, 1.000, 1.005, 1.000), 0.38, color=BLUE, label="coupled")
    axis.bar(place + 0.2, (0.824, 0.935, 0.917, 0.826), 0.38, color=OCHRE, label="independent")
    axis.axhline(1.0, color=GREY, linewidth=1)
    axis.set_xticks(place, names, fontsize=8)
    axis.set(title="rigidity of a strip, 40 × 8 cells", ylabel="measured over B", ylim=(0.6, 1.15))
    return finish(figure)


def _loop(law: str, **keys: float) -> Any:
    path = np.concatenate([np.linspace(a, b, 200) for a, b in ((0, 150), (150, -150), (-150, 150), (150, 0))])
    return path, cs.bending.trace(path, law, **keys)


CURVE = {"rigidity": 1.16e-5, "coercive_couple": 1.22e-3, "transition_curvature": 50.0}


def _law(law: str, **keys: float) -> bytes:
    figure, axis = plot()
    straight = np.array([-150.0, 150.0])
    axis.plot(straight, 1e3 * 1.16e-5 * straight, color=GREY, linewidth=1, label="linear")
    path, traced = _loop(law, **keys)
    axis.plot(path, 1e3 * traced.moment, color=RED, linewidth=1.6, label=law)
    axis.set(title="cotton broadcloth, bent there and back", xlabel="curvature [1/m]", ylabel="moment per width [mN]")
    return finish(figure)


@picture
def nonlinear() -> bytes:
    return _law("nonlinear", **CURVE)


@picture
def plastic() -> bytes:
    return _law("plastic", rigidity=1.16e-5, elastic_limit=60.0, hardening=4e-6)


@picture
def hysteresis() -> bytes:
    return _law("hysteresis", **CURVE, plasticity=0.2, fatigue=0.2)


@picture
def bending_spring() -> bytes:
    figure, axis = plot()
    for count, colour in ((9, OCHRE), (17, BLUE), (33, RED)):
        strip = {
            "name": "strip", "mesh": grid(0.2, count, depth=0.05, rows=count // 4 + 1),
            "material": {**COTTON, "bending": {"model": "bending-spring", "stiffness": 0.5, "damping": 0.001}},
            "pins": [{"box": {"min": [-1, -1, -1], "max": [-0.0745, 1, 1]}}],
        }  # fmt: skip
        x = run({"duration": 9, "time": {"dt": 0.005}, "air": {"damping": 4.0}, "cloth": [strip]}, 3.0, 1.0)
        line = x.positions("strip", -1).reshape(count // 4 + 1, count, 3)[count // 8]
        axis.plot(100 * line[:, 0], 100 * line[:, 1], color=colour, label=f"{count} vertices along")
    axis.set(title="the same stiffness on three meshes", xlabel="[cm]", ylabel="[cm]", aspect="equal")
    return finish(figure)


@picture
def gravity() -> bytes:
    figure, axis = plot()
    times = np.linspace(0.0, 2.0, 21)
    for damping, colour in ((0.0, RED), (1.0, BLUE), (4.0, GREEN)):
        cloth = {"name": "sheet", "mesh": grid(0.2, 5), "material": COTTON}
        frames = run({"duration": 9, "time": {"dt": 0.005}, "air": {"damping": damping}, "cloth": [cloth]}, 2.0, 10.0)
        speed = np.gradient([frames.positions("sheet", k)[:, 1].mean() for k in range(len(frames))], frames.times)
        exact = -9.81 * times if damping == 0 else -9.81 / damping * (1 - np.exp(-damping * times))
        axis.plot(times, -exact, color=colour, label=f"air.damping = {damping:g} /s")
        axis.plot(frames.times[1:-1], -speed[1:-1], "o", color=colour, markersize=3)
    axis.set(title="speed of a falling sheet: closed form, run", xlabel="time [s]", ylabel="[m/s]")
    return finish(figure)


@picture
def wind() -> bytes:
    scene = cs.Scene.load(FOLDER.parents[2] / "examples" / "flag.toml")
    flying = run(scene, 1.5)
    keys = scene.to_dict()
    keys["air"]["wind"] = [0.0, 0.0, 0.0]
    return tiles([("no wind", run(keys, 1.5), -1), ("8 m/s", flying, -1)])


@picture
def pins() -> bytes:
    turned = [{"time": 0.0}, {"time": 1.0, "rotation": {"axis": [0, 1, 0], "angle": 3.0}}]
    cloth = {
        "name": "sheet", "mesh": grid(0.5, 25), "material": "cotton", "rotation": UPRIGHT,
        "pins": [{"box": {"min": [-1, 0.249, -1], "max": [1, 1, 1]}, "keyframes": turned}],
    }  # fmt: skip
    contact = {"thickness": 0.004}
    frames = run({"duration": 5, "time": {"dt": 0.005}, "contact": contact, "cloth": [cloth]}, 1.2)
    return tiles([("held along one edge", frames, 0), ("that edge is turned", frames, 18), ("by 3 rad", frames, -1)])


@picture
def stitches() -> bytes:
    n, size = 17, 0.3
    panel = cs.Mesh.grid(size, size, n, n)
    halves = [panel.vertices + [0, 0, z] for z in (-0.17, 0.17)]
    mesh = cs.Mesh(np.concatenate(halves), np.concatenate([panel.triangles, panel.triangles + n * n]))
    scene = cs.Scene(duration=5.0, time={"dt": 0.005}, contact={"thickness": 0.003}, air={"damping": 1.0})
    near, far = n * (n - 1), n * n
    seam = {"pairs": [[near + k, far + k] for k in range(n)], "duration": 0.4}
    if np.ptp(mesh.vertices[[near, far], 2]) > 0.2:  # rows run the other way
        seam["pairs"] = [[k, far + near + k] for k in range(n)]
    pins = [{"box": {"min": [-1, -1, -1], "max": [1, 1, -0.319]}}, {"box": {"min": [-1, -1, 0.319], "max": [1, 1, 1]}}]
    scene.add_cloth(mesh, "cotton", name="panels", seams=[seam], pins=pins)
    frames = run(scene, 1.0)
    return tiles([("two panels", frames, 0), ("the seam closes", frames, 8), ("closed", frames, -1)])


@picture
def moving_colliders() -> bytes:
    scene = ball(friction=0.5)
    scene["collider"][0]["keyframes"] = [
        {"time": 0.6}, {"time": 1.8, "rotation": {"axis": [0, 1, 0], "angle": 7.0}},
    ]  # fmt: skip
    frames = run(scene, 1.8)
    return tiles([("dropped", frames, 8), ("draped", frames, 18), ("turned by the ball", frames, -1)])


@picture
def integrator() -> bytes:
    figure, axis = plot()
    strip = {
        "name": "strip",
        "mesh": grid(0.24, 25, depth=0.04, rows=5),
        "material": {
            "areal_density": 0.15,
            "in_plane": {"model": "baraff-witkin", "warp": 100.0, "weft": 100.0, "shear": 30.0},
            "bending": {"model": "hinge", "rigidity": 1e-4},
        },
        "pins": [{"box": {"min": [-1, -1, -1], "max": [-0.099, 1, 1]}}],
    }
    steps = {"explicit-euler": 1e-4, "implicit-euler": 5e-3, "midpoint": 1e-4, "rk4": 2e-4}
    for (name, dt), colour in zip(steps.items(), COLOURS, strict=False):
        scene = {"duration": 5, "time": {"dt": dt, "integrator": name}, "cloth": [strip]}
        sim = cs.Simulation(cs.Scene(**scene), device="cpu")
        start = sim.energy["total"]
        times, changes, most = [0.0], [0.0], 1e-9
        with contextlib.suppress(cs.ClothSimError):
            for _ in range(60):
                sim.advance(0.01)
                most = max(most, sim.energy["kinetic"])
                times.append(sim.time)
                changes.append(100 * (sim.energy["total"] - start) / most)
        axis.plot(times, changes, color=colour, label=f"{name}, {1e3 * dt:g} ms")
    axis.set(title="a strip swings", xlabel="time [s]", ylabel="energy gained [% of motion]", ylim=(-60, 40))
    return finish(figure)


@picture
def linear_solver() -> bytes:
    figure, axis = plot()
    counts = (11, 21, 41, 61)
    for method, colour in (("pcg-jacobi", OCHRE), ("pcg", BLUE)):
        iterations = []
        for count in counts:
            scene = hung(COTTON, mesh=grid(0.6, count), pins=[{"vertices": [0, count - 1]}])
            scene["solver"] = {"method": method}
            steps = stepped(scene, 0.1)
            iterations.append(np.mean([step["linear_iterations"] for step in steps]))
        axis.plot(counts, iterations, "o-", color=colour, label=method)
    axis.set(
        title="hanging sheet, dt 5 ms, residual 1e-4", xlabel="vertices along", ylabel="iterations in a step", ylim=0
    )
    return finish(figure)


@picture
def adaptive_step() -> bytes:
    figure, axis = plot()
    for dt, label, colour in ((0.02, "dt = 0.02", OCHRE), ("auto", 'dt = "auto"', RED)):
        scene = {**ball(friction=0.3), "time": {"dt": dt}}
        scene["cloth"][0] |= {"mesh": grid(0.9, 17), "position": [0.01, 0.5, 0.02]}
        time, size = 0.0, []
        for step in stepped(scene, 0.6):
            size.append((time, 1e3 * step["smallest_dt"] if dt != "auto" else 1e3 * step["dt"]))
            time += step["dt"]
        axis.plot(*np.transpose(size), drawstyle="steps-post", color=colour, label=label)
    axis.set(title="a napkin falls on a ball", xlabel="time [s]", ylabel="step [ms]", yscale="log")
    return finish(figure)


@picture
def contact() -> bytes:
    without = ball()
    without.pop("contact")
    shown = [("without [contact]", alone(run(without, 0.28), -1), 0)]
    return tiles([*shown, ("with it", alone(run(ball(friction=0.3), 1.6), -1), 0)])


@picture
def self_contact() -> bytes:
    ribbon = {
        "name": "ribbon",
        "mesh": grid(0.6, 61, depth=0.04, rows=5),
        "material": "cotton",
        "rotation": {"axis": [0, 0, 1], "angle": np.pi / 2},
        "position": [0.0, 0.35, 0.0],
    }
    floor = {"name": "floor", "shape": {"type": "plane", "half_size": 3.0}}
    shown = []
    for label, meets in (("self = false", False), ("self = true", True)):
        scene = {
            "duration": 5.0,
            "time": {"dt": 0.004},
            "contact": {"thickness": 0.004, "self": meets},
            "air": {"damping": 0.5},
            "cloth": [ribbon],
            "collider": [floor],
        }
        shown.append((label, alone(run(scene, 1.2), -1), 0))
    return tiles(shown)


@picture
def contact_constraints() -> bytes:
    figure, axis = plot()
    stiff = {**COTTON, "in_plane": {"model": "baraff-witkin", "warp": 3e4, "weft": 3e4, "shear": 3e4}}
    for method, colour in (("velocity-filter", OCHRE), ("constraints", BLUE)):
        scene = ball(method=method, friction=0.3)
        scene["cloth"][0] |= {"mesh": grid(0.9, 25), "material": stiff}
        sim = cs.Simulation(cs.Scene(**scene), device="cpu")
        times, energies = [], []
        for _ in range(60):
            sim.advance(1 / 60)
            times.append(sim.time)
            energies.append(sim.energy["kinetic"])
        axis.plot(times, energies, color=colour, label=method)
    axis.set(title="stiff cloth (3e4 N/m) on a ball", xlabel="time [s]", ylabel="kinetic energy [J]", yscale="log")
    return finish(figure)


@picture
def friction() -> bytes:
    shown = [(f"friction = {mu}", alone(run(ball(friction=mu), 1.0), -1), 0) for mu in (0.0, 0.15, 0.6)]
    return tiles(shown)


@picture
def strain_limit() -> bytes:
    heavy = {
        **COTTON,
        "areal_density": 0.3,
        "in_plane": {**COTTON["in_plane"], "warp": 30.0, "weft": 30.0, "shear": 8.0},
    }
    shown = [(label, run({**hung(heavy, **more), "time": {"dt": 0.001}}, 1.5), -1)
             for label, more in (("without", {}), ("strain_limit = 0.1", {"strain_limit": 0.1}))]  # fmt: skip
    return tiles(shown)


@picture
def untangled_start() -> bytes:
    scene = ball(friction=0.3)
    scene["cloth"][0]["position"] = [0.0, 0.235, 0.0]
    begun = cs.Simulation(cs.Scene(**{**scene, "start": "untangle"}), device="cpu")
    given = cs.Simulation(cs.Scene(**scene), device="cpu", allow_intersections=True)
    moved = np.linalg.norm(begun.positions - given.positions, axis=1).reshape(41, 41)
    figure, axis = plot()
    image = axis.imshow(1e3 * moved, cmap="YlOrRd", origin="lower", extent=(-45, 45, -45, 45))
    bar = figure.colorbar(image, ax=axis, label="moved by [mm]")
    bar.ax.tick_params(labelsize=8)
    count = len(given.intersections())
    axis.grid(visible=False)
    axis.set(title=f"{count} pairs intersect; repaired: {len(begun.intersections())}", xlabel="[cm]", ylabel="[cm]")
    return finish(figure)


@picture
def intersection_count() -> bytes:
    scene = ball(friction=0.3, allow_intersections=True)
    scene["cloth"][0]["position"] = [0.0, 0.235, 0.0]
    sim = cs.Simulation(cs.Scene(**scene), device="cpu")
    times, counts = [0.0], [len(sim.intersections())]
    for _ in range(12):
        sim.advance(1 / 60)
        times.append(sim.time)
        counts.append(len(sim.intersections()))
    figure, axis = plot()
    axis.plot(times, counts, color=RED)
    axis.set(title="a start 15 mm inside a ball", xlabel="time [s]", ylabel="pairs that intersect", ylim=0)
    return finish(figure)


@picture
def proofs() -> bytes:
    figure, axes = plot(2)
    scene = {**ball(friction=0.5), "effects": {"self_collision": "auto", "ccd": "auto"}}
    steps = stepped(scene, 1.5)
    time = np.cumsum([step["dt"] for step in steps])
    axes[0].plot(time, [step["contact"]["flat_triangles"] for step in steps], color=BLUE)
    axes[0].set(title="triangles proved flat, of 3,200", xlabel="time [s]", ylim=(0, 3300))
    axes[1].plot(time, [step["contact"]["looked_at"] for step in steps], color=GREEN)
    axes[1].set(title="vertices that detection looked at", xlabel="time [s]", ylim=0)
    return finish(figure)


@picture
def sleep() -> bytes:
    tilted = {"axis": [1, 0, 0.3], "angle": 0.15}
    sheet = {"name": "sheet", "mesh": grid(0.3, 17), "material": "denim", "position": [0, 0.06, 0], "rotation": tilted}
    floor = {"name": "floor", "shape": {"type": "plane", "half_size": 1.0}}
    scene = {
        "duration": 5.0,
        "time": {"dt": 0.005},
        "air": {"damping": 1.0},
        "contact": {"thickness": 0.004},
        "effects": {"sleep": {"speed": 5e-3, "time": 0.25}},
        "cloth": [sheet],
        "collider": [floor],
    }
    sim = cs.Simulation(cs.Scene(**scene), device="cpu")
    figure, axis = plot()
    times, speeds, asleep = [], [], []
    for _ in range(100):
        sim.advance(0.02)
        times.append(sim.time)
        speeds.append(np.linalg.norm(sim.velocities, axis=1).max())
        asleep.append(sim.report["steps"][-1]["asleep"])
    axis.semilogy(times, np.maximum(speeds, 1e-5), color=BLUE)
    axis.fill_between(times, 1e-5, 10.0, where=np.array(asleep) > 0, color=GREEN, alpha=0.15, label="asleep")
    axis.axhline(5e-3, color=GREY, linewidth=1)
    axis.set(title="fastest vertex of a sheet that lands", xlabel="time [s]", ylabel="[m/s]", ylim=(1e-5, 10))
    return finish(figure)


@picture
def slow_friction() -> bytes:
    figure, axis = plot()
    speed = np.geomspace(1e-7, 1.0, 300)
    law = {"mu_c": 0.1, "mu_s": 0.2, "v_s": 0.4, "delta_s": 0.2}
    for delta, colour in ((0.2, RED), (1.0, OCHRE), (2.0, BLUE)):
        keys = {**law, "delta_s": delta}
        force = -cs.friction.force("stribeck", 1.0, speed[:, None], **keys)[:, 0]
        axis.semilogx(speed, 100 * (1 - force / 0.2), color=colour, label=f"delta_s = {delta:g}")
    axis.axhline(1.0, color=GREY, linewidth=1)
    axis.set(title="what Coulomb's law with μ_s misses", xlabel="speed [m/s]", ylabel="[%]", ylim=(0, 20))
    return finish(figure)


@picture
def elastic_hinges() -> bytes:
    figure, axis = plot()
    b1, b2, c1 = 2.0, 1.0, -0.5
    k0 = 0.5 * (b1 - b2) / -c1
    m0 = 0.5 * (b1 - b2) * k0
    chance = np.random.default_rng(1)
    shares = np.linspace(0.02, 0.5, 13)
    worst = []
    for share in shares:
        most = 0.0
        for _ in range(60):
            middle, reach = share * k0 * chance.uniform(-1, 1), share * k0 * chance.uniform(0, 1)
            path = np.clip(middle + reach * chance.uniform(-1, 1, 300), -share * k0, share * k0)
            moment = cs.bending.trace(path, model="hysteresis", b1=b1, b2=b2, c1=c1).moment
            most = max(most, np.abs(moment - (b1 * path + c1 * path * np.abs(path))).max())
        worst.append(100 * most / m0)
    axis.plot(100 * shares, 100 * 2 * shares / (2 + shares), color=GREY, linewidth=1, label="the bound")
    axis.plot(100 * shares, worst, "o", color=RED, label="worst of 60 random paths")
    axis.set(title="what a path does to the moment", xlabel="largest curvature [% of $K_0$]", ylabel="[% of $M_0$]")
    axis.set(xlim=0, ylim=0)
    return finish(figure)


@picture
def energy_account() -> bytes:
    keys = [{"time": 0.0}, {"time": 0.5, "position": [0, 0.5, 0]}]
    sheet = {"name": "flag", "mesh": grid(0.4, 15), "material": "cotton", "rotation": {"axis": [1, 0, 0], "angle": 1.2}}
    scene = {
        "duration": 2.0,
        "time": {"dt": 0.002},
        "air": {"wind": [0.0, 0.0, 4.0], "density": 1.2, "drag": 1.0, "lift": 0.5},
        "effects": {"energy_account": True},
        "cloth": [{**sheet, "pins": [{"vertices": [0, 14], "keyframes": keys}]}],
    }
    sim = cs.Simulation(cs.Scene(**scene), device="cpu")
    start = sim.energy["total"]
    sim.advance(1.0)
    steps = sim.report["steps"]
    time = [step["time"] for step in steps]
    pins, air = (np.cumsum([step["energy"][kind] for step in steps]) for kind in ("pins", "air"))
    total = np.array([step["energy"]["total"] for step in steps]) - start
    figure, axis = plot()
    axis.plot(time, pins, color=BLUE, label="work of pins")
    axis.plot(time, air, color=GREEN, label="work of air")
    axis.plot(time, total, color=RED, label="energy gained")
    axis.plot(time, pins + air - total, color=GREY, linewidth=1, label="dissipated")
    axis.set(title="a flag is lifted by 0.5 m in wind", xlabel="time [s]", ylabel="[J]")
    return finish(figure)


def main(names: list[str]) -> None:
    """Draw the pictures of these names, or all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or PICTURES:
        path = FOLDER / f"{name}.png"
        path.write_bytes(PICTURES[name]())
        print(f"{path.relative_to(FOLDER.parents[2])}: {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
