"""A road for the tests of the ROS package."""

import pytest
from ros_messages import Drive, road


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    return road(tmp_path_factory.mktemp("road"))
