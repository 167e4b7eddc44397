"""Published models of visual place recognition, from their authors' repositories."""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from surefix._extra import require
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD
from surefix.descriptors.onnx import file_sha256
from surefix.descriptors.torch import Torch
from surefix.errors import SurefixError, SurefixValueError, mismatch

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True)
class HubModel:
    """A published model: its repository and entry point for torch.hub, and its images; the length
    of its descriptors, the licence of that repository ("unknown" if it was not found), the packages
    that its code imports, and the files in torch.hub's folder that its weights are kept in.
    """

    paper: str
    repository: str
    entry: str
    # Width and height of the images that the authors evaluate or train with.
    size: tuple[int, int]
    options: Mapping[str, object] = field(default_factory=dict)
    mean: tuple[float, float, float] = IMAGENET_MEAN
    std: tuple[float, float, float] = IMAGENET_STD
    resample: str = "bilinear"
    note: str = ""
    dim: int = 0
    licence: str = "unknown"
    packages: tuple[str, ...] = ("torch", "torchvision")
    weights: tuple[str, ...] = ()
    # Of weights that come from Hugging Face: owner and name.
    published: str = ""


# Vision transformers with patches of 14 pixels take sides that are multiples of it: 322 = 23 * 14.
HUB_MODELS: Mapping[str, HubModel] = MappingProxyType(
    {
        "netvlad": HubModel(
            "Arandjelovic et al., CVPR 2016; these weights by Ge et al., ECCV 2020 (OpenIBL)",
            "yxgeee/OpenIBL",
            "vgg16_netvlad",
            (640, 480),
            {"pretrained": True},
            # The mean of VGG's bytes; the spread of 1 / 255 leaves them bytes.
            (0.48501960784313836, 0.4579568627450961, 0.4076039215686255),
            (1 / 255, 1 / 255, 1 / 255),
            dim=4096,
            licence="MIT",
            weights=("vgg16_netvlad.pth",),
        ),
        "cosplace": HubModel(
            "Berton et al., CVPR 2022",
            "gmberton/CosPlace",
            "get_trained_model",
            (512, 512),
            {"backbone": "ResNet50", "fc_output_dim": 2048},
            dim=2048,
            weights=("ResNet50_2048_cosplace.pth",),
        ),
        "eigenplaces": HubModel(
            "Berton et al., ICCV 2023",
            "gmberton/EigenPlaces",
            "get_trained_model",
            (512, 512),
            {"backbone": "ResNet50", "fc_output_dim": 2048},
            dim=2048,
            licence="MIT",
            weights=("ResNet50_2048_eigenplaces.pth",),
        ),
        "mixvpr": HubModel(
            "Ali-bey et al., WACV 2023",
            "jarvisyjw/MixVPR",
            "get_trained_model",
            (320, 320),
            {"pretrained": True},
            resample="bicubic",
            note="its authors' repository, amaralibey/MixVPR, has no entry for torch.hub; "
            "this one is of a third party",
            dim=4096,
            packages=("torch", "torchvision", "pytorch_lightning"),
            weights=("model.ckpt",),
        ),
        "salad": HubModel(
            "Izquierdo and Civera, CVPR 2024",
            "serizba/salad",
            "dinov2_salad",
            (322, 322),
            dim=8448,
            packages=(
                "torch",
                "torchvision",
                "pytorch_lightning",
                "pytorch_metric_learning",
                "prettytable",
                "faiss",
            ),
            weights=("dino_salad.ckpt", "dinov2_vitb14_pretrain.pth"),
        ),
        "megaloc": HubModel(
            "Berton and Masone, 2025",
            "gmberton/MegaLoc",
            "get_trained_model",
            (322, 322),
            dim=8448,
            licence="MIT",
            packages=("torch", "torchvision", "huggingface_hub", "safetensors"),
            weights=("megaloc.torch",),
            published="gberton/MegaLoc",
        ),
        "anyloc": HubModel(
            "Keetha et al., RA-L 2023",
            "AnyLoc/DINO",
            "get_vlad_model",
            (322, 322),
            {"backbone": "DINOv2", "domain": "urban"},
            note="the other domains: indoor, aerial, structured, unstructured, global",
            dim=49152,
            licence="BSD-3-Clause",
            packages=("torch", "torchvision", "einops", "fast_pytorch_kmeans"),
            weights=(
                "anyloc_files/dinov2_vitg14_l31_value_c32_urban_c_centers.pt",
                "dinov2_vitg14_pretrain.pth",
            ),
        ),
    }
)
# Its entry point takes the device: moving it later makes another model.
_TOLD_DEVICE = "anyloc"


