"""The README's Python runs as it stands."""

import re
from pathlib import Path

import pytest
from PIL import Image

from surefix.simulate import Route

README = Path(__file__).resolve().parents[3] / "README.md"


def test_the_python_block_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    route = Route(places=40, size=(64, 32))
    for day, drive in (("monday", route.reference()), ("tuesday", route.traverse(noise=0.1))):
        (tmp_path / "photos" / day).mkdir(parents=True)
        for index in range(40):
            Image.fromarray(drive[index]).save(tmp_path / "photos" / day / f"{index}.png")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert len(blocks) == 1
    exec(compile(blocks[0], "README.md", "exec"), {})
    assert "frame 39: at place 39" in capsys.readouterr().out
    assert (tmp_path / "route.safetensors").exists()


def test_every_file_that_it_points_to_is_there() -> None:
    text = README.read_text()
    links = re.findall(r"\]\((?!https?:|#)([^)#]+)[^)]*\)", text)
    links += re.findall(r'(?:src|srcset)="([^"]+)"', text)
    assert links
    for link in links:
        assert (README.parent / link).exists(), link
