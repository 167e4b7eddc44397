"""The optional packages."""

from importlib import import_module
from typing import Any

from surefix.errors import SurefixError


def require(module: str, what: str, package: str, install: str) -> Any:
    """Imports an optional package. If that fails, a SurefixError says in a line how to install it;
    ``what`` is the thing that takes it: "a video".
    """
    try:
        return import_module(module)
    except ImportError as error:
        # A package that is there may still lack a system library: then it says so itself.
        absent = isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]
        why = "which is not installed" if absent else f"which cannot be loaded ({error})"
        raise SurefixError(f'{what} takes {package}, {why}: pip install "{install}"') from None
