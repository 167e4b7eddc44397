"""A file that is written beside its name, so that an older one stays whole until it is done."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from surefix.errors import check_folder, refusal


@contextmanager
def staged(path: Path, problem: str) -> Iterator[Path]:
    """The name to write to; moved to ``path`` in the end, and gone after an error. What is no
    file, such as a pipe, is written itself.

    Raises
    ------
    SurefixFileError
        If it cannot be written; it begins with the path and the ``problem``.
    """
    check_folder(path, problem)
    beside = path.with_name(f".{path.name}.part")
    try:
        if path.exists() and not path.is_file():
            yield path
            return
        try:
            yield beside
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise refusal(path, problem, error) from None
