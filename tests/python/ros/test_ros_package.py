"""The packages as ROS's own tools read them."""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ros_messages import PACKAGE, ROS2

import surefix

# Of Python's own, of surefix and of other libraries; and the package itself.
NOT_ROS = {*sys.stdlib_module_names, "numpy", "surefix", "surefix_ros", "typer", "yaml"}
NAMES = ("surefix_msgs", "surefix_ros")


@pytest.mark.parametrize("name", NAMES)
def test_package_xml_is_valid(name: str) -> None:
    package = pytest.importorskip("catkin_pkg.package")
    warnings: list[str] = []
    found = package.parse_package(str(ROS2 / name / "package.xml"), warnings=warnings)
    found.validate(warnings=warnings)
    assert not warnings
    assert (found.name, found.version) == (name, surefix.__version__)
    assert [person.name for person in found.maintainers] == ["The surefix developers"]
    assert found.licenses == ["MIT", "Apache-2.0"]


def test_all_that_is_imported_is_a_dependency() -> None:
    text = (PACKAGE / "package.xml").read_text(encoding="utf-8")
    named = {*re.findall(r"<exec_depend>(\w+)</exec_depend>", text)}
    imported = set()
    for file in [*PACKAGE.glob("surefix_ros/*.py"), *PACKAGE.glob("launch/*.py")]:
        for part in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(part, ast.Import):
                imported |= {each.name.partition(".")[0] for each in part.names}
            elif isinstance(part, ast.ImportFrom) and part.module:
                imported.add(part.module.partition(".")[0])
    assert imported - NOT_ROS == named - {"python3-numpy", "python3-yaml"}


@pytest.mark.slow
def test_what_colcon_installs_is_where_ros_looks_for_it(tmp_path: Path) -> None:
    pytest.importorskip("setuptools")
    # setup.py writes beside itself.
    source, root = tmp_path / "source", tmp_path / "root"
    shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__"))
    # As colcon-ros does it.
    install = ["install", "--root", str(root), "--prefix", "/ws"]
    record = ["--single-version-externally-managed", "--record", str(tmp_path / "record")]
    subprocess.run(
        [sys.executable, "-W", "ignore", "setup.py", "-q", *install, *record],
        cwd=source, check=True, capture_output=True, text=True,
    )  # fmt: skip
    share = root / "ws" / "share"
    assert (share / "ament_index/resource_index/packages/surefix_ros").is_file()
    for name in (
        "package.xml",
        "launch/localizer.launch.py",
        "config/params.yaml",
        "foxglove/surefix.json",
    ):
        assert (share / "surefix_ros" / name).read_bytes() == (PACKAGE / name).read_bytes()
    program = root / "ws" / "lib" / "surefix_ros" / "localizer"
    # So that a virtual environment with surefix is found.
    assert program.read_text(encoding="utf-8").startswith("#!/usr/bin/env python3\n")
    modules = {file.name for file in PACKAGE.glob("surefix_ros/*.py")}
    assert modules == {file.name for file in root.rglob("site-packages/surefix_ros/*.py")}
