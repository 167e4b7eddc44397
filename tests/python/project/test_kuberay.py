"""The example for KubeRay: linted, its pods by the schema of Kubernetes, the rest by KubeRay's."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

import surefix

ROOT = Path(__file__).resolve().parents[3]
FILE = ROOT / "examples" / "kuberay.yaml"
RULES = "{extends: default, rules: {line-length: {max: 100}}}"
# KubeRay's API ray.io/v1: the fields of each part, and those that it must have.
CLUSTER = {
    "headGroupSpec", "workerGroupSpecs", "rayVersion", "enableInTreeAutoscaling",
    "autoscalerOptions", "headServiceAnnotations", "suspend",
}  # fmt: skip
HEAD = {"serviceType", "headService", "enableIngress", "rayStartParams", "template"}
WORKERS = {
    "groupName", "replicas", "minReplicas", "maxReplicas", "numOfHosts", "rayStartParams",
    "template", "scaleStrategy",
}  # fmt: skip


def cluster() -> dict[str, Any]:
    (document,) = yaml.safe_load_all(FILE.read_text(encoding="utf-8"))
    assert isinstance(document, dict)
    return document


def test_it_is_clean_yaml() -> None:
    config = pytest.importorskip("yamllint.config")
    linter = pytest.importorskip("yamllint.linter")
    found = linter.run(FILE.read_text(encoding="utf-8"), config.YamlLintConfig(RULES))
    assert [str(problem) for problem in found] == []


def test_its_fields_are_those_of_kuberay() -> None:
    document = cluster()
    assert (document["apiVersion"], document["kind"]) == ("ray.io/v1", "RayCluster")
    spec = document["spec"]
    assert set(document) == {"apiVersion", "kind", "metadata", "spec"}
    assert set(spec) <= CLUSTER
    groups = [
        (spec["headGroupSpec"], HEAD),
        *((each, WORKERS) for each in spec["workerGroupSpecs"]),
    ]
    for group, fields in groups:
        assert set(group) <= fields
        assert {"rayStartParams", "template"} <= set(group)
        assert all(isinstance(value, str) for value in group["rayStartParams"].values())
    for group in spec["workerGroupSpecs"]:
        assert {"groupName", "minReplicas", "maxReplicas"} <= set(group)
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]


def test_its_pods_are_those_of_kubernetes() -> None:
    schemas = pytest.importorskip("kubernetes_validate")
    spec = cluster()["spec"]
    for group in (spec["headGroupSpec"], *spec["workerGroupSpecs"]):
        pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": "one"}, **group["template"]}
        schemas.validate(pod, schemas.latest_version(), strict=True)
        pod["spec"]["colour"] = "red"
        with pytest.raises(schemas.ValidationError):
            schemas.validate(pod, schemas.latest_version(), strict=True)
        (container,) = pod["spec"]["containers"]
        mounted = {each["name"] for each in container.get("volumeMounts", ())}
        assert mounted == {each["name"] for each in pod["spec"].get("volumes", ())}


def test_versions_are_one() -> None:
    text = FILE.read_text(encoding="utf-8")
    images = set(re.findall(r"image: surefix-ray:(\S+)", text))
    images |= set(re.findall(r"surefix\[ray\]==([\d.]+)", text))
    assert images == {surefix.__version__}
    assert set(re.findall(r"rayproject/ray:([\d.]+)-", text)) == {cluster()["spec"]["rayVersion"]}
