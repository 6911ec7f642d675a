"""What the trainings share. Each file is of one library, and trains for less than a minute."""

import pytest
import torch

CAVE = {"size": 20, "duration": 30.0, "map__spheres__radius_max": 5, "crop_radius": 2, "frontiers": 8}


@pytest.fixture(autouse=True)
def one_thread():
    """The networks are so small that more threads only wait for each other."""
    torch.set_num_threads(1)
    torch.manual_seed(1)


@pytest.fixture
def cave():
    """Arguments of small worlds with a short episode."""
    return dict(CAVE)
