"""Studies of planners, and the verdicts of plans as tables."""

import sys
from concurrent.futures import ThreadPoolExecutor

import matplotlib.pyplot as plt
import numpy as np
import pytest

import maes

CAVE = {"size": 30, "duration": 40.0, "agents": 2, "lidar__range_m": 6.0, "map__spheres__radius_max": 6}


class Still(maes.Controller):
    """Stays where it is."""

    version = 1

    def decide(self, observation, ctx):
        return maes.Command(maes.Motion.stop(), maes.WakeCondition.TASK_DONE)


def test_study_compares_on_the_same_maps(tmp_path, capsys):
    study = maes.study(["rbw", Still], range(1, 8), out=tmp_path / "out", **CAVE)
    assert "14/14" in capsys.readouterr().err
    assert not study.failures and study.planners == ["rbw", "Still"]
    runs = study.frame("runs", "pandas")
    assert sorted(runs.groupby("controller")["seed"].apply(sorted).to_dict()) == ["Still", "rbw"]
    found = study.frame("verdicts", "pandas")
    assert list(found[["a", "b"]].iloc[0]) == ["rbw", "Still"] and found["pairs"][0] == found["maps"][0] == 7
    # Who stays sees less, so less of the time is saved.
    assert 0.0 < found["low"][0] <= found["estimate"][0] <= found["high"][0] < 1.0
    assert found["p_holm"][0] < 0.05 and [found["failed_a"][0], found["failed_b"][0]] == [0, 0]
    assert study.verdicts == [found["verdict"][0]]
    assert study.verdicts[0].startswith("rbw is ahead of Still") and "n = 7 maps" in study.verdicts[0]
    assert study.verdicts[0] in repr(study)
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "out/runs").iterdir()}
    more = maes.study(["rbw", Still], range(1, 9), out=tmp_path / "out", progress=False, **CAVE)
    assert more.frame("verdicts", "pandas")["pairs"][0] == 8
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in before.items())


def test_figure_has_curves_and_effects():
    study = maes.study(["rbw", "lvd", "nearest-frontier"], [1, 2], progress=False, **CAVE)
    curves, effects = study.plot().axes
    labels = [text.get_text() for text in curves.get_legend().get_texts()]
    assert labels == ["rbw (2 runs)", "lvd (2 runs)", "nearest-frontier (2 runs)"]
    for line in curves.get_lines():
        shares = line.get_ydata()
        assert shares[0] < shares[-1] <= 100 and (shares[1:] >= shares[:-1]).all()
    assert len(effects.get_yticks()) == 3
    page = study._repr_html_()
    assert page.count("<p>") >= 3 and "<svg" in page and "too few for a test" in page
    plt.close("all")
    folder = study.folder
    assert folder.exists() and study.report().read_text().count("<svg") > 3
    del study
    assert not folder.exists()


def test_figure_of_mixed_teams_has_curves():
    mix = [{"ids": [0], "controller": "dsvp"}]
    event = [{"kind": "set", "at_s": 20.0, "set": {"agents.controller": "nearest-frontier"}}]
    for keys in ({"agents__mix": mix}, {"event": event}):
        study = maes.study(["rbw", "lvd"], [1], progress=False, **{**CAVE, **keys})
        assert set(study.columns()["controller"]).isdisjoint(["rbw", "lvd"])
        labels = [text.get_text() for text in study.plot().axes[0].get_legend().get_texts()]
        assert labels == ["rbw (1 runs)", "lvd (1 runs)"]
    plt.close("all")


def test_failures_are_counted(tmp_path):
    class Broken(maes.Controller):
        def decide(self, observation, ctx):
            raise ValueError("it is broken")

    study = maes.study(["rbw", Broken], [1, 2, 3], progress=False, **CAVE)
    found = study.columns("verdicts")
    assert found["failed_b"] == [3] and found["blocks"] == [3] and len(study.failures) == 3
    assert "Broken failed on 3 of 3 maps" in study.verdicts[0] and "it is broken" in study._repr_html_()


def flier(turn_rad, started, **attributes):
    """A class `Mine`, of which each run adds to a list."""

    class Mine(maes.Controller):
        is_new = True

        def decide(self, observation, ctx):
            if self.is_new and ctx.agent == 0:
                started.append(turn_rad)
            self.is_new = False
            motion = maes.Motion.turn(turn_rad) if observation.collision else maes.Motion.straight()
            return maes.Command(motion, maes.WakeCondition.TASK_DONE)

    for name, value in attributes.items():
        setattr(Mine, name, value)
    return Mine


def stamps(folder):
    return {file.name: file.stat().st_mtime_ns for file in (folder / "runs").iterdir()}


