"""Sweeps: the same tables whatever runs them and whoever is killed, rows for what fails, bad input."""

from __future__ import annotations

import gc
import json
import logging
import os
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from conftest import RunCli, cli_command

import clothsim as cs
from clothsim._cli import main
from clothsim.sweep import cluster, farm, task
from clothsim.sweep.draws import draw
from clothsim.sweep.file import read as read_sweep

pytest.importorskip("distributed", reason="the extra 'sweep' is not installed")
pq = pytest.importorskip("pyarrow.parquet", reason="the extra 'sweep' is not installed")

SCENE = """
[scene]
name = "cloth on a ball"
duration = 0.2
[scene.time]
dt = 0.005
[scene.contact]
thickness = 0.006
[[scene.cloth]]
name = "cloth"
mesh = { generator = "grid", width = 0.6, height = 0.6, nx = NX, ny = NX }
position = [0.02, 0.31, 0.01]
material = "cotton"
[[scene.collider]]
name = "ball"
shape = { type = "sphere", radius = 0.3, tolerance = 0.01 }
[scene.output]
fps = 60
"""
SWEEP = """
metrics = ["lowest", "drape", "stick_drift", "contact_error"]
series = ["energy", "counts", "lowest"]
keep = ["npz"]
checkpoint_interval = 0.02
[vary]
fabric = ["cotton", "silk"]
[seeds]
count = 3
disturbance = 0.01
[seeds.draw]
contact.friction = { uniform = [0.0, 0.6] }
"""
SMALL = SCENE.replace("NX", "7").replace("duration = 0.2", "duration = 0.05")


def write(folder: Path, text: str) -> Path:
    path = folder / "sweep.toml"
    path.write_text(text)
    return path


def tables(out: Path) -> dict[str, bytes]:
    """All that has to be the same from sweep to sweep."""
    files = [p for p in out.rglob("*") if p.suffix in (".parquet", ".npz") and p.name != "costs.parquet"]
    return {str(p.relative_to(out)): p.read_bytes() for p in files}


def workers(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(p) for p in children if b"clothsim.sweep.worker" in Path(f"/proc/{p}/cmdline").read_bytes()]


# The same tables ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that was left alone, on one process."""
    folder = tmp_path_factory.mktemp("reference")
    path = write(folder, SWEEP + SCENE.replace("NX", "19"))
    sweep = cs.sweep.run_file(path, processes=1, out=folder / "out", progress=False)
    assert sweep.facts["counts"] == {"ok": 6}
    assert sweep.facts["workers"] == 1
    return folder


def test_tables_say_what_ran_and_what_came_of_it(reference: Path) -> None:
    sweep = cs.sweep.load(reference / "out")
    rows = sweep.rows()
    assert [row["run"] for row in rows] == list(range(6))
    assert [row["fabric"] for row in rows] == ["cotton"] * 3 + ["silk"] * 3
    assert [row["seed"] for row in rows] == [0, 1, 2, 0, 1, 2]
    frictions = [row["contact.friction"] for row in rows]
    assert frictions[:3] == frictions[3:], "a seed draws the same for every fabric"
    assert len(set(frictions)) == 3
    assert all(0.0 <= f <= 0.6 for f in frictions)
    assert len({row["lowest"] for row in rows}) == 6
    for row in rows:
        frames = cs.Recording.load(reference / "out" / row["folder"] / "frames.npz")
        assert row["frames"] == len(frames) == 13
        assert row["lowest"] == frames.positions("cloth", -1)[:, 1].min()
    field = sweep.runs.schema.field("lowest")
    assert field.metadata[b"unit"] == b"m"
    last = sweep.frames.to_pylist()[12]
    assert (last["run"], last["frame"], last["lowest"]) == (0, 12, rows[0]["lowest"])
    assert last["energy_total"] == pytest.approx(sum(v for k, v in last.items() if k.startswith("energy_")) / 2)
    assert not (reference / "out" / ".clothsim").exists()


