"""Reads a page of HTML, and holds it to the rules that a browser forgives."""

from dataclasses import dataclass, field
from html.parser import HTMLParser

__all__ = ["Reader", "read"]

VOID = {"meta", "img", "source", "br", "link", "input"}


@dataclass
class Reader(HTMLParser):
    """Reads a page, and holds it to the rules."""

    open: list[str] = field(default_factory=list)
    ids: dict[str, str] = field(default_factory=dict)
    images: list[dict[str, str]] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    tags: set[str] = field(default_factory=set)
    text: str = ""
    language: str | None = None
    within: str | None = None

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attributes}
        self.tags.add(tag)
        self.links += [found[name] for name in ("src", "srcset", "href") if name in found]
        if tag == "html":
            self.language = found.get("lang")
        if tag == "img":
            self.images.append(found)
        if "id" in found:
            assert found["id"] not in self.ids, f"the id {found['id']} is there twice"
            self.ids[found["id"]] = ""
            self.within = found["id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag
        self.within = None

    def handle_data(self, text: str) -> None:
        if self.open and self.open[-1] == "script":
            return
        self.text += text
        if self.within is not None:
            self.ids[self.within] += text


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader
