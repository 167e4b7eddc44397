"""Published models of visual place recognition, from their authors' repositories."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from surefix._extra import require
from surefix.descriptors.network_input import IMAGENET_MEAN, IMAGENET_STD
from surefix.descriptors.torch import Torch
from surefix.errors import SurefixError, mismatch

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True)
class HubModel:
    """A published model: its repository and entry point for torch.hub, and its images."""

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
        ),
        "cosplace": HubModel(
            "Berton et al., CVPR 2022",
            "gmberton/CosPlace",
            "get_trained_model",
            (512, 512),
            {"backbone": "ResNet50", "fc_output_dim": 2048},
        ),
        "eigenplaces": HubModel(
            "Berton et al., ICCV 2023",
            "gmberton/EigenPlaces",
            "get_trained_model",
            (512, 512),
            {"backbone": "ResNet50", "fc_output_dim": 2048},
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
        ),
        "salad": HubModel(
            "Izquierdo and Civera, CVPR 2024", "serizba/salad", "dinov2_salad", (322, 322)
        ),
        "megaloc": HubModel(
            "Berton and Masone, 2025", "gmberton/MegaLoc", "get_trained_model", (322, 322)
        ),
        "anyloc": HubModel(
            "Keetha et al., RA-L 2023",
            "AnyLoc/DINO",
            "get_vlad_model",
            (322, 322),
            {"backbone": "DINOv2", "domain": "urban"},
            note="the other domains: indoor, aerial, structured, unstructured, global",
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
    **options: object,
) -> Torch:
    """A published model by its name, with its authors' image size and statistics.

    The first time, torch.hub downloads the code and the weights from GitHub, and **runs that
    code**; then it takes them from its own folder (``torch.hub.get_dir()``, or ``TORCH_HOME``): a
    robot needs no network, only a copy of that folder. Some need further packages, and name them.

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
    **options
        For the model's entry point, such as ``backbone="ResNet18", fc_output_dim=512`` for
        cosplace, or ``domain="indoor"`` for anyloc.

    Raises
    ------
    SurefixValueError
        For an unknown name.
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
    if name == _TOLD_DEVICE and device is not None:
        given["device"], device = str(device), None
    try:
        source, quiet = (model.repository, model.entry), {"trust_repo": True, "verbose": False}
        module = library.hub.load(*source, **quiet, **given)
    except Exception as error:
        # That code may raise any error; without a network, it is one of four kinds.
        raise SurefixError(_refusal(name, model, given, error, library.hub.get_dir())) from error
    kinds = (bool, int, float, str)
    plain = {key: value if isinstance(value, kinds) else str(value) for key, value in given.items()}
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
        recipe={"repository": model.repository, "entry": model.entry, "options": plain},
    )


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