def from_hub(
    name: str,
    *,
    size: tuple[int, int] | None = None,
    device: "str | torch.device | None" = None,
    batch: int = 8,
    autocast: "bool | torch.dtype" = False,
    weights: str | PathLike[str] | None = None,
    **options: object,
) -> Torch:
    """A published model by its name, with its authors' image size and statistics.

    The first time, torch.hub downloads the code and the weights from GitHub, and **runs that
    code**; then it takes them from its own folder (``torch.hub.get_dir()``, or ``TORCH_HOME``): a
    robot needs no network, only a copy of that folder. Some need further packages, and name them.
    What that code prints goes to stderr.

    Parameters
    ----------
    name : str
        "netvlad", "cosplace", "eigenplaces", "mixvpr", "salad", "megaloc" or "anyloc": see
        ``HUB_MODELS``.
    size : (int, int), optional
        Width and height of the images, in place of the published ones; for salad, megaloc and
        anyloc multiples of 14.
    device, batch, autocast
        As for ``Torch``.
    weights : path, optional
        The file of the weights, as the authors publish it, in place of its download. The code is
        still torch.hub's, and so are the weights of another repository that a model is built on,
        such as DINOv2's.
    **options
        For the model's entry point, such as ``backbone="ResNet18", fc_output_dim=512`` for
        cosplace, or ``domain="indoor"`` for anyloc.

    Raises
    ------
    SurefixValueError
        For an unknown name; if the model's code reads no weights of its own, or none of this file.
    SurefixFileError
        If ``weights`` cannot be read.
    SurefixError
        If PyTorch is missing, or the model cannot be loaded; the error says how to get it.

    Examples
    --------
    >>> from surefix.descriptors import from_hub
    >>> network = from_hub("megaloc")   # doctest: +SKIP
    >>> route = surefix.Map.from_images("photos/monday", network)   # doctest: +SKIP
    """
    model = HUB_MODELS.get(name)
    if model is None:
        raise mismatch("name", f"one of {', '.join(HUB_MODELS)}", repr(name))
    library = require("torch", f"the model {name}", "PyTorch", "surefix[torch]")
    given = {**model.options, **options}
    kinds = (bool, int, float, str)
    plain = {key: value if isinstance(value, kinds) else str(value) for key, value in given.items()}
    recipe: dict[str, object] = {"repository": model.repository, "entry": model.entry}
    recipe["options"] = plain
    file = None if weights is None else Path(weights)
    if file is not None:
        recipe["weights"] = {"file": file.name, "sha256": file_sha256(file)}
    if name == _TOLD_DEVICE and device is not None:
        given["device"], device = str(device), None
    read: list[str] = []
    try:
        source, quiet = (model.repository, model.entry), {"trust_repo": True, "verbose": False}
        with redirect_stdout(sys.stderr), _downloading(library, model, file, read):
            module = library.hub.load(*source, **quiet, **given)
    except SurefixValueError:
        raise
    except Exception as error:
        if read:
            # The file was read, and the model does not take it: PyTorch says more in its next line.
            said = " ".join(str(error).split())[:200]
            raise SurefixValueError(f"{file}: not the weights of {name}: {said}") from error
        # That code may raise any error; without a network, it is one of four kinds.
        raise SurefixError(_refusal(name, model, given, error, library.hub.get_dir())) from error
    if file is not None and not read:
        expected = f"the weights that the code of {model.repository} reads"
        raise mismatch(f"weights {file}", expected, "a file that it did not ask for")
    return Torch(
        module,
        device=device,
        batch=batch,
        # Another backbone is another descriptor.
        name=f"hub:{name}" + "".join(f",{key}={value}" for key, value in sorted(options.items())),
        autocast=autocast,
        size=size or model.size,
        mean=model.mean,
        std=model.std,
        resample=model.resample,
        recipe=recipe,
    )


@contextmanager
def _downloading(
    library: Any, model: HubModel, file: Path | None, read: list[str]
) -> Iterator[None]:
    """With a file, the model's code gets that in place of its own download; ``read`` gets the
    addresses. Other repositories' weights are downloaded as ever.
    """
    if file is None:
        yield
        return
    hubs: list[tuple[Any, str, Callable[..., Any]]] = []

    def replace(owner: Any, function: str, instead: Callable[..., Any]) -> Any:
        usual = getattr(owner, function)
        hubs.append((owner, function, usual))
        setattr(owner, function, instead)
        return usual

    def from_url(url: str, *more: Any, **how: Any) -> Any:
        own = f"/{model.repository}/" in url
        if not own and PurePosixPath(urlsplit(url).path).name != file.name:
            return download(url, *more, **how)
        read.append(url)
        return _state(library, file)

    def from_hugging_face(repo_id: str, filename: str, *more: Any, **how: Any) -> Any:
        if repo_id != model.published:
            return fetch(repo_id, filename, *more, **how)
        read.append(f"{repo_id}/{filename}")
        return str(file)

    try:
        download = replace(library.hub, "load_state_dict_from_url", from_url)
        try:
            import huggingface_hub
        except ImportError:
            pass
        else:
            fetch = replace(huggingface_hub, "hf_hub_download", from_hugging_face)
        yield
    finally:
        for owner, function, usual in hubs:
            setattr(owner, function, usual)


def _state(library: Any, file: Path) -> Any:
    """The state of a module in a file of PyTorch or of safetensors; no code in it is run."""
    if file.suffix == ".safetensors":
        kept = require("safetensors.torch", f"{file}", "safetensors", "surefix[files]")
        return kept.load_file(file)
    try:
        return library.load(file, map_location="cpu", weights_only=True)
    except Exception as error:
        reason = str(error).strip().split("\n")[0]
        raise SurefixValueError(f"{file}: not the weights of a model: {reason}") from error


def _refusal(
    name: str, model: HubModel, options: Mapping[str, object], error: Exception, folder: str
) -> str:
    arguments = "".join(f", {key}={value!r}" for key, value in options.items())
    reason = str(error).strip().split("\n")[0] or type(error).__name__
    note = f" ({model.note})" if model.note else ""
    return (
        f"{name}: cannot load {model.entry} of https://github.com/{model.repository}{note}: "
        f"{reason}. Without a network, run torch.hub.load({model.repository!r}, {model.entry!r}"
        f"{arguments}) on a machine that has one, and copy its torch.hub.get_dir() to {folder}"
    )
