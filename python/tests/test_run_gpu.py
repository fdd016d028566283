"""Whole simulations on a GPU: the frames of the CPU, and what is said and kept where a GPU is missing or fails."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import GPU_METHODS, SCENE, RunCli

import clothsim as cs
from clothsim import _core

# Thrown at the ball, 5 cm in a step: hundreds of collisions in the first frames.
FALLING = (
    SCENE.replace("nx = 17, ny = 17", "nx = 11, ny = 11")
    .replace("thickness = 0.006", "thickness = 0.002")
    .replace("position = [0.02, 0.42, 0.01]", "position = [0.02, 0.42, 0.01]\nvelocity = [0, -10, 0]")
)
FRAMES = 5


@pytest.fixture
def auto_takes_software() -> Iterator[None]:
    """Let the device "auto" take the software adapter that the tests run on."""
    _core.let_auto_take_software(True)
    yield
    _core.let_auto_take_software(False)


def falling(path: Path, detector: str = "auto") -> Path:
    path.write_text(FALLING.replace("[contact]", f'[contact]\ndetector = "{detector}"'))
    return path


def frames(sim: cs.Simulation, count: int = FRAMES) -> np.ndarray[Any, Any]:
    """Positions and velocities over so many frames, none of which has an intersection."""
    rows = []
    for frame in sim.run(count / 30, fps=30, progress=False):
        assert len(sim.intersections()) == 0
        rows.append(np.concatenate([frame.positions, frame.velocities]))
    return np.array(rows)


def test_frames_are_those_of_the_cpu(gpu: str, tmp_path: Path) -> None:
    cpu = cs.Simulation(cs.Scene.load(falling(tmp_path / "scene.toml", "bvh")), device="cpu")
    expected = frames(cpu)
    assert sum(step["contact"]["collisions"] for step in cpu.report["steps"]) > 50
    assert cpu.report["detection"]["detector"] == "bvh"
    for method in GPU_METHODS:
        sim = cs.Simulation(cs.Scene.load(falling(tmp_path / "scene.toml", method)), device="gpu")
        np.testing.assert_array_equal(frames(sim), expected)
        detection = sim.report["detection"]
        assert (detection["detector"], detection["device"]) == (method, gpu)
        assert detection["device_bytes"] > 0


def test_the_command_line_runs_on_the_gpu(gpu: str, tmp_path: Path, run_cli: RunCli) -> None:
    scene = falling(tmp_path / "scene.toml")
    arrays, reports = [], []
    for device in ("gpu", "cpu"):
        out = tmp_path / device
        done = run_cli("run", scene, "-o", out, "--device", device, "--frames", str(FRAMES), "--quiet")
        assert done.returncode == 0, done.stderr
        arrays.append(dict(np.load(out / "frames.npz")))
        reports.append(json.loads((out / "report.json").read_text()))
    assert arrays[0].keys() == arrays[1].keys()
    for name, array in arrays[0].items():
        np.testing.assert_array_equal(array, arrays[1][name])
    on_gpu, on_cpu = (report["detection"] for report in reports)
    assert (on_gpu["detector"], on_gpu["device"], on_gpu["why"]) == ("virtual-subdivision", gpu, 'device "gpu"')
    assert on_cpu["device"] == "cpu" and "measured" in on_cpu["why"]
    assert [report["fallbacks"] for report in reports] == [[], []]
    plan = run_cli("plan", scene, "--device", "gpu")
    assert f'detection: "virtual-subdivision" on {gpu} (device "gpu")' in plan.stdout
    assert json.loads(run_cli("plan", scene, "--device", "cpu", "--json").stdout)["detection"]["detector"] == "bvh"


def test_a_checkpoint_goes_on_on_another_device(gpu: str, tmp_path: Path) -> None:
    scene = cs.Scene.load(falling(tmp_path / "scene.toml"))
    expected = frames(cs.Simulation(scene, device="cpu"))
    for first, second in (("gpu", "cpu"), ("cpu", "gpu")):
        sim = cs.Simulation(scene, device=first)
        frames(sim, 3)
        sim.save_checkpoint(tmp_path / "checkpoint")
        resumed = cs.Simulation.resume(tmp_path / "checkpoint", device=second)
        assert (resumed.report["detection"]["device"] == "cpu") == (second == "cpu")
        np.testing.assert_array_equal(frames(resumed, FRAMES - 3)[1:], expected[4:])


def test_a_gpu_that_is_lost_is_an_error_that_keeps_the_state(gpu: str, tmp_path: Path) -> None:
    scene = cs.Scene.load(falling(tmp_path / "scene.toml"))
    sim = cs.Simulation(scene, device="gpu")
    frames(sim, 2)
    positions, steps = sim.positions, len(sim.report["steps"])
    assert _core.lose_gpu()
    with pytest.raises(cs.DeviceError, match='lost.*device "auto"') as caught:
        sim.advance(1 / 30)
    assert caught.value.device == gpu
    np.testing.assert_array_equal(sim.positions, positions)
    assert len(sim.report["steps"]) == steps
    sim.finish_advance()
    np.testing.assert_array_equal(sim.positions, frames(cs.Simulation(scene, device="cpu"), 3)[3][: len(positions)])


@pytest.mark.usefixtures("auto_takes_software")
def test_auto_goes_on_without_a_gpu_that_is_lost(gpu: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    scene = cs.Scene.load(falling(tmp_path / "scene.toml", "grid"))
    sim = cs.Simulation(scene, device="auto")
    assert sim.report["detection"]["device"] == gpu
    start = frames(sim, 3)
    done = len(sim.report["steps"])
    assert _core.lose_gpu()
    with caplog.at_level(logging.WARNING, "clothsim.simulation"):
        rest = frames(sim, FRAMES - 3)
    expected = frames(cs.Simulation(scene, device="gpu"))
    np.testing.assert_array_equal(np.concatenate([start, rest[1:]]), expected)
    [fallback] = sim.report["fallbacks"]
    assert (fallback["step"], fallback["detector"], fallback["device"]) == (done + 1, "grid", gpu)
    [record] = caplog.records
    assert f"on the CPU instead of a GPU since step {done + 1}: {gpu}: " in record.getMessage()
    assert sim.report["detection"]["detector"] == "bvh"


# Runs a scene on the command line and loses the GPU in the third frame.
LOSING = """
import sys
from clothsim import _core, _cli
from clothsim.simulation import Simulation

