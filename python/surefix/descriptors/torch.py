"""Any PyTorch module as a descriptor."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from surefix._extra import require
from surefix.descriptors.descriptor import check_one_each, checked_batch, checked_rows, in_batches
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD, NetworkInput
from surefix.errors import SurefixError, SurefixValueError, mismatch

if TYPE_CHECKING:
    import torch


class Torch:
    """A network in PyTorch as a descriptor: RGB images in; its output, flattened, is the vector.

    It runs in inference mode and as in ``module.eval()``; after each call the module is as before.
    On the CPU neither images nor vectors are copied.

    Needs PyTorch: see https://pytorch.org/get-started.

    Parameters
    ----------
    module : torch.nn.Module
        Takes (n, 3, H, W) float32, gives (n, ...).
    transform : callable, optional
        Makes a tensor (3, H, W) of a Pillow image in RGB, as torchvision's transforms do. Without
        it, images are resized to ``size`` (Pillow's antialiased bilinear, or
        ``resample="bicubic"``) and normalised.
    device : str or torch.device, optional
        The module is moved there; by default it stays where its parameters are.
    batch : int
        Images a run.
    name : str, optional
        For the map; ``torch:`` and the module's class by default.
    autocast : bool or torch.dtype
        True computes in the device's usual half precision, a type in that one; False, the default,
        in the module's.
    size : (int, int), optional
        Width and height, without a ``transform``; by default images stay as they are.
    mean, std : three floats, optional
        Of RGB / 255, without a ``transform``: ImageNet's by default, None for both leaves 0 to 1.
    resample : {"bilinear", "bicubic"}
    recipe : mapping, optional
        Additions to the recipe, such as the source of the weights.

    Raises
    ------
    SurefixError
        If PyTorch is missing.
    SurefixValueError
        If the module is none, or an option has a wrong value.

    Examples
    --------
    >>> from surefix.descriptors import Torch
    >>> backbone = torchvision.models.resnet18(weights="DEFAULT")   # doctest: +SKIP
    >>> backbone.fc = torch.nn.Identity()   # doctest: +SKIP
    >>> Torch(backbone, size=(320, 240)).describe(image).shape   # doctest: +SKIP
    (1, 512)
    """

    def __init__(
        self,
        module: "torch.nn.Module",
        transform: Callable[[Any], Any] | None = None,
        device: "str | torch.device | None" = None,
        batch: int = 8,
        name: str | None = None,
        autocast: "bool | torch.dtype" = False,
        *,
        size: tuple[int, int] | None = None,
        mean: Sequence[float] | None = IMAGENET_MEAN,
        std: Sequence[float] | None = IMAGENET_STD,
        resample: str = "bilinear",
        recipe: Mapping[str, object] | None = None,
    ) -> None:
        library = require("torch", "a PyTorch module", "PyTorch", "surefix[torch]")
        if not isinstance(module, library.nn.Module):
            raise mismatch("module", "a torch.nn.Module", type(module).__name__)
        if transform is not None and (size is not None or not callable(transform)):
            expected = "expected something to call with an image, and then no size"
            raise SurefixValueError(f"transform: {expected}")
        self.module, self.transform, self.autocast = module, transform, autocast
        self.batch = checked_batch(batch)
        self.name = name or f"torch:{type(module).__name__}"
        self._torch = library
        self._input = NetworkInput(size, mean, std, resample)
        here = next((tensor.device for tensor in module.parameters()), library.device("cpu"))
        try:
            self.device = here if device is None else library.device(device)
            if self.device != here:
                module.to(self.device)
        except (RuntimeError, AssertionError) as error:
            raise SurefixValueError(f"device: {_first_line(error)}") from None
        self._recipe = {
            "name": self.name,
            "kind": "torch",
            "module": type(module).__name__,
            "weights_sha256": _sha256(library, module),
            "autocast": str(autocast),
            **(self._input.recipe if transform is None else {"transform": repr(transform)}),
            **(recipe or {}),
        }

    @property
    def recipe(self) -> Mapping[str, object]:
        """The module's class, a SHA-256 of its initial weights, and the preparation of images."""
        return dict(self._recipe)

    def describe(
        self, images: Sequence[npt.NDArray[np.uint8]] | npt.NDArray[np.uint8]
    ) -> npt.NDArray[np.float32]:
        """The vectors of some images, (n, dim); of one image, given as an array, (1, dim).

        Raises
        ------
        SurefixValueError
            If an image is not uint8 (H, W) or (H, W, 3), or the output is not a finite vector an
            image.
        """
        with _evaluating(self.module):
            return in_batches(images, self.batch, self._run)

    def __repr__(self) -> str:
        kind = type(self.module).__name__
        return f"Torch({kind}, device={str(self.device)!r}, name={self.name!r})"

    def _run(self, images: list[npt.NDArray[np.uint8]], start: int) -> npt.NDArray[np.float32]:
        with self._torch.inference_mode(), self._precision():
            planes = self._planes(images).to(self.device, non_blocking=True)
            try:
                output = self.module(planes)
            except Exception as error:
                refused = f"the module does not run on images of the shape {tuple(planes.shape)}"
                raise SurefixValueError(f"{self.name}: {refused}: {_first_line(error)}") from error
            if not isinstance(output, self._torch.Tensor):
                count = len(images)
                expected = f"a module that gives a tensor, ({count}, ...) for {count} images"
                got = f"{type(output).__name__}; wrap it in one that picks the vector"
                raise mismatch(self.name, expected, got)
            check_one_each(tuple(output.shape), len(images), self.name)
            rows = np.from_dlpack(output.flatten(1).to("cpu", self._torch.float32).contiguous())
        names = [f"image {start + index} of the call" for index in range(len(images))]
        return checked_rows(rows, len(images), self.name, names)

    def _planes(self, images: list[npt.NDArray[np.uint8]]) -> Any:
        if self.transform is None:
            return self._torch.from_dlpack(self._input.batch(images))
        pillow = require("PIL.Image", "a transform of images", "Pillow", "surefix[torch]")
        planes = [self.transform(pillow.fromarray(image).convert("RGB")) for image in images]
        for index, plane in enumerate(planes):
            if not isinstance(plane, self._torch.Tensor) or plane.shape != planes[0].shape:
                tensor = isinstance(plane, self._torch.Tensor)
                got = str(tuple(plane.shape)) if tensor else type(plane).__name__
                got = f"{got} for image {index} of the batch"
                raise mismatch("transform", "tensors of one shape, (3, H, W)", got)
        return self._torch.stack(planes)

    def _precision(self) -> Any:
        dtype = None if self.autocast is True else self.autocast
        on = self.autocast is not False
        return self._torch.autocast(self.device.type, dtype=dtype) if on else nullcontext()


@contextmanager
def _evaluating(module: "torch.nn.Module") -> Iterator[None]:
    """As by ``eval()``; then each part in its former mode."""
    training = [part for part in module.modules() if part.training]
    module.eval()
    try:
        yield
    finally:
        for part in training:
            part.training = True


def _sha256(library: Any, module: "torch.nn.Module") -> str:
    """Of the names, types, shapes and bytes of all weights and buffers, ordered by name."""
    state = hashlib.sha256()
    for name, tensor in sorted(module.state_dict().items()):
        if not hasattr(tensor, "detach"):
            owner = type(module).__name__
            raise SurefixError(f"{owner}: expected a state of tensors, got {name} of another kind")
        flat = tensor.detach().cpu().contiguous().flatten()
        state.update(f"{name} {flat.dtype} {tuple(tensor.shape)}\0".encode())
        # As bytes: NumPy lacks some of PyTorch's types.
        state.update(memoryview(flat.view(library.uint8).numpy()))
    return state.hexdigest()


def _first_line(error: BaseException) -> str:
    return str(error).strip().split("\n")[0]
