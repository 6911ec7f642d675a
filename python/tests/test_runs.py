"""Scenarios, runs, results, maps and recordings."""

import threading

import numpy as np
import pytest

import maes

DIGEST = "bbddd99d65cf4f1d777d23d0e20749823dcb32e60a606440f80307bb8f94f4ed"


def test_default_run_has_the_digest_of_the_command():
    result = maes.run()
    assert result.digest == DIGEST
    assert result.reason == "explored" and result.explored == 1.0
    assert result.counters["scans"] == 10190


def test_scenario_is_checked_as_everywhere():
    with pytest.raises(maes.BadInput, match=r"agents\.count = 0: expected"):
        maes.Scenario(agents=0)
    with pytest.raises(maes.BadInput, match="unknown key `agents.cuont`; did you mean `agents.count`"):
        maes.Scenario(agents__cuont=3)
    with pytest.raises(maes.BadInput, match="did you mean `dsvp`"):
        maes.run(controller="dspv")
    with pytest.raises(TypeError, match="object has no place in a scenario"):
        maes.Scenario(seed=object())
    with pytest.raises(ValueError, match="duration_s"):
        maes.Scenario(duration=float("nan"))


def test_scenario_from_text_dictionary_and_keywords(small):
    assert maes.Scenario.from_toml(small.to_toml()) == small
    assert maes.Scenario(small.to_dict()) == small
    assert small["agents.count"] == 2 and small.duration_s == 60.0
    wide = small.replace(lidar__range_m=np.float64(12), agents=np.int64(3))
    assert wide["lidar.range_m"] == 12.0 and wide["agents.count"] == 3 and wide != small


def test_tables_are_those_of_a_plan(small):
    result = maes.run(small)
    assert result.metrics["digest"] == result.digest
    series = result.columns("series")
    assert series["t_s"][0] == 0.0 and series["explored"][-1] == result.explored
    assert set(result.columns("agents")["agent"]) == {0, 1}
    assert result.frame("runs", "pandas")["digest"][0] == result.digest
    with pytest.raises(maes.BadInput, match='expected "runs"'):
        result.columns("rows")
    with pytest.raises(ValueError, match="polars"):
        result.frame(library="numpy")


def test_notebooks_show_a_picture(small):
    assert maes.run(small)._repr_svg_().startswith("<?xml")


def test_recording_as_arrays(small, tmp_path):
    file = tmp_path / "run.mcap"
    result = maes.run(small, record=file)
    assert result.digest == maes.run(small).digest
    recording = maes.Recording(file)
    assert recording.result()["digest"] == result.digest
    assert recording.map() == small.map()
    poses = recording.poses(1)
    assert poses.position_m.shape == (len(poses.time_s), 3) and (np.diff(poses.time_s) > 0).all()
    seen = np.concatenate([scan.free for scan in recording.scans(0)])
    walls = small.map().walls().transpose(2, 1, 0).ravel()
    assert len(seen) == len(np.unique(seen)) and not walls[seen].any()
    topic = "/agent_0/command"
    commands = recording.messages(topic)
    assert len(commands) == recording.topics()[topic] and commands[0][1]["agent"] == 0
    assert recording.hits(0) == []
    with pytest.raises(maes.BadInput, match="0 to 1"):
        recording.poses(2)
    with pytest.raises(maes.BadInput, match="no such file|No such file"):
        maes.Recording(tmp_path / "none.mcap")


def test_hits_and_contacts_of_a_recording(small, tmp_path):
    file = tmp_path / "run.mcap"
    maes.run(small.replace(duration=5.0, views={"record": ["points", "contacts"]}), record=file)
    recording, walls = maes.Recording(file), small.map().walls()
    first = recording.hits(0)[0]
    # At the start an agent looks along x, so that its frame is that of the map, moved.
    assert first.time_s == 0.0 and first.point_m.dtype == np.float32 and len(first.point_m) > 100
    places = recording.poses(0).position_m[0] + first.point_m
    # On a face, so that one of the cells beside it is a wall.
    beside = [np.floor(places + step * first.point_m).astype(int) for step in (-1e-3, 1e-3)]
    assert (walls[tuple(beside[0].T)] | walls[tuple(beside[1].T)]).mean() > 0.99
    _, marker = recording.messages("/sim/contacts")[0]
    assert marker["type"] == 5 and len(marker["points"]) == 2
    with pytest.raises(maes.BadInput, match="0 to 1"):
        recording.hits(2)