advance, calls = Simulation.advance, []

def losing(self, seconds):
    calls.append(seconds)
    if len(calls) == 3:
        assert _core.lose_gpu()
    advance(self, seconds)

Simulation.advance = losing
_core.let_auto_take_software(True)
sys.exit(_cli.main(sys.argv[1:]))
"""


def test_a_run_that_loses_its_gpu(gpu: str, tmp_path: Path, run_cli: RunCli) -> None:
    """Under "auto" it goes on and says so in its report; under "gpu" it stops, and another device goes on with it."""
    scene = falling(tmp_path / "scene.toml", "virtual-subdivision")

    def losing(out: str, device: str) -> subprocess.CompletedProcess[str]:
        command = ["run", scene, "-o", tmp_path / out, "--device", device, "--frames", str(FRAMES)]
        return subprocess.run(
            [sys.executable, "-c", LOSING, *map(str, command)], capture_output=True, text=True, check=False
        )

    done = losing("auto", "auto")
    assert done.returncode == 0, done.stderr
    assert "on the CPU instead of a GPU since step 15: " in done.stderr
    report = json.loads((tmp_path / "auto" / "report.json").read_text())
    assert [f["step"] for f in report["fallbacks"]] == [15]
    assert "lost" in report["fallbacks"][0]["reason"]

    done = losing("gpu", "gpu")
    assert done.returncode == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert "device lost" in done.stderr
    assert "--resume goes on with them on any device" in done.stderr
    again = run_cli("run", scene, "-o", tmp_path / "gpu", "--frames", str(FRAMES), "--resume", "--quiet")
    assert again.returncode == 0, again.stderr
    first, second = (np.load(tmp_path / out / "frames.npz") for out in ("auto", "gpu"))
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])


@pytest.mark.parametrize(
    ("detector", "device", "message"),
    [
        ("grid", "cpu", r'scene\.toml:7: contact\.detector: expected one that runs on device "cpu".*got "grid"'),
        ("bvh", "gpu", r'contact\.detector: expected one that runs on device "gpu".*got "bvh"'),
        ("virtual-subdivison", "auto", r'contact\.detector: .*did you mean "virtual-subdivision"'),
    ],
)
def test_a_detector_that_the_device_does_not_have_is_refused(
    tmp_path: Path, detector: str, device: str, message: str
) -> None:
    with pytest.raises(cs.InvalidScene, match=message):
        cs.Simulation(cs.Scene.load(falling(tmp_path / "scene.toml", detector)), device=device)


@pytest.mark.skipif(sys.platform != "linux", reason="drivers are hidden from the Vulkan loader by its variables")
def test_without_a_driver(tmp_path: Path) -> None:
    """An error that says what to do where a GPU was asked for, the CPU and a note where a GPU's method was."""
    hidden = os.environ | {"VK_DRIVER_FILES": "/nonexistent", "VK_ICD_FILENAMES": "/nonexistent"}
    scene = falling(tmp_path / "scene.toml", "grid")

    def cli(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "clothsim", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False, env=hidden)

    refused = cli("run", str(scene), "-o", str(tmp_path / "refused"), "--device", "gpu")
    assert refused.returncode == 2
    assert "expected a GPU (a Vulkan, Metal or DX12 adapter" in refused.stderr
    assert '`clothsim doctor` lists adapters, and the devices "cpu" and "auto" do without' in refused.stderr
    assert not (tmp_path / "refused").exists()
    plan = cli("plan", str(scene), "--json")
    assert plan.returncode == 0, plan.stderr
    facts = json.loads(plan.stdout)
    if facts["detection"]["device"] == "cpu":
        assert facts["detection"]["why"].startswith('device "auto", and no GPU: ')
        assert 'detector "grid": on the CPU instead of a GPU since step 0: no GPU: ' in facts["warnings"][-1]
    doctor = json.loads(cli("doctor", "--json").stdout)["gpu"]
    assert doctor["taken"] == {"gpu": "none", "auto": "cpu"}
    assert "adapter" in doctor["problem"]


