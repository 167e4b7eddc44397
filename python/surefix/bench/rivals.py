"""The rivals: which are installed, in which version, and how many threads they may use."""

import importlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from types import ModuleType
from typing import Any

__all__ = ["Rivals"]

# What is imported, what it is called, and what to install for it.
PACKAGES = (
    ("numpy", "NumPy", ("numpy",)),
    ("scipy.signal", "SciPy", ("scipy",)),
    ("PIL.Image", "Pillow", ("pillow",)),
    ("cv2", "OpenCV", ("opencv-python-headless", "opencv-python", "opencv-contrib-python")),
    ("faiss", "faiss", ("faiss-cpu", "faiss-gpu", "faiss")),
    ("simsimd", "simsimd", ("simsimd",)),
    ("threadpoolctl", "threadpoolctl", ("threadpoolctl",)),
)


@dataclass(frozen=True)
class Rivals:
    """The packages that are here, by the name of what is imported, and the installed versions by
    their own names.
    """

    modules: dict[str, ModuleType]
    versions: dict[str, str]

    @classmethod
    def find(cls) -> "Rivals":
        """Imports what there is."""
        modules, versions = {}, {}
        for module, title, packages in PACKAGES:
            try:
                modules[module] = importlib.import_module(module)
            except ImportError:
                continue
            versions[title] = next(filter(None, map(_version, packages)), "of an unknown version")
        return cls(modules, versions)

    def __getitem__(self, module: str) -> Any:
        """The module, or None."""
        return self.modules.get(module)

    @property
    def missing(self) -> Sequence[str]:
        """A sentence for each that is not installed."""
        return [
            f"{title} is not installed, so it is not compared: pip install 'surefix[bench]'"
            if module != "threadpoolctl"
            else f"{title} is not installed, so NumPy's matrix products use as many threads as they like: "
            "pip install 'surefix[bench]'"
            for module, title, _ in PACKAGES
            if module not in self.modules
        ]

    @contextmanager
    def limited(self, threads: int) -> Iterator[None]:
        """Inside, each rival uses so many threads."""
        with ExitStack() as stack:
            if pools := self["threadpoolctl"]:
                stack.enter_context(pools.threadpool_limits(threads))
            if cv2 := self["cv2"]:
                stack.callback(cv2.setNumThreads, cv2.getNumThreads())
                cv2.setNumThreads(threads)
            if faiss := self["faiss"]:
                stack.callback(faiss.omp_set_num_threads, faiss.omp_get_max_threads())
                faiss.omp_set_num_threads(threads)
            yield


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
