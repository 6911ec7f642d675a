"""Small scenarios, shared by the tests."""

import pytest

import maes


@pytest.fixture
def small() -> maes.Scenario:
    """Two agents in a small cave, for a minute of sim time."""
    return maes.Scenario(size=40, agents=2, seed=7, duration=60.0, map={"spheres": {"radius_max": 5}})
