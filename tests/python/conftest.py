"""Pages for tests that are not about their pictures."""

import io

import pytest


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each figure of a page is one grey dot: nothing is drawn."""
    page = pytest.importorskip("surefix.report.page", exc_type=ModuleNotFoundError)
    file = io.BytesIO()
    page.Image.new("RGB", (1, 1), "grey").save(file, "PNG")
    monkeypatch.setattr(page, "png", lambda draw, size, theme: file.getvalue())


@pytest.fixture
def light_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each figure of a page is drawn once, on light paper."""
    page = pytest.importorskip("surefix.report.page", exc_type=ModuleNotFoundError)
    monkeypatch.setattr(page.Picture, "dark", property(lambda picture: picture.light))
