"""The packages that surefix needs only for some things."""

from importlib import import_module
from typing import Any

from surefix.errors import SurefixError

__all__ = ["needed"]


def needed(module: str, what: str, package: str, install: str) -> Any:
    """Imports an optional package.

    Raises
    ------
    SurefixError
        Where it is missing, or cannot be loaded: one line that says what to install.
    """
    try:
        return import_module(module)
    except ImportError as error:
        # One that is there and does not load, for want of a system library, says so itself.
        absent = isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]
        why = "which is not installed" if absent else f"which cannot be loaded ({error})"
        raise SurefixError(f'{what} takes {package}, {why}: pip install "{install}"') from None