def test_doctor_lists_adapters_with_what_matters(gpu: str, run_cli: RunCli) -> None:
    facts = json.loads(run_cli("doctor", "--json").stdout)["gpu"]
    assert gpu in [adapter["name"] for adapter in facts["adapters"]]
    for adapter in facts["adapters"]:
        assert adapter["max_binding_bytes"] >= 2**20
        assert adapter["kind"] != "software" or "auto" not in adapter["devices"]
    assert facts["taken"]["gpu"] == facts["adapters"][0]["name"]
    assert 'device "gpu" takes ' in run_cli("doctor").stdout


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="libraries that are loaded are not listed")
@pytest.mark.parametrize("device", ["auto", "cpu"])
def test_a_run_on_the_cpu_loads_no_driver(tmp_path: Path, device: str) -> None:
    """Where nothing speaks for a GPU, a default run does not pay for the search."""
    if device == "auto" and (Path("/dev/dri").exists() or list(Path("/dev").glob("nvidia*"))):
        pytest.skip("there is a GPU, and it is asked")
    code = f"""
import clothsim as cs
sim = cs.Simulation(cs.Scene.load({str(falling(tmp_path / "scene.toml"))!r}), device={device!r})
sim.step()
loaded = open("/proc/self/maps").read()
print("libvulkan" in loaded)
if {device!r} == "auto":  # the planted fault: after a search it is there
    cs.collision.detect([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]], "grid",
                        device="gpu")
    print("libvulkan" in open("/proc/self/maps").read())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    answers = done.stdout.split()
    assert answers[0] == "False", done.stderr
    if done.returncode == 0 and device == "auto":
        assert answers[1] == "True"
