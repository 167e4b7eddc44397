"""What can go wrong. Each message says what was expected, what came, and where."""

__all__ = ["SurefixError", "SurefixFileError", "SurefixValueError"]


class SurefixError(Exception):
    """Every error of surefix. A call that raises one has left its object as it was."""


class SurefixValueError(SurefixError, ValueError):
    """An option, an array, an image, a map or a snapshot is not what it must be."""


class SurefixFileError(SurefixError, OSError):
    """The operating system refused a file or a folder."""
