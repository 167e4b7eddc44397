"""The optional packages, and the extras that install them."""

from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from surefix.errors import SurefixError

__all__ = ["ABSENT", "EXTRAS", "Extra", "Package", "drawing", "require"]


# Why a package cannot be imported that is not there.
ABSENT = "is not installed"


@dataclass(frozen=True)
class Package:
    """A package: the name by which it is imported, that of its distribution, and how it is called
    in a sentence.
    """

    module: str
    distribution: str
    title: str

    def look(self) -> tuple[str | None, str | None]:
        """The version, and why it cannot be imported, in a few words; it is imported for that."""
        try:
            module = import_module(self.module)
        # A broken installation may raise anything.
        except Exception as error:
            return None, _why(self.module, error)
        try:
            return version(self.distribution), None
        except PackageNotFoundError:
            # It came from another distribution, such as OpenCV with its windows.
            return str(getattr(module, "__version__", "unknown")), None


@dataclass(frozen=True)
class Extra:
    """An extra of the wheel: what it is for, and its packages."""

    name: str
    purpose: str
    packages: tuple[Package, ...]

    @property
    def command(self) -> str:
        """That installs it."""
        return f'pip install "surefix[{self.name}]"'


_BOKEH = Package("bokeh", "bokeh", "Bokeh")
_MATPLOTLIB = Package("matplotlib", "matplotlib", "matplotlib")
_PILLOW = Package("PIL", "pillow", "Pillow")
_SAFETENSORS = Package("safetensors", "safetensors", "safetensors")

# As in pyproject.toml, but for ``all`` and those of developers. The most wanted first.
EXTRAS = {
    extra.name: extra
    for extra in (
        Extra("report", "reports", (_BOKEH, _PILLOW, _MATPLOTLIB)),
        Extra("plot", "figures: surefix.plot", (_PILLOW, _MATPLOTLIB)),
        Extra("video", "videos", (Package("av", "av", "PyAV"),)),
        Extra(
            "bags",
            "ROS bags, MCAP files",
            (
                Package("mcap", "mcap", "mcap"),
                Package("mcap_protobuf", "mcap-protobuf-support", "mcap-protobuf-support"),
                Package("rosbags", "rosbags", "rosbags"),
            ),
        ),
        Extra("camera", "cameras", (Package("cv2", "opencv-python-headless", "OpenCV"),)),
        Extra("live", "the live view", (Package("rerun", "rerun-sdk", "rerun"),)),
        Extra(
            "learned",
            "ONNX networks",
            (Package("onnxruntime", "onnxruntime", "onnxruntime"), _PILLOW, _SAFETENSORS),
        ),
        Extra(
            "torch",
            "networks by name",
            (
                Package("torch", "torch", "PyTorch"),
                Package("torchvision", "torchvision", "torchvision"),
                Package("huggingface_hub", "huggingface-hub", "huggingface_hub"),
                _SAFETENSORS,
                _PILLOW,
            ),
        ),
        Extra("gps", "degrees of UTM zones", (Package("pyproj", "pyproj", "pyproj"),)),
        Extra("files", "HDF5 and safetensors", (Package("h5py", "h5py", "h5py"), _SAFETENSORS)),
        Extra("faiss", "faiss indices", (Package("faiss", "faiss-cpu", "faiss"),)),
        Extra(
            "heif",
            "HEIC, AVIF",
            (_PILLOW, Package("pillow_heif", "pillow-heif", "pillow-heif")),
        ),
        Extra("eval", "supervised methods", (Package("sklearn", "scikit-learn", "scikit-learn"),)),
        Extra("dataframe", "data frames", (Package("pandas", "pandas", "pandas"),)),
        Extra(
            "ray",
            "clusters: --ray, surefix.distributed",
            (Package("fsspec", "fsspec", "fsspec"), Package("ray", "ray", "Ray")),
        ),
        Extra("study", "tables of studies", (Package("pyarrow", "pyarrow", "PyArrow"),)),
    )
}


def require(module: str, what: str, package: str, install: str) -> Any:
    """Imports an optional package. If that fails, a SurefixError says in a line how to install it;
    ``what`` is the thing that takes it: "a video".
    """
    try:
        return import_module(module)
    except ImportError as error:
        why = f"which {_why(module, error)}"
        raise SurefixError(f'{what} takes {package}, {why}: pip install "{install}"') from None


def drawing(what: str = "a report") -> None:
    """Refuses what draws, before anything is computed, if a package that it draws with is missing.

    Raises
    ------
    SurefixError
        It names the package, and the extra that installs it.
    """
    for package in EXTRAS["report"].packages:
        require(package.module, what, package.title, "surefix[report]")


def _why(module: str, error: Exception) -> str:
    # A package that is there may still lack a system library: then it says so itself.
    absent = isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]
    return ABSENT if absent else f"cannot be loaded ({error})"