def test_class_without_a_version_runs_again(tmp_path):
    started, keys = [], {"out": tmp_path / "out", "progress": False, **CAVE}
    first = maes.study(["rbw", flier(2.0, started)], [1, 2], **keys).columns()
    before = stamps(tmp_path / "out")
    again = maes.study(["rbw", flier(2.0, started)], [1, 2], **keys).columns()
    assert started == [2.0] * 4 and again["digest"] == first["digest"]
    with ThreadPoolExecutor(1) as pool:
        for number, how in enumerate(({}, {"executor": pool})):
            turn_rad = 1.0 - number / 2
            edited = maes.study(["rbw", flier(turn_rad, started)], [1, 2], **how, **keys).columns()
            assert started[4 + 2 * number :] == [turn_rad] * 2
            assert edited["controller"] == first["controller"] == ["Mine", "Mine", "rbw", "rbw"]
            afresh = maes.study(["rbw", flier(turn_rad, [])], [1, 2], progress=False, **CAVE).columns()
            assert edited["digest"] == afresh["digest"] and edited["id"] == first["id"]
            pairs = list(zip(first["digest"], edited["digest"]))
            assert [one == other for one, other in pairs] == [False, False, True, True]
            table = (tmp_path / "out/runs.csv").read_text()
            assert all(digest in table for digest in edited["digest"]) and len(table.splitlines()) == 5
    after = stamps(tmp_path / "out")
    assert before.keys() == after.keys()
    of_rbw = {name for name, stamp in before.items() if after[name] == stamp}
    assert {name.partition(".")[0] for name in of_rbw} == set(first["id"][2:])


def test_refused_call_removes_nothing(tmp_path):
    keys = {"out": tmp_path / "out", "progress": False, **CAVE}
    maes.study(["rbw", flier(2.0, [])], [1, 2], **keys)
    before = stamps(tmp_path / "out")
    for seeds, jobs, why in (([1, 2], 0, "jobs = 0"), ([1], 1, "holds 2 runs that are not of this plan")):
        with pytest.raises(maes.BadInput, match=why):
            maes.study(["rbw", flier(1.0, [])], seeds, jobs=jobs, **keys)
        assert stamps(tmp_path / "out") == before


def test_runs_belong_to_the_version_of_a_class(tmp_path):
    started, keys = [], {"out": tmp_path / "out", "progress": False, **CAVE}
    first = maes.study(["rbw", flier(2.0, started, version=1)], [1, 2], **keys).columns()
    before = stamps(tmp_path / "out")
    kept = maes.study(["rbw", flier(1.0, started, version=1)], [1, 2], **keys).columns()
    assert kept == first and started == [2.0] * 2 and stamps(tmp_path / "out") == before
    with pytest.raises(maes.BadInput, match="holds 2 runs that are not of .*these versions.*prune=True"):
        maes.study(["rbw", flier(1.0, started, version="1")], [1, 2], **keys)
    assert started == [2.0] * 2 and stamps(tmp_path / "out") == before
    other = maes.study(["rbw", flier(1.0, started, version="1")], [1, 2], prune=True, **keys).columns()
    assert started == [2.0] * 2 + [1.0] * 2 and other["controller"] == first["controller"]
    assert set(other["id"]) & set(first["id"]) == set(first["id"][2:]), "those of rbw"
    ids = {of: maes.run(controller=flier(1.0, [], version=of), seed=1, **CAVE).metrics["id"] for of in (1, "1")}
    assert ids[1] in first["id"] and ids["1"] in other["id"]


def test_versions_are_texts_or_whole_numbers_of_the_class_itself(tmp_path):
    for version in ("", True, None, 1.5, b"1", lambda: 1):
        with pytest.raises(maes.BadInput, match="controller Mine: version = .*: expected a text that is not"):
            maes.study(["rbw", flier(2.0, [], version=version)], [1], progress=False, **CAVE)
    started = []

    class Heir(flier(2.0, started, version=1)):
        """Has edits of its own."""

    for _ in range(2):
        maes.study(["rbw", Heir], [1], out=tmp_path, progress=False, **CAVE)
    assert len(started) == 2


def test_maps_of_scenarios_are_found_from_the_folder_of_the_study(tmp_path, monkeypatch):
    maes.Map.generate("spheres", 20, seed=3).save(tmp_path / "cave.m3dm")
    monkeypatch.chdir(tmp_path)
    scenario = maes.Scenario(map={"kind": "file", "file": "cave.m3dm", "size": None}, duration=10.0)
    study = maes.study(["rbw", "lvd"], [1], scenario, out="elsewhere/deep", progress=False)
    assert not study.failures and len(study.columns()["id"]) == 2


def test_bad_input_is_named():
    with pytest.raises(maes.BadInput, match="two or more different ones"):
        maes.study(["rbw"], [1], progress=False)
    with pytest.raises(maes.BadInput, match="two or more different ones"):
        maes.study(["rbw", "rbw"], [1], progress=False)
    with pytest.raises(maes.BadInput, match="primary"):
        maes.study(["rbw", "lvd"], [1], primary="speed", progress=False)
    with pytest.raises(maes.BadInput, match="no-such"):
        maes.study(["rbw", "no-such"], [1], progress=False)
    for seeds in ([1.7, 2.2], "12", [True], [-1], [2**63], 3, ["1"], [None]):
        with pytest.raises(maes.BadInput, match="seeds? = .*: expected .*whole number"):
            maes.study(["rbw", "lvd"], seeds, progress=False, **CAVE)
    study = maes.study(["rbw", "lvd"], np.arange(1, 2), progress=False, **CAVE)
    assert study.columns()["seed"] == [1, 1]
    with pytest.raises(maes.BadInput, match="nothing.*verdicts"):
        study.columns("nothing")


def test_progress_is_left_out_without_tqdm(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    maes.study(["rbw", "lvd"], [1], **CAVE)
    assert capsys.readouterr().err == ""
    with pytest.raises(ImportError, match=r"maes\[progress\]"):
        maes.study(["rbw", "lvd"], [1], progress=True, **CAVE)