def test_hits_are_those_of_each_lidar(small, tmp_path):
    file, camera = tmp_path / "run.mcap", {"name": "front", "preset": "depth-camera", "agents": [0]}
    lidars = [{"name": "top", "rays": 500}, camera]
    maes.run(small.replace(duration=2.0, lidars=lidars, views={"record": ["points"]}), record=file)
    recording = maes.Recording(file)
    assert (recording.lidars(0), recording.lidars(1)) == (["top", "front"], ["top"])
    top, front = recording.hits(0, "top"), recording.hits(0, "front")
    assert len(top) == len(front) > 5 and len(recording.hits(0)) == 2 * len(top)
    # The camera looks ahead.
    assert (front[0].point_m[:, 0] > 0).all() and (top[0].point_m[:, 0] < 0).any()
    with pytest.raises(maes.BadInput, match='lidar = "front": agent 1 has no such LiDAR; expected "top"'):
        recording.hits(1, "front")


def test_hits_are_the_same_with_further_fields(small, tmp_path):
    few = small.replace(duration=2.0, lidar={"rays": 2000})
    hits = []
    for name, fields in [("plain", []), ("fields", ["intensity", "time"])]:
        views = {"record": ["points"], "points_fields": fields}
        maes.run(few.replace(views=views), record=tmp_path / f"{name}.mcap")
        hits.append(maes.Recording(tmp_path / f"{name}.mcap").hits(0))
    assert len(hits[0]) == len(hits[1]) > 5
    for plain, with_fields in zip(*hits):
        assert np.array_equal(plain.point_m, with_fields.point_m) and len(plain.point_m) > 100


def test_fork_without_changes_is_the_run(small, tmp_path):
    file = tmp_path / "run.mcap"
    result = maes.run(small, record=file)
    assert maes.fork(file, at_s=5.0).digest == result.digest
    fork = maes.fork(file, at_s=5.0, controller="lvd")
    assert fork.digest != result.digest
    assert fork.metrics["controller"] == fork.columns("runs")["controller"][0] == "rbw, then lvd"
    assert maes.fork(file, at_s=0.0, controller="lvd").metrics["controller"] == "lvd"
    assert maes.fork(file, at_s=5.0, duration=8.0).metrics["controller"] == result.metrics["controller"] == "rbw"
    with pytest.raises(maes.BadInput, match="at_s = -1"):
        maes.fork(file, at_s=-1.0)
    with pytest.raises(maes.BadInput, match="at_s = 5000: expected a time of the recorded run"):
        maes.fork(file, at_s=5000.0)


def test_maps_and_arrays(tmp_path):
    made = maes.Map.generate("spheres", (30, 20, 25), seed=3, cell_m=0.5)
    walls = made.walls()
    assert walls.shape == made.size == (30, 20, 25) and walls.dtype == bool
    assert (~walls).sum() == made.free_cells
    assert maes.Map(walls, 0.5) == made
    made.save(tmp_path / "map.m3dm")
    assert maes.Map.load(tmp_path / "map.m3dm") == made
    vertices, triangles = made.to_mesh()
    assert vertices.max() <= 15.0 and triangles.max() == len(vertices) - 1
    # A closed surface has each edge in two triangles.
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert len(edges) % 2 == 0
    with pytest.raises(maes.BadInput, match="shape"):
        maes.Map(np.zeros((3, 3)))
    with pytest.raises(maes.BadInput):
        made.save(tmp_path / "map.docx")
    with pytest.raises(maes.BadInput, match="no free cell"):
        maes.Map(np.ones((9, 9, 9)))
    with pytest.raises(maes.BadInput, match="fill_ratio"):
        maes.Map.generate(fill_ratio=2.0)


def test_walls_are_indexed_x_y_z():
    walls = np.ones((9, 7, 8), dtype=bool)
    walls[2, 3, 4] = walls[3, 3, 4] = False
    made = maes.Map(walls)
    assert made.free_cells == 2 and not made.walls()[2, 3, 4] and not made.walls()[3, 3, 4]


