"""Many replays: the plan, resuming after a kill, local workers, and a Dask cluster that loses a worker."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pyarrow import parquet

from axialnav.fusion.errors import ConfigError
from axialnav.replay import cli
from axialnav.replay.flight_writer import write_flight
from axialnav.replay.sweep.page import by_settings, sweep_page
from axialnav.replay.sweep.plan import Job, parse_grid, plan
from axialnav.replay.sweep.results import JOURNAL, TABLE, Journal
from axialnav.replay.sweep.sweep import sweep
from tests.replay.made_recordings import flown

GRID = {"uwb.range_sigma_m": ["0.2", "0.3", "0.4"], "imu.accel_noise_scale": ["1.0", "2.0"]}


@pytest.fixture(scope="module")
def flights(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short recordings on disk."""
    folder = tmp_path_factory.mktemp("flights")
    return [write_flight(flown(seed, 4.0), folder / f"flight{seed}") for seed in (1, 2)]


@pytest.fixture(scope="module")
def alone(flights: list[Path], tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, object]]:
    """What one worker in this process finds."""
    return sweep(plan(flights, GRID), tmp_path_factory.mktemp("alone")).rows


def digests(rows: list[dict[str, object]]) -> list[object]:
    return [row["digest"] for row in rows]


def test_the_plan_is_every_flight_with_every_combination(flights: list[Path]) -> None:
    jobs = plan(flights, GRID)
    assert len(jobs) == len({job.key for job in jobs}) == 2 * 3 * 2
    assert jobs == plan(flights, GRID)
    assert plan(flights[:1], {}, config_text="a = 1\n")[0].key != plan(flights[:1], {})[0].key
    assert len(plan([flights[0], flights[0]], {})) == 1


@pytest.mark.parametrize(
    ("texts", "grid"),
    [
        (["a.b=1,2"], {"a.b": ["1", "2"]}),
        (["a=[1, 2],[3, 4]", 'b="x,y",z'], {"a": ["[1, 2]", "[3, 4]"], "b": ['"x,y"', "z"]}),
        ([], {}),
    ],
)
def test_values_are_split_at_commas_outside_brackets(texts: list[str], grid: dict[str, list[str]]) -> None:
    assert parse_grid(texts) == grid


@pytest.mark.parametrize("texts", [["a"], ["a="], ["=1"], ["a=1,,2"], ["a=1", "a=2"], ["a=1,1"]])
def test_bad_grids_are_refused(texts: list[str]) -> None:
    with pytest.raises(ConfigError):
        parse_grid(texts)


def test_two_processes_find_the_same_as_one(
    flights: list[Path], alone: list[dict[str, object]], tmp_path: Path
) -> None:
    done = sweep(plan(flights, GRID), tmp_path, workers=2)
    assert digests(done.rows) == digests(alone)
    assert len(set(digests(alone))) == len(alone)  # or the comparison would say nothing


def test_the_table_holds_every_replay_once(flights: list[Path], alone: list[dict[str, object]], tmp_path: Path) -> None:
    jobs = plan(flights, GRID)
    sweep(jobs, tmp_path)
    table = parquet.read_table(tmp_path / TABLE)
    assert table.column("key").to_pylist() == [job.key for job in jobs]
    assert table.column("digest").to_pylist() == digests(alone)
    assert table.column("param.uwb.range_sigma_m").to_pylist()[:2] == ["0.2", "0.2"]


def test_a_sweep_goes_on_where_it_was_killed(
    flights: list[Path], alone: list[dict[str, object]], tmp_path: Path
) -> None:
    """The journal after a kill: five whole lines, one written twice, and a stump."""
    jobs = plan(flights, GRID)
    lines = [json.dumps(row) for row in alone[:5]]
    (tmp_path / JOURNAL).write_text("\n".join([*lines, lines[0], lines[4][:40]]))
    done = sweep(jobs, tmp_path)
    assert done.done_before == 5
    assert digests(done.rows) == digests(alone)
    keys = [json.loads(line)["key"] for line in (tmp_path / JOURNAL).read_text().splitlines()]
    assert sorted(keys) == sorted(job.key for job in jobs)
    assert sweep(jobs, tmp_path).done_before == len(jobs)