def test_killed_workers_lose_nothing_but_time(reference: Path, tmp_path: Path) -> None:
    """The worker of a run that has a checkpoint is killed: another goes on from there."""
    out = tmp_path / "out"
    process = subprocess.Popen(
        cli_command("sweep", reference / "sweep.toml", "-o", out), stderr=subprocess.PIPE, text=True
    )
    killed = 0
    late = time.monotonic() + 120
    while killed < 2 and process.poll() is None and time.monotonic() < late:
        time.sleep(0.005)
        for lock in out.glob(".clothsim/runs/*/.clothsim/checkpoint"):
            busy = [p for p in workers(process.pid) if _holds(p, lock.with_name("frames.bin"))]
            for pid in busy[:1]:
                os.kill(pid, signal.SIGKILL)
                killed += 1
                time.sleep(0.3)
    _, errors = process.communicate(timeout=240)
    assert process.returncode == 0, errors
    assert killed == 2
    assert "its worker was lost" in errors
    assert "Traceback" not in errors
    costs = pq.read_table(out / "costs.parquet").to_pydict()
    assert sum(costs["losses"]) == 2
    assert max(costs["starts"]) >= 2
    assert max(costs["resumed_at"]) > 0, "from a checkpoint, not from the start"
    assert tables(out) == tables(reference / "out")
    damaged = {**tables(out), "runs.parquet": b""}
    assert damaged != tables(reference / "out"), "the comparison sees a difference"


def _holds(pid: int, path: Path) -> bool:
    try:
        return any(os.path.samefile(f, path) for f in Path(f"/proc/{pid}/fd").iterdir() if f.exists())
    except OSError:
        return False


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_sweep_that_was_stopped_goes_on(reference: Path, tmp_path: Path, how: signal.Signals) -> None:
    out, sweep = tmp_path / "out", reference / "sweep.toml"
    process = subprocess.Popen(
        cli_command("sweep", sweep, "-o", out, "--quiet", "--processes", "1"), stderr=subprocess.PIPE, text=True
    )
    late = time.monotonic() + 120
    while len(list(out.glob(".clothsim/results/*.json"))) < 2 and time.monotonic() < late:
        time.sleep(0.005)
    pids = workers(process.pid)
    process.send_signal(how)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == (130 if how == signal.SIGINT else -signal.SIGKILL)
    if how == signal.SIGINT:
        assert f"clothsim sweep {sweep} -o {out} --resume" in errors
        assert "Traceback" not in errors
    late = time.monotonic() + 30
    while any(Path(f"/proc/{p}").exists() for p in pids) and time.monotonic() < late:
        time.sleep(0.01)
    assert not any(Path(f"/proc/{p}").exists() for p in pids), "no worker is left behind"
    with pytest.raises(cs.OutputExists, match="holds an unfinished sweep; --resume goes on with it"):
        cs.sweep.run_file(sweep, out=out)
    with pytest.raises(cs.CheckpointError, match="the unfinished sweep is another one"):
        cs.sweep.run_file(write(tmp_path, SWEEP + SMALL), out=out, resume=True)
    done = cs.sweep.run_file(sweep, out=out, resume=True, progress=False)
    assert done.facts["counts"] == {"ok": 6}
    assert tables(out) == tables(reference / "out")
    again = cs.sweep.run_file(sweep, out=out, resume=True)
    assert again.runs.equals(done.runs)
    with pytest.raises(cs.OutputExists, match="holds a sweep already"):
        cs.sweep.run_file(sweep, out=out)