def test_other_threads_run_meanwhile(small):
    digests = []
    threads = [threading.Thread(target=lambda: digests.append(maes.run(small).digest)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(digests) == 3 and len(set(digests)) == 1


def test_keys_that_follow_from_changed_ones_are_those_of_the_command():
    """What decides the defaults of other keys changes these as well, however it is given."""
    aerial = maes.Scenario().replace(body={"kind": "aerial"})
    assert aerial["body.speed_max_m_s"] == 3.0 and aerial == maes.Scenario(body__kind="aerial")
    assert aerial.replace(body={"kind": "ground"}) == maes.Scenario(body__kind="ground")
    assert aerial.replace(body={"kind": None}) == maes.Scenario()
    given = maes.Scenario(body={"speed_max_m_s": 1.5}).replace(body={"kind": "aerial"})
    assert given["body.speed_max_m_s"] == 1.5, "a value that is given stays"
    starts = [[5.5, 5.5, 5.5]] * 5
    for keys in (
        {"lidar": {"preset": "vlp-16"}},
        {"lidar__preset": "depth-camera"},
        {"spawn": {"kind": "list", "poses": starts}},
        {"map": {"kind": "building", "size": [40, 40, 13]}, "spawn": {"kind": "entrances"}},
        {"energy": {"endurance_s": 60.0}},
    ):
        assert maes.Scenario().replace(**keys) == maes.Scenario(**keys), keys
    camera = maes.Scenario(lidar={"preset": "vlp-16"}).replace(lidar={"preset": "depth-camera"})
    assert camera["lidar.pattern"] == "frustum" and camera["lidar.range_m"] == 4.5
    energy = maes.Scenario(energy={"endurance_s": 60.0}).replace(energy={"capacity_j": 60.0})
    assert "endurance_s" not in energy["energy"]


def test_replaced_scenario_is_the_run_of_the_command(tmp_path):
    short = {"agents": 1, "size": 30, "duration": 20.0, "controller": "dsvp"}
    # That of `maes run --transport memory --agents 1 --size 30 --duration 20 --controller dsvp
    # --set body.kind=aerial`.
    digest = "534819ed59897ec8bf6cb4866881d4fe28d847c6bf3b31b5207124ce42f64232"
    assert maes.run(body={"kind": "aerial"}, **short).digest == digest
    file = tmp_path / "submarine.mcap"
    maes.run(record=file, **short)
    for recorded in (maes.Scenario(file), maes.Recording(file).scenario):
        assert maes.run(recorded, body={"kind": "aerial"}).digest == digest
    assert maes.run(maes.Scenario.from_toml(maes.Scenario(**short).to_toml()), body__kind="aerial").digest == digest


def test_map_file_takes_the_place_of_a_generator(tmp_path, monkeypatch):
    maes.Map.generate(size=(20, 24, 30), cell_m=0.5).save(tmp_path / "map.m3dm")
    monkeypatch.chdir(tmp_path)
    of_file = maes.Scenario().replace(map={"kind": "file", "file": "map.m3dm"})
    assert of_file["map.cell_m"] == 0.5 and of_file.map().size == (20, 24, 30)
    assert of_file.replace(map={"kind": "spheres", "size": 50}) == maes.Scenario()


def test_recordings_have_names_that_are_found(small, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert maes.run(small, execution__record="key.mcap", duration=1.0).record == "key.mcap"
    assert maes.run(small, record="night/", duration=1.0).record == "night/"
    fork = maes.fork("key.mcap", at_s=0.5, execution={"record": "fork.mcap"})
    assert fork.record == "fork.mcap" and maes.run(small, duration=1.0).record is None
    assert {one.name for one in tmp_path.iterdir()} == {"key.mcap", "night", "fork.mcap"}
    for call in (lambda: maes.run(small, record="run.txt"), lambda: maes.fork("key.mcap", at_s=0.5, record="run")):
        with pytest.raises(maes.BadInput, match="record = 'run.*expected a name that ends in .mcap"):
            call()


def test_scenarios_have_all_keys(small):
    default = maes.Scenario()
    values = [default[key] for key in ("body.kind", "communication.model", "communication.loss", "stop_when_covered")]
    assert values == ["submarine", "line_of_sight_and_range", 0.0, False] and default["agents.base_stations"] == []
    for scenario in (default, small, maes.Scenario(body={"kind": "aerial"}, energy={"endurance_s": 60.0})):
        assert maes.Scenario(scenario.to_dict()) == scenario == maes.Scenario.from_toml(scenario.to_toml())
