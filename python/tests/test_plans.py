"""Plans, with controllers in Python, and over executors."""

import os
import sys
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

import maes
from maes.node import load

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/python"
NearestFrontier = load(f"{EXAMPLES}/nearest_frontier.py:NearestFrontier")

PLAN = """
seeds = "1..2"
[scenario]
duration_s = 20.0
[scenario.map]
kind = "spheres"
size = 20
[scenario.map.spheres]
radius_max = 5
[scenario.agents]
count = 2
controller = "rbw"
[axes]
"agents.controller" = {controllers}
"""


def written(folder, controllers):
    plan = folder / "plan.toml"
    plan.write_text(PLAN.format(controllers=str(controllers).replace("'", '"')))
    return plan


def test_python_beside_rust(tmp_path):
    plan = written(tmp_path, ["nearest-frontier", "nearest-frontier-py"])
    batch = maes.batch(plan, tmp_path / "out", controllers=[NearestFrontier], jobs=2)
    runs = batch.columns("runs")
    assert not batch.failures and len(runs["id"]) == 4
    distance = {(name, seed): d for name, seed, d in zip(runs["controller"], runs["seed"], runs["distance_m"])}
    for seed in (1, 2):
        assert distance["nearest-frontier", seed] == distance["nearest-frontier-py", seed]
    assert (tmp_path / "out/runs.csv").is_file()
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/runs").iterdir()}
    maes.batch(plan, tmp_path / "out", controllers=[NearestFrontier])
    # The class has no version.
    again = {id for id, name in zip(runs["id"], runs["controller"]) if name == "nearest-frontier-py"}
    replaced = {path.stem for path, before in stamps.items() if path.stat().st_mtime_ns != before}
    assert len(again) == 2 and replaced == again


def test_progress_is_shown_with_tqdm_only(tmp_path, capsys, monkeypatch):
    plan = written(tmp_path, ["rbw"])
    maes.batch(plan, tmp_path / "shown", progress=True)
    assert "2/2" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(ImportError, match=r"maes\[progress\]"):
        maes.batch(plan, tmp_path / "out", progress=True)
    assert not (tmp_path / "out").exists()


class LosesWorkers(ThreadPoolExecutor):
    """Loses every first task, as if its worker had died."""

    def __init__(self):
        super().__init__(1)
        self.lost = set()

    def submit(self, call, /, *arguments, **keys):
        name = str(arguments[:2])
        if name not in self.lost:
            self.lost.add(name)
            future = Future()
            future.set_exception(ConnectionError("the worker is gone"))
            return future
        return super().submit(call, *arguments, **keys)


def test_executors_give_the_same_runs(tmp_path):
    plan = written(tmp_path, ["rbw", "lvd"])
    here = maes.batch(plan, tmp_path / "here").columns()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        there = maes.batch(plan, tmp_path / "there", executor=pool).columns()
    lossy = maes.batch(plan, tmp_path / "lossy", executor=LosesWorkers())
    assert here["digest"] == there["digest"] == lossy.columns()["digest"] and not lossy.failures
    with ThreadPoolExecutor(1) as pool:
        untouched = {file: os.stat(file).st_mtime_ns for file in (tmp_path / "there/runs").iterdir()}
        maes.batch(plan, tmp_path / "there", executor=pool)
        assert untouched == {file: os.stat(file).st_mtime_ns for file in (tmp_path / "there/runs").iterdir()}


def test_failures_have_a_reason(tmp_path):
    class Broken(maes.Controller):
        def decide(self, observation, ctx):
            raise ValueError("it is broken")

    plan = written(tmp_path, ["rbw", "Broken"])
    batch = maes.batch(plan, tmp_path / "out", controllers=[Broken])
    assert len(batch.failures) == 2 and all("it is broken" in why for why in batch.failures.values())
    assert len(batch.columns()["id"]) == 2


class Broken(maes.Controller):
    def decide(self, observation, ctx):
        raise ValueError("it is broken")


def test_executor_stores_nothing_in_a_folder_that_is_refused(tmp_path):
    out = tmp_path / "out"
    maes.batch(written(tmp_path, ["rbw", "lvd"]), out)
    before = sorted((out / "runs").iterdir()), (out / "plan.toml").read_text()
    other = written(tmp_path, ["rbw", "nearest-frontier"])
    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(maes.BadInput, match="holds 2 runs that are not of this plan.*prune=True"):
            maes.batch(other, out, executor=pool)
        assert before == (sorted((out / "runs").iterdir()), (out / "plan.toml").read_text())
        batch = maes.batch(other, out, executor=pool, prune=True)
    assert sorted(set(batch.columns()["controller"])) == ["nearest-frontier", "rbw"]
    maes.batch(other, out)


def test_folder_is_locked_while_an_executor_is_at_work(tmp_path):
    plan, out = written(tmp_path, ["rbw"]), tmp_path / "out"
    refused = []

    class Looks(ThreadPoolExecutor):
        def submit(self, call, /, *arguments, **keys):
            with pytest.raises(maes.BadInput, match="another `maes batch` is at work there") as error:
                maes.batch(plan, out)
            refused.append(error)
            return super().submit(call, *arguments, **keys)

    with Looks(1) as pool:
        assert not maes.batch(plan, out, executor=pool).failures
    assert len(refused) == 2
    maes.batch(plan, out)


def test_failures_are_the_same_with_an_executor(tmp_path):
    plan = written(tmp_path, ["rbw", "Broken"])
    here = maes.batch(plan, tmp_path / "here", controllers=[Broken])
    with ThreadPoolExecutor(1) as pool:
        there = maes.batch(plan, tmp_path / "there", controllers=[Broken], executor=pool)
    assert len(here.failures) == 2 and here.failures == there.failures
    assert here.columns("verdicts") == there.columns("verdicts")
    assert (tmp_path / "there/runs.csv").is_file()
    assert [sorted(one.name for one in (batch.folder / "failures").iterdir()) for batch in (here, there)] == [
        sorted(f"{id}.json" for id in here.failures)
    ] * 2


def test_workers_with_another_version_are_refused(tmp_path):
    plan = written(tmp_path, ["Mine"])

    def mine(of):
        class Mine(Broken):
            version = of

        return Mine

    class OfYesterday(ThreadPoolExecutor):
        """Its workers have imported the class before it was edited."""

        def submit(self, call, /, file, id, classes):
            return super().submit(call, file, id, [mine(1)])

    with OfYesterday(1) as pool:
        batch = maes.batch(plan, tmp_path / "out", controllers=[mine(2)], executor=pool)
    assert len(batch.failures) == 2 and not batch.columns()["id"]
    assert all("in the worker; expected the same files, the same versions" in why for why in batch.failures.values())
