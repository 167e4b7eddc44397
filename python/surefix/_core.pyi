"""The compiled part of surefix. Docstrings live in the Rust sources; stubtest holds these
signatures to the binary.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Sequence as _Sequence
from os import PathLike
from typing import Any, Literal, Protocol, SupportsFloat, SupportsIndex, TypeAlias, final

import numpy as np
import numpy.typing as npt

__version__: str
__all__ = [
    "Evaluation",
    "Fix",
    "FixStream",
    "Localizer",
    "Map",
    "Matcher",
    "Peak",
    "Post",
    "Route",
    "Run",
    "Running",
    "Sad",
    "Sequence",
    "Single",
    "Traverse",
    "Trust",
    "__version__",
    "bench_image_latency",
    "bench_latency",
    "bench_read",
    "decode_image",
    "evaluate",
    "evaluate_trust",
    "find_images",
    "fit_post",
    "instruction_set",
    "match",
    "match_distances",
    "read_image",
    "recall_at",
]

class _HasArray(Protocol):
    def __array__(self, *args: Any, **kwargs: Any) -> npt.NDArray[Any]: ...

class _HasDlpack(Protocol):
    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any: ...

class _Matches(Protocol):
    @property
    def place(self) -> npt.NDArray[np.int64]: ...
    @property
    def score(self) -> npt.NDArray[np.float32]: ...
    @property
    def ready(self) -> npt.NDArray[np.bool_] | None: ...
    @property
    def accepted(self) -> npt.NDArray[np.bool_] | None: ...

class _Frame(Protocol):
    @property
    def image(self) -> _Array | _Path: ...
    @property
    def gap(self) -> bool: ...
    @property
    def dropped(self) -> int: ...

class _Descriptor(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def recipe(self) -> Mapping[str, object]: ...
    def describe(self, images: _Sequence[npt.NDArray[np.uint8]], /) -> npt.NDArray[np.float32]: ...

_Array: TypeAlias = npt.NDArray[Any] | _HasArray | _HasDlpack
_Path: TypeAlias = str | PathLike[str]
_Progress: TypeAlias = Callable[[int, int], bool | None] | Literal[False] | None
_Gradient: TypeAlias = Literal["halved", "unhalved"]
_Floor: TypeAlias = Literal["running", "global"] | SupportsFloat
_Float32: TypeAlias = npt.NDArray[np.float32]
_Float64: TypeAlias = npt.NDArray[np.float64]
_Int64: TypeAlias = npt.NDArray[np.int64]
_Bool: TypeAlias = npt.NDArray[np.bool_]
_Truth: TypeAlias = _Array | list[int] | tuple[npt.ArrayLike, npt.ArrayLike]
_UInt8: TypeAlias = npt.NDArray[np.uint8]

@final
class Single:
    @property
    def place(self) -> int: ...
    @property
    def distance(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Peak:
    @property
    def place(self) -> int: ...
    @property
    def value(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Sequence:
    @property
    def place(self) -> int: ...
    @property
    def score(self) -> float: ...
    @property
    def anchors(self) -> int: ...
    @property
    def speed(self) -> float: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Fix:
    @property
    def frame(self) -> int: ...
    @property
    def trusted(self) -> bool: ...
    @property
    def place(self) -> int: ...
    @property
    def score(self) -> float: ...
    @property
    def single(self) -> Single: ...
    @property
    def gradient(self) -> Peak: ...
    @property
    def sequence(self) -> Sequence | None: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Sad:
    def __new__(
        cls,
        size: tuple[int, int] = (64, 32),
        patch: int = 8,
        dtype: npt.DTypeLike | Literal["u8", "f32"] = "u8",
    ) -> Sad: ...
    def describe(self, image: _Array) -> npt.NDArray[Any]: ...
    def thumbnail(self, image: _Array) -> _UInt8: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def patch(self) -> int: ...
    @property
    def dim(self) -> int: ...
    @property
    def dtype(self) -> Literal["u8", "f32"]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Map:
    @staticmethod
    def from_images(
        images: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: Sad | _Descriptor | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
        metric: Literal["cosine", "euclidean", "manhattan"] | str | None = None,
        post: Post | Iterable[Any] | None = None,
        cache: _Path | None = None,
    ) -> Map: ...
    @staticmethod
    def from_descriptors(
        descriptors: _Array,
        metric: Literal["cosine", "euclidean", "manhattan"] | str = "cosine",
        positions: npt.ArrayLike | None = None,
        names: Iterable[str] | None = None,
        *,
        screen: Literal["i8"] | None = None,
        post: Post | Iterable[Any] | None = None,
        recipe: Mapping[str, Any] | None = None,
    ) -> Map: ...
    @staticmethod
    def build(
        path: _Path,
        images: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: Sad | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
    ) -> None: ...
    @staticmethod
    def append(
        path: _Path,
        more: Map | _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
        descriptor: _Descriptor | None = None,
        *,
        positions: npt.ArrayLike | None = None,
        progress: _Progress = None,
        cache: _Path | None = None,
    ) -> None: ...
    def extended(self, more: Map) -> Map: ...
    @staticmethod
    def open(path: _Path, mmap: bool = False, *, screen: Literal["i8"] | None = None) -> Map: ...
    def with_screen(self, dtype: Literal["i8"]) -> Map: ...
    def save(self, path: _Path) -> None: ...
    def to_bytes(self) -> bytes: ...
    @staticmethod
    def from_bytes(data: bytes, screen: Literal["i8"] | None = None) -> Map: ...
    def verify(self) -> None: ...
    def slice(self, start: int, stop: int) -> Map: ...
    def distances(self, descriptor: _Array) -> _Float32: ...
    def __len__(self) -> int: ...
    @property
    def dim(self) -> int: ...
    @property
    def input_dim(self) -> int: ...
    @property
    def post(self) -> Post | None: ...
    @property
    def recipe(self) -> dict[str, Any] | None: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def metric(self) -> Literal["cosine", "euclidean", "manhattan"]: ...
    @property
    def screen(self) -> Literal["i8"] | None: ...
    @property
    def descriptor(self) -> Sad | None: ...
    @property
    def descriptors(self) -> npt.NDArray[Any]: ...
    @property
    def positions(self) -> _Float64 | None: ...
    @property
    def names(self) -> list[str] | None: ...

@final
class Post:
    def apply(self, vectors: _Array) -> _Float32: ...
    @property
    def input_dim(self) -> int: ...
    @property
    def output_dim(self) -> int: ...
    @property
    def steps(self) -> list[dict[str, Any]]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

def fit_post(references: _Array, steps: str) -> tuple[Post, _Float32]: ...

@final
class Running:
    def __new__(cls, dim: int | None = None, *, references: _Array | None = None) -> Running: ...
    def push(self, vector: _Array) -> _Float32: ...
    @property
    def count(self) -> int: ...
    def snapshot(self) -> bytes: ...
    @staticmethod
    def restore(blob: bytes) -> Running: ...
    def reset(self) -> None: ...

@final
class Matcher:
    def __new__(
        cls,
        places: SupportsIndex,
        *,
        sequence_length: SupportsIndex = 2,
        weight: SupportsFloat = 0.99,
        tolerance: SupportsIndex = 1,
        smoothing: SupportsIndex = 3,
        gradient: _Gradient | str = "halved",
        floor: _Floor | str = "running",
        speeds: Iterable[SupportsFloat] = [1.0],
    ) -> Matcher: ...
    def push(self, distances: _Array, trusted: bool | None = None) -> Fix: ...
    def gap(self) -> None: ...
    def reset(self) -> None: ...
    def snapshot(self) -> bytes: ...
    @staticmethod
    def restore(
        blob: bytes,
        *,
        sequence_length: SupportsIndex = ...,
        weight: SupportsFloat = ...,
        tolerance: SupportsIndex = ...,
        smoothing: SupportsIndex = ...,
        gradient: _Gradient | str = ...,
        floor: _Floor | str = ...,
        speeds: Iterable[SupportsFloat] = ...,
    ) -> Matcher: ...
    @property
    def places(self) -> int: ...
    @property
    def frames(self) -> int: ...

@final
class Localizer:
    def __new__(
        cls,
        map: Map,
        *,
        descriptor: _Descriptor | None = None,
        threads: SupportsIndex | None = None,
        sequence_length: SupportsIndex = 2,
        weight: SupportsFloat = 0.99,
        tolerance: SupportsIndex = 1,
        smoothing: SupportsIndex = 3,
        gradient: _Gradient | str = "halved",
        floor: _Floor | str = "running",
        speeds: Iterable[SupportsFloat] = [1.0],
    ) -> Localizer: ...
    def push(self, frame: _Array | _Path, trusted: bool | None = None) -> Fix: ...
    def stream(self, frames: _Path | int | Iterable[_Array | _Path | _Frame]) -> FixStream: ...
    def gap(self) -> None: ...
    def reset(self) -> None: ...
    def snapshot(self) -> bytes: ...
    @staticmethod
    def restore(
        map: Map,
        blob: bytes,
        *,
        descriptor: _Descriptor | None = None,
        threads: SupportsIndex | None = None,
        sequence_length: SupportsIndex = ...,
        weight: SupportsFloat = ...,
        tolerance: SupportsIndex = ...,
        smoothing: SupportsIndex = ...,
        gradient: _Gradient | str = ...,
        floor: _Floor | str = ...,
        speeds: Iterable[SupportsFloat] = ...,
    ) -> Localizer: ...
    @property
    def distances(self) -> _Float32: ...
    @property
    def looked_at(self) -> int: ...
    @property
    def map(self) -> Map: ...
    @property
    def threads(self) -> int: ...

@final
class FixStream(Iterator[Fix]):
    def __iter__(self) -> FixStream: ...
    def __next__(self) -> Fix: ...

@final
class Run:
    @property
    def place(self) -> _Int64: ...
    @property
    def score(self) -> _Float32: ...
    @property
    def trusted(self) -> _Bool: ...
    @property
    def anchors(self) -> _Int64: ...
    @property
    def ready(self) -> _Bool: ...
    @property
    def speed(self) -> _Float64: ...
    @property
    def single_place(self) -> _Int64: ...
    @property
    def single_distance(self) -> _Float32: ...
    @property
    def gradient_place(self) -> _Int64: ...
    @property
    def gradient_value(self) -> _Float32: ...
    def to_csv(self, path: _Path) -> None: ...
    def to_dataframe(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getitem__(self, key: SupportsIndex, /) -> Fix: ...

def match_distances(
    distances: _Array,
    *,
    floor: _Floor | str = "global",
    trusted: _Array | list[bool] | None = None,
    gaps: _Array | list[int] | None = None,
    sequence_length: SupportsIndex = 2,
    weight: SupportsFloat = 0.99,
    tolerance: SupportsIndex = 1,
    smoothing: SupportsIndex = 3,
    gradient: _Gradient | str = "halved",
    speeds: Iterable[SupportsFloat] = [1.0],
) -> Run: ...
def match(
    map: Map,
    queries: _Path | Iterable[_Path] | Iterable[_Array] | _Array | Traverse,
    *,
    trusted: _Array | list[bool] | None = None,
    gaps: _Array | list[int] | None = None,
    descriptor: _Descriptor | None = None,
    progress: _Progress = None,
    sequence_length: SupportsIndex = 2,
    weight: SupportsFloat = 0.99,
    tolerance: SupportsIndex = 1,
    smoothing: SupportsIndex = 3,
    gradient: _Gradient | str = "halved",
    floor: _Floor | str = "running",
    speeds: Iterable[SupportsFloat] = [1.0],
) -> Run: ...

@final
class Evaluation:
    @property
    def recall(self) -> _Float64: ...
    @property
    def precision(self) -> _Float64: ...
    @property
    def thresholds(self) -> _Float32: ...
    @property
    def false_positives(self) -> _Int64: ...
    def auc(self, upto: float) -> float: ...
    def auc_interval(
        self,
        upto: float,
        *,
        level: float = 0.95,
        samples: int = 1000,
        block: int | None = None,
        seed: int = 0,
    ) -> tuple[float, float]: ...
    def auc_difference_interval(
        self,
        other: Evaluation,
        upto: float,
        *,
        level: float = 0.95,
        samples: int = 1000,
        block: int | None = None,
        seed: int = 0,
    ) -> tuple[float, float]: ...
    def recall_at_precision(self, precision: float) -> float: ...
    def false_positives_at(self, recall: float) -> int | None: ...
    @property
    def max_recall(self) -> float: ...
    @property
    def best_f1(self) -> float: ...
    @property
    def best_f1_threshold(self) -> float: ...
    @property
    def judged(self) -> int: ...
    @property
    def correct(self) -> int: ...

@final
class Trust:
    @property
    def true_positives(self) -> int: ...
    @property
    def false_positives(self) -> int: ...
    @property
    def false_negatives(self) -> int: ...
    @property
    def true_negatives(self) -> int: ...
    @property
    def precision(self) -> float: ...
    @property
    def recall(self) -> float: ...
    @property
    def false_positive_rate(self) -> float: ...
    @property
    def share_trusted(self) -> float: ...

def evaluate(
    matches: Run | _Matches,
    truth: _Truth,
    tolerance: float = 1,
    recall: Literal["correct", "place_exists", "rejected"] | str = "correct",
) -> Evaluation: ...
def evaluate_trust(run: Run, truth: _Truth, tolerance: float = 1) -> Trust: ...
def recall_at(
    distances: _Array, truth: _Truth, ks: Iterable[int] = [1, 5, 10], tolerance: float = 1
) -> list[float]: ...
def read_image(path: _Path) -> _UInt8: ...
def decode_image(data: bytes, name: str = "image") -> _UInt8: ...
def find_images(place: _Path) -> list[str]: ...

@final
class Route:
    def __new__(
        cls,
        places: int = 1000,
        size: tuple[int, int] = (320, 160),
        spacing: float = 3.0,
        seed: int = 1,
    ) -> Route: ...
    def reference(self) -> Traverse: ...
    def revisit(
        self,
        *,
        light: float = ...,
        season: float = ...,
        lateral_offset: float = ...,
        speed_jitter: float = ...,
        occluders: float = ...,
        noise: float = ...,
        seed: int = ...,
    ) -> Traverse: ...
    def traverse(
        self,
        *,
        light: float = 0.0,
        season: float = 0.0,
        lateral_offset: float = 0.0,
        speed_jitter: float = 0.0,
        occluders: float = 0.0,
        noise: float = 0.0,
        seed: int = 0,
    ) -> Traverse: ...

@final
class Traverse:
    def __len__(self) -> int: ...
    def __getitem__(self, key: SupportsIndex, /) -> _UInt8: ...
    @property
    def positions(self) -> _Float64: ...
    def truth(self, reference: Traverse) -> _Int64: ...

# What `surefix bench` measures in Rust.
def instruction_set() -> str: ...
def bench_latency(
    places: int, sequence_length: int, pushes: int
) -> tuple[npt.NDArray[np.uint64], int]: ...
def bench_image_latency(
    places: int, sequence_length: int, pushes: int
) -> tuple[npt.NDArray[np.uint64], int]: ...
def bench_read(words: npt.NDArray[np.uint64], seconds: float, threads: int = 1) -> float: ...
