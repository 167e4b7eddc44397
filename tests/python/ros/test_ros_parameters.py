"""The node's parameters: all options, one clear error for each that is wrong."""

import re
from array import array
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_messages
import yaml
from surefix_ros.localization import Localization
from surefix_ros.parameters import PARAMETERS, checked

import surefix
from surefix.options import OPTIONS


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(ros_messages.road(tmp_path_factory.mktemp("road"))[0])


def test_every_option_of_the_method_is_a_parameter() -> None:
    names = [each.name for each in PARAMETERS]
    assert len({*names}) == len(names)
    assert {option.name for option in OPTIONS} <= {*names}


def test_the_defaults_are_those_of_surefix_run(file: str) -> None:
    node = Localization({"map": file})
    plain = surefix.Localizer(surefix.Map.open(file), motion="any")
    for image in ros_messages.road(Path(file).parent)[2][:9]:
        assert node.localizer.push(image) == plain.push(image)
    assert node.localizer.snapshot() == plain.snapshot()


def test_values_as_ros_gives_them(file: str) -> None:
    # Arrays are array.array, an empty one is of bytes, and whole numbers come without a point.
    given = {
        "map": file, "speeds": array("d", [0.5, 1.0]), "fuse": [], "weight": 1, "motion": "none",
        "technique_weights": array("q"), "floor": 0.25, "threads": 2,
    }  # fmt: skip
    found = checked(given)
    assert found["speeds"] == [0.5, 1.0]
    assert isinstance(found["weight"], float)
    node = Localization(given)
    expected = surefix.Settings(speeds=[0.5, 1.0], weight=1.0, floor=0.25)
    plain = surefix.Localizer(surefix.Map.open(file), config=expected)
    assert node.localizer.snapshot() == plain.snapshot()
    assert node.localizer.threads == 2


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, r"parameter map: expected a text \(a file from surefix map build\), got ''"),
        ({"map": 7}, r"parameter map: expected a text \(a file .*\), got 7"),
        ({"map": "nowhere.safetensors"}, r"nowhere.safetensors: cannot read the map"),
        ({"weight": "heavy"}, r"parameter weight: expected a number \(0 to 1\), got 'heavy'"),
        ({"weight": 2.0}, r"option `weight`: expected a number from 0 to 1, got 2"),
        ({"sequence_length": 2.5}, r"parameter sequence_length: expected a whole number \(from 1 "),
        ({"sequence_length": True}, r"parameter sequence_length: expected a whole number"),
        ({"sequence_length": 999}, r"option `sequence_length`: expected a whole number from 1 to"),
        ({"motion": "slow"}, r"motion: expected 'steady', 'free', 'any', 'none', got 'slow'"),
        ({"floor": "global"}, r"parameter floor: expected 'running' or a number, got 'global'"),
        ({"speeds": "0.9,1"}, r"parameter speeds: expected a list of numbers \(.*got '0.9,1'"),
        ({"speeds": ["a"]}, r"parameter speeds: expected a list of numbers \(.*got \['a'\]"),
        ({"fuse": [1.5]}, r"parameter fuse: expected a list of texts, got \[1.5\]"),
        ({"fuse": ["gone"]}, r"gone: cannot read the map"),
        ({"technique_weights": [1.0, 2.0]}, r"option `technique_weights`: expected one of each"),
        ({"accept": 95}, r"parameter accept: expected a number \(0 to 1\), got 95"),
        ({"gap": 0}, r"parameter gap: expected a number \(above 0\), got 0"),
        ({"every": float("nan")}, r"parameter every: expected a number \(0 or more\), got nan"),
        ({"metres": 2}, r"parameter metres: expected an odometry_topic too, got none"),
        ({"threads": -1}, r"parameter threads: expected a whole number \(0 or more\), got -1"),
        (
            {"places_per_metre": float("inf")},
            r"places_per_metre: expected a number \(finite\), got inf",
        ),
        ({"image_topic": ""}, r"parameter image_topic: expected a text \(not empty\), got ''"),
        ({"image_transport": "theora"}, r"expected 'raw', 'compressed', got 'theora'"),
        ({"image_reliability": 1}, r"expected 'best_effort', 'reliable', got 1"),
        ({"accepted_only": "yes"}, r"accepted_only: expected true or false, got 'yes'"),
        ({"config": "gone.toml"}, r"gone.toml"),
        ({"model": "net.onnx"}, r"parameter model: expected .*names none"),
        ({"speed": 1}, r"parameters: expected only those of surefix_ros, got speed"),
    ],
)
def test_a_wrong_parameter_is_one_clear_error(file: str, given: dict[str, Any], said: str) -> None:
    with pytest.raises(surefix.SurefixError) as error:
        Localization(({"map": file} if given else {}) | given)
    assert re.search(said, str(error.value)), error.value
    assert "\n" not in str(error.value)


def test_a_map_of_a_network_without_it_is_refused(tmp_path: Path) -> None:
    rows = np.eye(5, dtype=np.float32)
    recipe = {"name": "onnx:backbone.onnx"}
    surefix.Map.from_descriptors(rows, recipe=recipe).save(tmp_path / "map")
    with pytest.raises(surefix.SurefixError, match=r"parameter model: .*onnx:backbone.onnx"):
        Localization({"map": str(tmp_path / "map")})


def test_maps_of_several_techniques_are_fused(file: str, tmp_path: Path) -> None:
    images = ros_messages.road(Path(file).parent)[2]
    other = surefix.Map.from_images(images, descriptor=surefix.Sad(dtype="f32"))
    other.save(tmp_path / "other")
    given = {"map": file, "fuse": [str(tmp_path / "other")], "technique_weights": [1, 0.5]}
    node = Localization(given)
    assert len(node.localizer.maps) == 2
    surefix.Map.from_images(images[:9]).save(tmp_path / "short")
    with pytest.raises(surefix.SurefixError, match="expected a map of 60 places, got 9"):
        Localization(given | {"fuse": [str(tmp_path / "short")]})


def test_the_file_of_parameters_has_all_of_them_at_their_defaults() -> None:
    text = (ros_messages.PACKAGE / "config" / "params.yaml").read_text(encoding="utf-8")
    # An empty list cannot be given in ROS 2, so that it is a comment.
    whole = re.sub(r"# (\w+: \[\])$", r"\1", text, flags=re.MULTILINE)
    listed = yaml.safe_load(whole)["/**"]["ros__parameters"]
    assert listed == {each.name: each.default for each in PARAMETERS}
    assert [*listed] == [each.name for each in PARAMETERS]
    assert [] not in yaml.safe_load(text)["/**"]["ros__parameters"].values()
    assert max(map(len, text.splitlines())) <= 100
