"""Every public name of the package must be in the reference: a missing one is a warning, which ends
the build.
"""

import importlib
import pkgutil
from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util import logging

import surefix

# The command line has a reference of its own; the others serve it.
NOT_FOR_USERS = {
    *("auditing", "cli", "comparing", "comparison", "contradicting", "errors", "judged"),
    *("machine", "matches", "motion", "options", "settings_search", "tables", "tuning"),
}


def _modules() -> list[str]:
    names = [module.name for module in pkgutil.iter_modules(surefix.__path__)]
    public = [name for name in names if not name.startswith("_") and name not in NOT_FOR_USERS]
    return ["surefix", *(f"surefix.{name}" for name in public)]


def _check(app: Sphinx, env: BuildEnvironment) -> None:
    known = set(env.domains.python_domain.objects)
    for module in _modules():
        for name in importlib.import_module(module).__all__:
            if not name.startswith("__") and f"{module}.{name}" not in known:
                logging.getLogger(__name__).warning("%s.%s: not in the reference", module, name)


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("env-check-consistency", _check)
    return {"parallel_read_safe": True}
