"""Where the files of networks lie on this machine, by their checksums.

A map keeps the checksum of the network that it was made with, and no path: the same map is the same
file on every machine. The files that were used here are noted in ``models.json`` in the folder that
``SUREFIX_CACHE`` names, by default ``surefix`` in the user's folder for caches (``XDG_CACHE_HOME``,
or ``~/.cache``).
"""

import json
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from surefix._saving import save
from surefix.descriptors.onnx import file_sha256
from surefix.errors import SurefixError


def caches() -> Path:
    """The user's folder for caches."""
    given = os.environ.get("XDG_CACHE_HOME")
    return Path(given) if given else Path(os.path.expanduser("~")) / ".cache"


def noted() -> dict[str, Path]:
    """The files that were used on this machine, by their SHA-256."""
    try:
        read = json.loads(_list().read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    pairs = read.items() if isinstance(read, dict) else ()
    return {sum_: Path(path) for sum_, path in pairs if isinstance(path, str)}


def note(sha256: str, file: Path) -> None:
    """Notes where a file lies. If that cannot be written, it is not noted: the file has to be named
    the next time.
    """
    known, path = noted(), file.absolute()
    if known.get(sha256) == path:
        return
    text = json.dumps({key: str(value) for key, value in (known | {sha256: path}).items()})
    with suppress(OSError):
        _list().parent.mkdir(parents=True, exist_ok=True)
        save(_list(), text + "\n", "cannot note the network")


def find(sha256: str, name: str, folders: Iterable[Path]) -> Path | None:
    """The file of this SHA-256: of this name in one of the folders, or where it was used last; None
    if it is not there, or is another file now.
    """
    places = [folder / name for folder in folders if name]
    if (last := noted().get(sha256)) is not None:
        places.append(last)
    for place in dict.fromkeys(places):
        with suppress(SurefixError):
            if place.is_file() and file_sha256(place) == sha256:
                return place
    return None


def _list() -> Path:
    given = os.environ.get("SUREFIX_CACHE")
    return (Path(given) if given else caches() / "surefix") / "models.json"
