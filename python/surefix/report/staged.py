"""A report's files come to their folder all at once."""

import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

__all__ = ["PAGE", "staged"]

PAGE = "report.html"


@contextmanager
def staged(folder: Path, old: Iterable[str] = ()) -> Iterator[Path]:
    """A folder in ``folder`` to write a report to: what is in it at the end takes the place of an
    earlier report.

    Where something stops the writing, the earlier report stays whole. Where something stops the
    moving, there is no page, and nothing of the earlier report.

    Parameters
    ----------
    folder : Path
    old : iterable of str
        Names of files that an earlier report may have and this one has not. All others stay as they
        are.

    Raises
    ------
    OSError
        Where a file cannot be written.
    """
    inside = Path(mkdtemp(prefix=".surefix-", dir=folder))
    try:
        yield inside
        _move(inside, folder, old)
    finally:
        shutil.rmtree(inside, ignore_errors=True)


def _move(inside: Path, folder: Path, old: Iterable[str]) -> None:
    """The page goes first and comes last."""
    new = {path.name for path in inside.iterdir()}
    gone = sorted({*old, *new}, key=lambda name: (name != PAGE, name))
    for path in (folder / name for name in gone):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    for name in gone:
        (folder / name).unlink(missing_ok=True)
    for name in sorted(new, key=lambda name: (name == PAGE, name)):
        (inside / name).replace(folder / name)