@pytest.mark.slow
def test_a_killed_process_of_the_pool_costs_nothing(
    flights: list[Path], alone: list[dict[str, object]], tmp_path: Path
) -> None:
    killed = []

    def kill_one(_: float) -> None:
        if not killed:
            children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
            workers = [int(pid) for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
            os.kill(workers[-1], signal.SIGKILL)
            killed.append(workers[-1])

    done = sweep(plan(flights, GRID), tmp_path, workers=2, progress=kill_one)
    assert killed
    assert digests(done.rows) == digests(alone)
    assert len((tmp_path / JOURNAL).read_text().splitlines()) == len(alone)


def _start(*words: str) -> subprocess.Popen[str]:
    patience = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "20"}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **patience}
    command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_dask_cluster_that_loses_a_worker_loses_nothing(
    flights: list[Path], alone: list[dict[str, object]], tmp_path: Path
) -> None:
    """A real scheduler and two real workers as processes; one is killed when a quarter is done."""
    pytest.importorskip("distributed")
    where = tmp_path / "scheduler.json"
    scheduler = _start("dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(where))
    workers = []
    try:
        for _ in range(3000):
            if where.exists():
                break
            time.sleep(0.1)
        address = json.loads(where.read_text())["address"]
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path))
        workers = [_start("dask_worker", address, *options) for _ in range(2)]
        _await_workers(address, 2)

        def kill_one(share: float) -> None:
            if share > 0.25 and workers[0].poll() is None:
                workers[0].kill()
                workers[0].wait()

        done = sweep(plan(flights, GRID), tmp_path / "out", scheduler=address, progress=kill_one)
        assert workers[0].poll() is not None
        assert workers[1].poll() is None
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
    assert digests(done.rows) == digests(alone)
    assert len((tmp_path / "out" / JOURNAL).read_text().splitlines()) == len(alone)


def _await_workers(address: str, count: int) -> None:
    from distributed import Client

    client = Client(address, set_as_default=False)
    client.wait_for_workers(count, timeout=300)
    client.close()


def test_an_address_where_nobody_answers_is_a_usage_error(
    flights: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    from axialnav.replay.sweep import sweep as module

    monkeypatch.setattr(module, "CONNECT_S", 0.5)
    with pytest.raises(ConfigError, match="no Dask scheduler answers"):
        sweep(plan(flights, {}), tmp_path, scheduler="tcp://127.0.0.1:9")


def test_what_cannot_be_replayed_is_a_row_with_its_error(
    flights: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--workers", "1", "--out", str(tmp_path / "o")]
    assert cli.main(["sweep", str(flights[0]), str(tmp_path / "none"), *arguments]) == 1
    assert "1 failed" in capsys.readouterr().out
    assert cli.main(["sweep", str(tmp_path / "none"), *arguments]) == 3
    page = (tmp_path / "o" / "summary.html").read_text()
    assert "Not replayed" in page
    assert cli.main(["sweep", str(flights[0]), "--param", "uwb.sigma=1", *arguments]) == 3
    assert "sigma_m" in capsys.readouterr().out


def test_the_page_averages_over_flights_and_escapes(alone: list[dict[str, object]]) -> None:
    groups = by_settings(alone)
    assert len(groups) == 6
    params, count, means = groups[0]
    assert (params, count) == ({"uwb.range_sigma_m": "0.2", "imu.accel_noise_scale": "1.0"}, 2)
    same = [row["axial_rmse"] for row in (alone[0], alone[6])]
    assert means["axial_rmse"] == pytest.approx(sum(same) / 2)  # type: ignore[arg-type]
    page = sweep_page([{**alone[0], "flight": "<script>"}])
    assert "<script>" not in page
    assert "http" not in page


def test_results_that_come_twice_count_once(tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    for value in (1.0, 2.0, float("nan")):
        journal.add({"key": "a", "x": value})
    journal.add({"key": "b", "x": float("inf")})
    journal.close()
    again = Journal(tmp_path)
    again.close()
    assert again.done == {"a": {"key": "a", "x": 1.0}, "b": {"key": "b", "x": None}}


def test_no_argument_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["x", "--param", "a"], ["x", "--workers", "0"], ["x", "--estimator", "y"]):
        assert cli.main(["sweep", *arguments]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_a_job_can_travel(flights: list[Path]) -> None:
    import pickle

    (job,) = plan(flights[:1], {})
    assert pickle.loads(pickle.dumps(job)) == job
    assert isinstance(job, Job)