# Any cluster ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scheduler() -> Any:
    """Somebody's cluster: two workers, threads of this process."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0", protocol="tcp://"
    ) as running:
        yield running.scheduler_address


@pytest.mark.parametrize("shared", [True, False])
def test_a_cluster_by_its_address(
    tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch, shared: bool
) -> None:
    """With the folder in sight of its workers and without: the same tables."""
    path = write(tmp_path, SWEEP.replace('keep = ["npz"]\n', "") + SMALL)
    here = cs.sweep.run_file(path, scheduler=scheduler, progress=False)
    if not shared:
        monkeypatch.setattr(task.Work, "shared", False)
    there = cs.sweep.run_file(path, scheduler=scheduler, out=tmp_path / "out", progress=False)
    assert there.facts["workers"] == 2
    assert there.runs.equals(here.runs)
    assert there.frames.equals(here.frames)
    if not shared:
        keeping = write(tmp_path, SWEEP + SMALL)
        with pytest.raises(cs.ClusterError, match="does not see .*a folder that all workers see"):
            cs.sweep.run_file(keeping, scheduler=scheduler, out=tmp_path / "kept", progress=False)


def test_a_cluster_with_another_version(tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("clothsim.sweep.farm._core", type("Core", (), {"__version__": "9.9"}))
    with pytest.raises(cs.ClusterError, match="expected clothsim 9.9, got"):
        cs.sweep.run_file(write(tmp_path, SWEEP.replace('keep = ["npz"]\n', "") + SMALL), scheduler=scheduler)


def test_a_scheduler_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_ANSWER", 0.3)
    path = write(tmp_path, SWEEP + SMALL)
    for address in ("tcp://127.0.0.1:9", "nowhere:nothing", "http://"):
        with pytest.raises(cs.ClusterError, match=f"scheduler {address}: no answer within 0.3 s"):
            cs.sweep.run_file(path, scheduler=address, out=tmp_path / "out", progress=False)
        assert not (tmp_path / "out").exists()


def test_a_client_that_has_failed_waits_for_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left of it is collected in any thread, also while the loop of the next client starts under this lock."""
    from distributed.utils import LoopRunner

    monkeypatch.setattr(cluster, "_ANSWER", 0.3)
    for address in ("tcp://127.0.0.1:9", "nowhere:nothing", "http://"):
        gc.disable()
        try:
            with pytest.raises(cs.ClusterError):
                cluster.RemoteCluster(address)
            collector = threading.Thread(target=gc.collect, daemon=True)
            with LoopRunner._lock:
                collector.start()
                collector.join(5)
                assert not collector.is_alive()
        finally:
            gc.enable()


