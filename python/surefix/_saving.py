"""Files that are written beside their names, so that an older one stays whole until they are done.

The writer is that of Rust, which maps are saved with (``src/archive/atomic.rs``).
"""

import io
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, cast

from surefix._core import _AtomicFile, _is_stream
from surefix._words import plain
from surefix.errors import SurefixError, check_folder, refusal

__all__ = ["Kept", "edited", "save", "words_on_kept", "written"]

Kept = Callable[[Path, bool], object]
"""Is told where rows were kept, and whether those are of an earlier writer, which was killed."""


@contextmanager
def written(path: Path, problem: str, kept: Kept | None = None) -> Iterator[IO[bytes]]:
    """The file to write bytes to. It takes the place of ``path`` in the end; after an error there
    is nothing of it. What is no file, such as a pipe, is written itself.

    With ``kept`` the file is one of rows, each of use for itself. After an error or an
    interruption, those that there are stay beside ``path`` under a name that ``kept`` is told.

    Raises
    ------
    SurefixFileError
        If it cannot be written; it begins with the path and the ``problem``.
    """
    check_folder(path, problem)
    try:
        direct = path.open("ab") if _is_stream(path) else None
        part = None if direct is not None else _AtomicFile(path, kept is not None)
    except OSError as error:
        raise refusal(path, problem, error) from None
    if part is None:
        assert direct is not None
        with direct:
            yield direct
        return
    if kept is not None and part.left is not None:
        kept(part.left, True)
    file = _Part(part, lambda error: refusal(path, problem, error))
    try:
        yield cast(IO[bytes], file)
        file.end(part.commit)
    except BaseException:
        if kept is not None and (name := file.end(part.keep)) is not None:
            kept(name, False)
        raise
    finally:
        file.end(part.discard)


def save(path: Path, content: str | bytes, problem: str) -> None:
    """Writes a whole file.

    Raises
    ------
    SurefixFileError
        If it cannot be written; an older one is then as it was.
    """
    with written(path, problem) as file:
        file.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def edited(path: Path, problem: str) -> Iterator[Path]:
    """A file with the content of ``path``, for changes in several steps. It takes the place of
    ``path`` in the end; after an error there is nothing of it. No other writer can begin
    ``path`` meanwhile. Errors that name the file name ``path``.

    Raises
    ------
    SurefixFileError
        If it cannot be written; it begins with the path and the ``problem``.
    """
    target = path.resolve()
    folder = target.with_name(f".{target.name}.edited.part")
    copy = folder / target.name
    try:
        held = _AtomicFile(path, False)
    except OSError as error:
        raise refusal(path, problem, error) from None
    try:
        try:
            _copied(target, copy)
        except OSError as error:
            raise refusal(path, problem, error) from None
        try:
            yield copy
        except SurefixError as error:
            of_copy = plain(str(copy))
            if of_copy not in str(error):
                raise
            raise type(error)(str(error).replace(of_copy, str(path))) from None
        try:
            copy.replace(target)
        except OSError as error:
            raise refusal(path, problem, error) from None
        _sync_folder(target.parent)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        held.discard()


def _copied(target: Path, copy: Path) -> None:
    # Left of a writer that was killed.
    shutil.rmtree(copy.parent, ignore_errors=True)
    copy.parent.mkdir(0o700)
    try:
        # Enough, as whoever writes the copy replaces it.
        os.link(target, copy)
    except OSError:
        shutil.copy2(target, copy)


def _sync_folder(folder: Path) -> None:
    # Some systems do not open folders.
    with suppress(OSError):
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def words_on_kept(out: Path, kept: Path, earlier: bool) -> str:
    """Where rows were kept, in words."""
    if earlier:
        return f"{kept}: the rows of an earlier run to {out}, which was killed"
    return f"stopped: the rows so far are in {kept}, not in {out}"


class _Part(io.BufferedIOBase):
    """The part as Python's file. Buffers above it may still be closed when it has ended.

    It keeps no bytes back. Python's own buffer would: if Ctrl-C ends its flush behind the last
    byte, it writes all of them again.
    """

    def __init__(self, part: _AtomicFile, refused: Callable[[OSError], OSError]) -> None:
        self.part: _AtomicFile | None = part
        self.refused = refused
        self.length = 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        if self.part is None:
            return len(data)
        try:
            written = self.part.write(bytes(data))
        except OSError as error:
            raise self.refused(error) from None
        self.length += written
        return written

    def tell(self) -> int:
        return self.length

    def end(self, how: Callable[[], Path | None]) -> Path | None:
        """Ends the part in one of its ways, the first time."""
        if self.part is None:
            return None
        self.part = None
        try:
            return how()
        except OSError as error:
            raise self.refused(error) from None
