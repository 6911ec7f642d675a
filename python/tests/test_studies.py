"""Studies of planners, and the verdicts of plans as tables."""

import sys

import matplotlib.pyplot as plt
import numpy as np
import pytest

import maes

CAVE = {"size": 30, "duration": 40.0, "agents": 2, "lidar__range_m": 6.0, "map__spheres__radius_max": 6}


class Still(maes.Controller):
    """Stays where it is."""

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


def flier(turn_rad):
    class Mine(maes.Controller):
        def decide(self, observation, ctx):
            motion = maes.Motion.turn(turn_rad) if observation.collision else maes.Motion.straight()
            return maes.Command(motion, maes.WakeCondition.TASK_DONE)

    return Mine


def test_edited_class_runs_again(tmp_path):
    keys = {"out": tmp_path / "out", "progress": False, **CAVE}
    first = maes.study(["rbw", flier(2.0)], [1, 2], **keys).columns()
    stamps = {file: file.stat().st_mtime_ns for file in (tmp_path / "out/runs").iterdir()}
    # The same text once more, as of a cell of a notebook, is the same code.
    assert maes.study(["rbw", flier(2.0)], [1, 2], **keys).columns() == first
    assert stamps == {file: file.stat().st_mtime_ns for file in (tmp_path / "out/runs").iterdir()}
    with pytest.raises(maes.BadInput, match="holds 2 runs that are not of .*this code.*prune=True"):
        maes.study(["rbw", flier(1.0)], [1, 2], **keys)
    edited = maes.study(["rbw", flier(1.0)], [1, 2], prune=True, **keys).columns()
    assert edited["controller"] == first["controller"] == ["Mine", "Mine", "rbw", "rbw"]
    pairs = list(zip(first["digest"], edited["digest"]))
    assert all(one != other for one, other in pairs[:2]) and all(one == other for one, other in pairs[2:])
    kept = [file for file, stamp in stamps.items() if file.exists() and file.stat().st_mtime_ns == stamp]
    assert len(kept) == 4, "those of rbw"
    single = maes.run(controller=flier(1.0), seed=1, **CAVE).metrics["id"]
    assert single != maes.run(controller=flier(2.0), seed=1, **CAVE).metrics["id"]
    assert single in edited["id"]


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
