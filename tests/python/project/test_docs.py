"""The documentation's examples run as they stand, and print the output that the pages show."""

import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

DOCS = Path(__file__).resolve().parents[3] / "docs"
sys.path.insert(0, str(DOCS))
import gallery  # noqa: E402 (modules of the documentation)
import pages  # noqa: E402

import real_data  # noqa: E402

NOTEBOOKS = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.ipynb"))
# Languages that are run; those that are not code, or run by cargo.
RUN, NOT_RUN = {"python", "console"}, {"text", "sh", "json", "csv", "rust", "toml"}


def _pixels(file: io.BytesIO | Path) -> np.ndarray:
    return np.asarray(Image.open(file).convert("RGB"), np.int16)


@pytest.mark.slow
@pytest.mark.parametrize("page", pages.PAGES)
def test_the_examples_run_and_draw_the_pictures_that_are_shown(page: str, tmp_path: Path) -> None:
    _are_shown(pages.run(page, tmp_path), "make figures")


@pytest.mark.slow
@pytest.mark.parametrize("route", gallery.ROUTES)
def test_the_gallery_shows_what_the_real_routes_give(route: str) -> None:
    driven = gallery.drive(real_data.folder(), route)
    _are_shown(gallery.draw(route, driven), "docs/gallery.py")
    name, *counts = gallery.row(route, driven)
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert f"| {' | '.join(gallery.HEADINGS)} |" in text
    line = next(line for line in text.splitlines() if line.startswith(f"| {name} |"))
    shown = line.strip("| ").split(" | ")[1:]
    # Decoders of JPEG differ by a grey level here and there.
    np.testing.assert_allclose(list(map(int, counts)), list(map(int, shown)), atol=2)


def _are_shown(pictures: dict[str, bytes], how: str) -> None:
    for name, drawn in pictures.items():
        new, shown = _pixels(io.BytesIO(pages.few_colours(drawn))), _pixels(pages.IMAGES / name)
        assert new.shape == shown.shape, f"{name} is of another size: {how} draws it anew"
        dark = _pixels(pages.IMAGES / f"{Path(name).stem}-dark.png")
        assert dark.shape == new.shape, f"{name} on dark paper: {how} draws it anew"
        assert dark.mean() < new.mean()
        # Another matplotlib draws letters a little differently.
        assert np.abs(new - shown).mean() < 1, f"{name} shows something else: {how} draws it anew"


@pytest.mark.parametrize("page", pages.PAGES)
def test_every_block_is_of_a_kind_that_somebody_looks_after(page: str) -> None:
    for block in pages.blocks(page):
        assert block.language in RUN | NOT_RUN or block.language.startswith("{"), (
            f"{page}:{block.line}"
        )


@pytest.mark.parametrize("page", pages.PAGES)
def test_what_a_page_does_not_show_makes_nothing_but_its_pictures(page: str) -> None:
    for block in pages.blocks(page):
        assert not block.hidden or re.search(r"plot|draw\(", block.text), f"{page}:{block.line}"


@pytest.mark.parametrize("page", pages.PAGES)
def test_no_example_is_wider_than_the_page(page: str) -> None:
    for block in pages.blocks(page):
        shown = block.language in {"python", "rust", "text"} and not block.hidden
        assert not shown or max(map(len, block.text.splitlines())) <= 104, f"{page}:{block.line}"


@pytest.mark.parametrize("page", pages.PAGES)
def test_every_file_that_a_page_points_to_is_there(page: str) -> None:
    prose = pages.FENCE.sub("", (DOCS / page).read_text(encoding="utf-8"))
    for link in re.findall(r"\]\((?!https?:|#)([^)#]+)[^)]*\)", prose):
        assert ((DOCS / page).parent / link).exists(), link


def test_an_example_that_prints_something_else_is_found_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pages, "DOCS", tmp_path)
    for text, said in (
        ("```python\nprint(1 + 1)\n```\n\n```text\n3\n```\n", "page.md:2"),
        ("Words.\n\n```console\n$ echo one\none\n$ echo two\ntoo\n```\n", "page.md:4: echo two"),
    ):
        (tmp_path / "page.md").write_text(text)
        with pytest.raises(AssertionError, match=said):
            pages.run("page.md", tmp_path)


@pytest.mark.parametrize("notebook", NOTEBOOKS)
def test_a_notebook_is_kept_without_outputs(notebook: str) -> None:
    for cell in json.loads((DOCS / notebook).read_text(encoding="utf-8"))["cells"]:
        assert not cell.get("outputs"), cell["source"]
        assert cell.get("execution_count") is None, cell["source"]
