"""Copies, by `copy` and by pickles in processes that were spawned."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import cloudpickle
import pytest

import maes


def pickled(value):
    return pickle.loads(pickle.dumps(value))


COPIES = [copy.copy, copy.deepcopy, pickled, lambda value: cloudpickle.loads(cloudpickle.dumps(value))]


@pytest.mark.parametrize("copied", COPIES)
def test_scenarios_and_maps_copy(copied, tmp_path):
    scenario = maes.Scenario(size=20, seed=4, lidar__range_m=7.3, agents=3)
    assert copied(scenario) == scenario and copied([scenario])[0]["lidar.range_m"] == 7.3
    shape = maes.Map.generate(size=(20, 24, 30), cell_m=0.5)
    assert copied(shape) == shape and copied(shape).cell_m == 0.5 and copied(shape).size == (20, 24, 30)
    shape.save(tmp_path / "map.m3dm")
    of_file = maes.Scenario(map={"kind": "file", "file": str(tmp_path / "map.m3dm"), "size": None})
    assert copied(of_file).map() == of_file.map()


def test_spawned_processes_take_them():
    scenario = maes.Scenario(size=20, agents=1)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(maes.Scenario.map, scenario).result() == scenario.map()
