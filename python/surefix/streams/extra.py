"""The packages that a stream needs and surefix does not."""

from importlib import import_module
from typing import Any

from surefix.errors import SurefixError

__all__ = ["load_extra"]


def load_extra(module: str, extra: str, what: str) -> Any:
    """An optional package's module.

    Raises
    ------
    SurefixError
        Where it is not installed: the error says what to install.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        # One that is there and does not load, for want of a system library, says so itself.
        why = "is not installed" if isinstance(error, ModuleNotFoundError) and error.name == package else str(error)
        raise SurefixError(f'{what} needs the package {package} ({why}): pip install "surefix[{extra}]"') from None