def test_a_scheduler_that_goes_in_mid_run(tmp_path: Path, scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One clear error; what has finished is kept; another cluster does the rest, to the same tables."""
    from distributed.comm import CommClosedError

    path = write(tmp_path, SWEEP.replace('keep = ["npz"]\n', "") + SMALL)
    here = cs.sweep.run_file(path, scheduler=scheduler, progress=False)
    levels = [logging.getLogger(name).level for name in cluster._CHATTER]
    finished: list[Path] = []

    def gone(self: cluster.RemoteCluster) -> int:
        finished[:] = (tmp_path / "out" / ".clothsim" / "results").glob("*.json")
        if finished:
            raise CommClosedError("in <TCP (closed)>: Connection reset by peer")
        return 1

    with monkeypatch.context() as patched:
        patched.setattr(cluster.RemoteCluster, "slots", property(gone))
        with pytest.raises(cs.ClusterError, match="the scheduler is gone; what has finished is kept, and --resume"):
            cs.sweep.run_file(path, scheduler=scheduler, out=tmp_path / "out", progress=False)
    assert 0 < len(finished) < len(here.rows())
    assert [logging.getLogger(name).level for name in cluster._CHATTER] == levels
    there = cs.sweep.run_file(path, scheduler=scheduler, out=tmp_path / "out", resume=True, progress=False)
    assert there.runs.equals(here.runs)
    assert there.frames.equals(here.frames)


@pytest.mark.parametrize("status", ["lost", "pending", "finished"])
def test_a_result_that_is_lost_with_its_worker_is_waited_for(tmp_path: Path, status: str) -> None:
    """A worker that ends just after a run: the run is neither failed nor done until there is a result."""

    class Future:
        key, released = "", False

        def exception(self) -> None:
            return None

        def result(self, timeout: float) -> None:
            raise TimeoutError

        def add_done_callback(self, told: Any) -> None:
            self.told = told

        def release(self) -> None:
            self.released = True

    class Client:
        def submit(self, _: Any, *__: Any, key: str, **___: Any) -> Any:
            future.key = key
            return future

    class Workers:
        client, slots = Client(), 1

        def look_after(self) -> None:
            """Nobody is missing."""

    future: Any = Future()
    request = read_sweep(write(tmp_path, "[vary]\nfabric = ['cotton']\n" + SMALL)).request
    work, found = task.Work(str(tmp_path), "token"), []
    one = farm._Farm(Workers(), request, work, 1, lambda *told: found.append(told), print)  # type: ignore[arg-type]
    one._submit(request.runs[0])
    future.status = status
    one._take(future)
    assert (found, future.released) == ([], False)
    assert list(one._open) == [future.key]
    result = work.result(request.runs[0].name)
    result.parent.mkdir()
    result.write_text('{"seconds": 1.0}')
    one._take(future)
    assert [facts["seconds"] for _, facts in found] == [1.0]
    assert future.released


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("name = 3\n[seeds]\ncount = 2\n", "name: expected a text, got 3"),
        ("vary = " + "[" * 3000, "cannot read the sweep: nested too deep"),
        ("[vary]\n" + "a." * 200 + "a = 1\n", "cannot read the sweep: nested more than 60 deep"),
        ("# " + "x" * 5 * 2**20, "cannot read the sweep: more than 4 MiB"),
        ("y" * 100_000 + " = 1\n", "expected one of the keys"),
        ("scene = 'none.toml'\n", "none.toml: cannot read the scene"),
    ],
)
def test_files_that_are_no_sweeps(tmp_path: Path, text: str, error: str) -> None:
    path = tmp_path / "sweep.toml"
    path.write_text(text + SMALL if text.startswith("name") else text)
    with pytest.raises((cs.InvalidInput, cs.InvalidScene)) as caught:
        cs.sweep.run_file(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert error in str(caught.value)
    assert len(str(caught.value)) < 1100


# Runs that fail -------------------------------------------------------------------------------------------------


def test_what_cannot_run_is_a_row_with_its_error(tmp_path: Path, scheduler: str) -> None:
    pinned = "position = [0.02, 0.31, 0.01]\npins = [{ vertices = [0] }]"
    text = SMALL.replace("position = [0.02, 0.31, 0.01]", pinned)
    vary = '[vary]\ndt = [0.005, -1.0, 0.005]\n"cloth[0].position" = [[0, 0.31, 0], [0, 0.31, 0], [0, 0.1, 0]]\n'
    asked = 'combine = "zip"\n' + vary
    sweep = cs.sweep.run_file(write(tmp_path, asked + text), scheduler=scheduler, out=tmp_path / "out", progress=False)
    rows = sweep.rows()
    assert [row["status"] for row in rows] == ["ok", "not run", "failed"]
    assert "time.dt" in rows[1]["error"]
    assert rows[2]["error_type"] == "IntersectingStart"
    assert rows[1]["lowest"] is rows[2]["lowest"] is None
    assert sweep.facts["counts"] == {"ok": 1, "not run": 1, "failed": 1}


def test_a_run_that_takes_too_long_is_stopped(tmp_path: Path, scheduler: str) -> None:
    text = "timeout = 1e-6\n[vary]\nfabric = ['cotton', 'silk']\n" + SMALL
    sweep = cs.sweep.run_file(write(tmp_path, text), scheduler=scheduler, progress=False)
    assert [row["status"] for row in sweep.rows()] == ["timed out"] * 2
    assert "stopped after 1e-06 s" in sweep.rows()[0]["error"]


def test_a_run_that_hangs_within_a_frame_is_ended(tmp_path: Path) -> None:
    """The limit is looked at between frames; a worker of ours goes with a run whose frame does not end."""
    hangs = "timeout = 4\n[vary]\nduration = [0.01, 400.0]\n" + SMALL.replace("fps = 60", "fps = 0.001")
    sweep = cs.sweep.run_file(write(tmp_path, hangs), processes=1, progress=False)
    assert [row["status"] for row in sweep.rows()] == ["ok", "timed out"]
    assert sweep.rows()[1]["error"] == "stopped after 4 s, within a frame"


def test_a_run_that_always_loses_its_worker_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker of ours that dies with one of the runs, as if it had run out of memory."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "if 'clothsim.sweep.worker' in sys.orig_argv:\n"
        "    import os, clothsim._run.job as job\n"
        "    run = job.Job.run\n"
        "    def dies(self):\n"
        "        if self.scene.to_dict()['contact']['friction'] == 0.5:\n"
        "            os.kill(os.getpid(), 9)\n"
        "        return run(self)\n"
        "    job.Job.run = dies\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    text = 'retries = 1\n[vary]\n"contact.friction" = [0.1, 0.5, 0.2]\n' + SMALL
    sweep = cs.sweep.run_file(write(tmp_path, text), processes=1, out=tmp_path / "out", progress=False)
    assert [row["status"] for row in sweep.rows()] == ["ok", "lost", "ok"]
    assert sweep.rows()[1]["error"] == "its worker was lost, and 1 more that took it over"


# What is asked for ----------------------------------------------------------------------------------------------


def test_a_draw_depends_on_seed_and_name_alone() -> None:
    for kind, values in {
        "uniform": [1.0, 2.0], "log_uniform": [1.0, 2.0], "integers": [1, 2], "choice": [1, 2], "normal": [1.5, 0.01]
    }.items():  # fmt: skip
        one = draw("contact.friction", {kind: values})
        drawn = [one.value(seed) for seed in range(50)]
        assert drawn == [one.value(seed) for seed in range(50)]
        assert all(1 <= v <= 2 for v in drawn)
        assert len(set(drawn)) > 1
        assert drawn != [draw("contact.self_friction", {kind: values}).value(seed) for seed in range(50)]


def test_a_dry_run_lists_the_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path, SWEEP + SMALL)
    assert main(["sweep", str(path), "--dry-run"]) == 0
    text = capsys.readouterr().out
    assert "cloth on a ball: 6 runs" in text
    assert "silk" in text
    assert main(["sweep", str(path), "--dry-run", "--json", "--set", "duration=0.01"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [run["seed"] for run in facts["runs"]] == [0, 1, 2] * 2
    assert facts["fixed"] == {"duration": 0.01}


VARY = '[vary]\nfabric = ["cotton", "silk"]\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SMALL, "sweep.toml: sweep: expected values under [vary], [seeds], or several scenes, got nothing"),
        ("[vary]\nfabric = []\n" + SMALL, "axis fabric: expected 1 to 100000 values, got 0"),
        ("[vary]\nfabrik = ['silk']\n" + SMALL, 'got "fabrik" (did you mean "fabric"?)'),
        ("[vary]\ncontact.frictoin = [0.1]\n" + SMALL, 'contact.frictoin: no value of it makes a scene: '),
        ("[vary]\ncontact.frictoin = [0.1]\n" + SMALL, '(did you mean "friction"?)'),
        ("metrcs = ['lowest']\n" + VARY + SMALL, 'metrcs: expected one of the keys name, scene, set, vary'),
        ("metrcs = ['lowest']\n" + VARY + SMALL, '(did you mean "metrics"?)'),
        ("metrics = ['rms']\n" + VARY + SMALL, "metrics: rms compares with a reference, and a sweep has none"),
        ("metrics = ['lowst']\n" + VARY + SMALL, '(did you mean "lowest"?)'),
        ("series = ['enregy']\n" + VARY + SMALL, '(did you mean "energy"?)'),
        ("keep = ['npzz']\n" + VARY + SMALL, '(did you mean "npz"?)'),
        ("combine = 'zipp'\n" + VARY + SMALL, '(did you mean "zip"?)'),
        ("combine = 'zip'\n" + VARY + "dt = [0.001]\n" + SMALL, "got 2 of fabric, 1 of dt"),
        ("[vary]\nprecision = ['f32']\n" + SMALL, "clothsim study varies it"),
        ("[vary]\nthreads = [1, 2]\n" + SMALL, "threads at the top of the sweep is for all runs"),
        ("[vary]\ndt = { first = 1, last = -1, count = 3, spacing = 'geometric' }\n" + SMALL, "between numbers > 0"),
        ("[seeds]\nfirst = 3\n" + SMALL, "seeds.count: expected a whole number ≥ 1, got nothing"),
        ("[seeds]\ncount = 0\n" + SMALL, "seeds.count: expected a whole number ≥ 1, got 0"),
        (VARY + "combine = 'zip'\n" + SMALL, 'expected a key of the scene, got "combine", one of the sweep'),
        ("[seeds]\ncount = 1\ndisturbance = -1.0\n" + SMALL, "disturbance: expected a number ≥ 0, at most 1e+12"),
        ("[seeds]\ncount = 1\ndraw.dt = { unifrom = [1, 2] }\n" + SMALL, '(did you mean "uniform"?)'),
        ("[seeds]\ncount = 1\ndraw.dt = { uniform = [2, 1] }\n" + SMALL, "uniform takes low and high, got [2, 1]"),
        ("[seeds]\ncount = 200000\n" + SMALL, "expected at most 100000, got 200000"),
        ("[seeds]\ncount = 1\nfirst = 18446744073709551616\n" + SMALL, "seeds.first: expected at most 461168601842738"),
        ("timeout = 0\n" + VARY + SMALL, "timeout: expected a number > 0, at most 1e+12 [s], got 0"),
        ("retries = -1\n" + VARY + SMALL, "retries: expected a whole number ≥ 0, got -1"),
        ("scene = 'none.toml'\n" + VARY, "none.toml: cannot read the scene: No such file"),
        (VARY, "scene: expected the path of a scene, a list of them, or a table [scene], got nothing"),
        ("scene = 3\n" + VARY, "got 3"),
        (VARY + SMALL.replace("thickness", "thikness"), "sweep.toml: scene: contact.thikness: expected one"),
        ("[vary\n", "sweep.toml: cannot read the sweep:"),
    ],
)  # fmt: skip
def test_bad_sweeps(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str) -> None:
    assert main(["sweep", str(write(tmp_path, text)), "-o", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_output_folder_is_asked_for_and_no_other_thing_is_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, VARY + SMALL)
    assert main(["sweep", str(path)]) == 2
    assert "-o: expected an output folder, got nothing" in capsys.readouterr().err
    (tmp_path / "out").mkdir()
    for name, what in (("frames.npz", "a run of a scene"), ("study.json", "a study")):
        (tmp_path / "out" / name).write_text("mine")
        assert main(["sweep", str(path), "-o", str(tmp_path / "out")]) == 2
        assert f"holds {what}" in capsys.readouterr().err
        (tmp_path / "out" / name).unlink()


def test_without_the_extra(tmp_path: Path, run_cli: RunCli) -> None:
    (tmp_path / "distributed.py").write_text("raise ModuleNotFoundError('no distributed', name='distributed')")
    path, env = write(tmp_path, VARY + SMALL), {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = run_cli("sweep", path, "-o", tmp_path / "out", env=env)
    assert done.returncode == 2
    assert "pip install 'clothsim[sweep]'" in done.stderr
    assert not (tmp_path / "out").exists()


def test_several_scenes(tmp_path: Path, scheduler: str) -> None:
    for name, friction in (("a", 0.1), ("b", 0.4)):
        scene = cs.Scene(duration=0.02, contact={"thickness": 0.005, "friction": friction})
        scene.add_cloth(cs.Mesh.grid(0.3, 0.3, 5, 5), "cotton")
        scene.save(tmp_path / f"{name}.toml")
    text = "scene = ['a.toml', 'b.toml']\n[set]\ntime.dt = 0.005\n"
    rows = cs.sweep.run_file(write(tmp_path, text), scheduler=scheduler, progress=False).rows()
    assert [row["scene"] for row in rows] == ["a.toml", "b.toml"]
    assert [row["steps"] for row in rows] == [4, 4] or rows[0]["steps"] == rows[1]["steps"]
