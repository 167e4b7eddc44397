"""Post-processing and maps of learned descriptors: against scikit-learn, and the same in every way
to use them.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.preprocessing import StandardScaler, normalize

import surefix
from commands import surefix_
from surefix.post import (
    Normalize,
    Pca,
    Post,
    RandomProjection,
    Running,
    Standardize,
    fit,
    standardized,
)

Rows = NDArray[np.float32]


def rows(count: int, dim: int, seed: int = 0) -> Rows:
    generator = np.random.default_rng(seed)
    mixed = generator.standard_normal((count, dim)) @ generator.standard_normal(
        (dim, dim)
    ) + generator.normal(size=dim)
    return mixed.astype(np.float32)


@pytest.mark.parametrize(("count", "dim"), [(60, 20), (20, 60), (30, 30), (200, 7), (9, 300)])
@pytest.mark.parametrize("whiten", [True, False])
def test_pca_is_that_of_scikit_learn(count: int, dim: int, whiten: bool) -> None:
    references, queries = rows(count, dim), rows(50, dim, 1)
    wanted = min(count - 1, dim) // 2
    chain = fit(references, [Pca(wanted, whiten=whiten)])
    theirs = PCA(wanted, whiten=whiten, svd_solver="full").fit(references.astype(np.float64))
    assert (chain.input_dim, chain.output_dim) == (dim, wanted)
    for vectors in (references, queries):
        expected = theirs.transform(vectors.astype(np.float64))
        ours = chain.apply(vectors)
        signs = np.sign((ours * expected).sum(axis=0))
        assert (signs == 1).all(), "and so is which of two opposite components is taken"
        np.testing.assert_allclose(ours, expected, rtol=0, atol=2e-4 * np.abs(expected).max())


def test_standardize_and_normalize_are_those_of_scikit_learn() -> None:
    references, queries = rows(40, 30), rows(25, 30, 1)
    references[:, 4] = 2.5
    queries[:, 4] = 7.0
    scaler = StandardScaler().fit(references.astype(np.float64))
    expected = scaler.transform(queries.astype(np.float64))
    expected[:, 4] = 0.0
    np.testing.assert_allclose(fit(references, [Standardize()]).apply(queries), expected, atol=1e-5)
    np.testing.assert_allclose(
        fit(references, [Normalize()]).apply(queries), normalize(queries), atol=1e-6
    )
    both = fit(references, [Standardize(), Normalize()]).apply(queries)
    np.testing.assert_allclose(both, normalize(expected), atol=1e-6)
    own = standardized(queries)
    np.testing.assert_allclose(own.mean(axis=0), 0.0, atol=1e-6)
    assert (own[:, 4] == 0).all()


def test_running_statistics_are_those_of_the_rows_so_far() -> None:
    references, queries = rows(40, 12), rows(25, 12, 1)
    running, after = Running(12), Running(references=references)
    mean, std = (
        references.astype(np.float64).mean(axis=0),
        references.astype(np.float64).std(axis=0),
    )
    seen: list[NDArray[np.float64]] = []
    for index, query in enumerate(queries):
        seen.append(query.astype(np.float64))
        so_far = np.array(seen)
        spread = so_far.std(axis=0)
        expected = (query - so_far.mean(axis=0)) / np.where(spread > 0, spread, 1)
        np.testing.assert_allclose(running.push(query), expected, atol=1e-5)
        # The references as one vector more: their mean, their variance.
        count = index + 2
        middle = (mean + so_far.sum(axis=0)) / count
        square = std**2 + (mean - middle) ** 2 + ((so_far - middle) ** 2).sum(axis=0)
        np.testing.assert_allclose(
            after.push(query), (query - middle) / np.sqrt(square / count), atol=1e-5
        )
    assert (running.count, after.count) == (25, 26)
    with pytest.raises(surefix.SurefixValueError, match="expected 12 values, got 11"):
        running.push(queries[0][1:])
    with pytest.raises(surefix.SurefixValueError, match="finite"):
        running.push(np.full(12, np.nan, np.float32))
    assert running.count == 25
    restored = Running.restore(running.snapshot())
    assert restored.count == 25
    np.testing.assert_array_equal(restored.push(references[0]), running.push(references[0]))
    blob = running.snapshot()
    for wrong in (b"", blob[:-1], blob[:-1] + b"?", surefix.Matcher(3).snapshot()):
        with pytest.raises(
            surefix.SurefixValueError, match="snapshot: damaged or not one of running statistics"
        ):
            Running.restore(wrong)
    running.reset()
    assert running.count == 0


def test_a_localizer_knows_its_drive() -> None:
    references, queries = rows(60, 50), 3 * rows(30, 50, 1) + 1
    steps = [Standardize("running"), Normalize()]
    route = surefix.Map.from_descriptors(references, post=steps)
    assert (
        repr(route.post)
        == "Post(Standardize(statistics='running'), Normalize(), from 50 to 50 numbers)"
    )
    np.testing.assert_array_equal(
        route.descriptors, fit(references, [Standardize(), Normalize()]).apply(references)
    )
    running = Running(references=references)
    expected = surefix.match(
        surefix.Map.from_descriptors(route.descriptors),
        normalize(np.array([running.push(query) for query in queries])),
    )
    run = surefix.match(route, queries)
    np.testing.assert_array_equal(run.place, expected.place)
    np.testing.assert_allclose(run.score, expected.score, atol=1e-6)
    localizer = surefix.Localizer(route)
    fixes = [localizer.push(query) for query in queries[:20]]
    localizer = surefix.Localizer.restore(route, localizer.snapshot())
    fixes += [localizer.push(query) for query in queries[20:]]
    assert [fix.score for fix in fixes] == run.score.tolist()
    localizer.reset()
    assert localizer.push(queries[0]) == fixes[0]
    assert surefix.Localizer(route).push(queries[3]).score != fixes[3].score


STEPS = [Standardize(), RandomProjection(40, seed=3), Pca(10), Normalize()]


def test_a_map_keeps_what_its_queries_go_through(tmp_path: Path) -> None:
    references, queries = rows(60, 50), rows(30, 50, 1)
    route = surefix.Map.from_descriptors(
        references, post=STEPS, recipe={"name": "mine", "size": [2, 3]}
    )
    assert (route.dim, route.input_dim) == (10, 50)
    chain = fit(references, STEPS)
    assert route.post == chain
    assert isinstance(route.post, Post)
    assert route.recipe == {"name": "mine", "size": [2, 3]}
    np.testing.assert_array_equal(route.descriptors, chain.apply(references))
    plain = surefix.Map.from_descriptors(chain.apply(references))
    np.testing.assert_array_equal(
        route.distances(queries[0]), plain.distances(chain.apply(queries[0]))
    )
    route.save(tmp_path / "route.safetensors")
    opened = surefix.Map.open(tmp_path / "route.safetensors")
    assert opened.post == chain
    assert opened.recipe == route.recipe
    expected = surefix.match(plain, chain.apply(queries))
    for one in (route, opened, surefix.Map.open(tmp_path / "route.safetensors", mmap=True)):
        run = surefix.match(one, queries)
        np.testing.assert_array_equal(run.score, expected.score)
        localizer = surefix.Localizer(one)
        assert [localizer.push(query) for query in queries] == [run[index] for index in range(30)]
    more = surefix.Map.from_descriptors(queries, post=route.post, recipe={"name": "another"})
    with pytest.raises(surefix.SurefixValueError, match=r'by the recipe .*"mine".*got .*"another"'):
        route.extended(more)
    more = surefix.Map.from_descriptors(queries, post=route.post, recipe=route.recipe)
    longer = route.extended(more)
    assert len(longer) == 90
    surefix.Map.append(tmp_path / "route.safetensors", more)
    np.testing.assert_array_equal(
        surefix.Map.open(tmp_path / "route.safetensors").descriptors, longer.descriptors
    )


def test_a_plain_reader_finds_the_chain_in_the_file(tmp_path: Path) -> None:
    from safetensors import safe_open

    references, query = rows(60, 50), rows(1, 50, 1)[0]
    route = surefix.Map.from_descriptors(references, "euclidean", post=[Standardize(), Pca(10)])
    route.save(tmp_path / "route.safetensors")
    with safe_open(tmp_path / "route.safetensors", "np") as file:
        entry = json.loads(file.metadata()["surefix"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    assert entry["version"] == 1
    assert entry["post"] == [{"step": "standardize"}, {"step": "pca", "dim": 10, "whiten": True}]
    vector = ((query - tensors["post.0.offset"]) * tensors["post.0.scale"]).astype(np.float32)
    vector = tensors["post.1.matrix"].astype(np.float64) @ (
        vector - tensors["post.1.offset"]
    ).astype(np.float32)
    distances = np.linalg.norm(tensors["descriptors"] - vector, axis=1)
    np.testing.assert_allclose(route.distances(query), distances, rtol=1e-5)


def test_vectors_appended_on_the_command_line_go_through_the_map_s_own_chain(
    tmp_path: Path,
) -> None:
    references, more = rows(60, 50), rows(8, 50, 1)
    route = surefix.Map.from_descriptors(
        references, "euclidean", post=STEPS, recipe={"name": "mine"}
    )
    file = tmp_path / "route.safetensors"
    route.save(file)
    np.save(tmp_path / "more.npy", more)
    np.save(tmp_path / "processed.npy", fit(references, STEPS).apply(more))
    surefix_("map", "append", file, tmp_path / "more.npy")
    longer = surefix.Map.open(file)
    np.testing.assert_array_equal(longer.descriptors[60:], fit(references, STEPS).apply(more))
    assert (longer.post, longer.recipe, len(longer)) == (route.post, route.recipe, 68)
    done = surefix_("map", "append", file, tmp_path / "processed.npy", code=1)
    assert "expected 50 values, got 10" in done.stderr
    assert len(surefix.Map.open(file)) == 68


MISTAKES = [
    (
        lambda r: fit(r, [Pca(60)]),
        "from 1 to 49, what 60 references of 50 numbers span|from 1 to 50",
    ),
    (lambda r: fit(r, [Pca(0)]), "pca dim"),
    (lambda r: fit(r, [Pca(-1)]), "expected dim to be a whole number, got -1"),
    (lambda r: fit(r, [RandomProjection(2.5)]), "expected dim to be a whole number, got 2.5"),  # type: ignore[arg-type]
    (lambda r: fit(r, [RandomProjection(2**62)]), "projection dim.*from 1 to 1048576"),
    (
        lambda r: fit(r, [Standardize("own")]),
        'expected statistics to be "references" or "running", got \'own\'',
    ),  # type: ignore[arg-type]
    (lambda r: fit(r, [Pca(3, whiten=1)]), "expected whiten to be True or False, got 1"),  # type: ignore[arg-type]
    (lambda r: fit(r, ["pca"]), "expected steps such as"),  # type: ignore[list-item]
    (lambda r: fit(r.astype(np.float64), [Normalize()]), "float64"),
    (lambda r: fit(r[0], [Normalize()]), "references"),
    (lambda r: fit(r[:1], [Normalize()]), "at least 2 places, got 1"),
    (
        lambda r: fit(r * 1e-30, [Standardize()]).apply(r * 1e30),
        "descriptor, standardized: expected finite numbers",
    ),
    (
        lambda r: surefix.Map.from_descriptors(r, recipe={"name": "x" * 2**20}),
        "1048576 are the most",
    ),
    (lambda r: fit(r, [Normalize()]).apply(r[:, 1:]), "expected 50 values, got 49"),
    (
        lambda r: surefix.Map.from_descriptors(r.astype(np.float16), post=[Normalize()]),
        "expected float32, got float16",
    ),
    (lambda r: surefix.Map.from_descriptors(r, recipe={"size": 3}), '"name"'),
    (lambda r: surefix.Map.from_descriptors(r, recipe={"name": object()}), "JSON"),
    (lambda r: surefix.Map.from_descriptors(r, recipe=3), "mapping"),  # type: ignore[arg-type]
    (
        lambda r: surefix.Map.from_descriptors(r[:, 1:], post=fit(r, [Normalize()])),
        "expected 50 values, got 49",
    ),
    (lambda r: Running(), "expected dim"),
    (lambda r: Running(0), "expected dim"),
    (lambda r: Running(2**60), "expected dim"),
]


@pytest.mark.parametrize("index", range(len(MISTAKES)))
def test_mistakes_are_named(index: int) -> None:
    call, message = MISTAKES[index]
    with pytest.raises(surefix.SurefixValueError, match=message):
        call(rows(60, 50))


class Corners:
    """A descriptor that is quickly made: the means of the image's parts."""

    name = "corners"

    def __init__(self, parts: int = 6) -> None:
        self.recipe = {"parts": parts}
        self.parts = parts
        self.calls: list[int] = []

    def describe(self, images: list[NDArray[np.uint8]]) -> Rows:
        self.calls.append(len(images))
        return np.array([self.one(image) for image in images], np.float32)

    def one(self, image: NDArray[np.uint8]) -> list[float]:
        grey = image.astype(np.float64).reshape(*image.shape[:2], -1).mean(axis=2)
        strips = np.array_split(grey, self.parts)
        return [part.mean() for strip in strips for part in np.array_split(strip, self.parts, 1)]


def test_a_map_of_images_by_a_learned_descriptor(tmp_path: Path) -> None:
    images = np.random.default_rng(0).integers(0, 256, (12, 30, 40, 3), np.uint8)
    for index, image in enumerate(images):
        from PIL import Image

        Image.fromarray(image).save(tmp_path / f"{index:02}.png")
    descriptor = Corners()
    vectors = descriptor.describe(list(images))
    route = surefix.Map.from_images(
        tmp_path, descriptor, post=[Standardize(), Normalize()], progress=False
    )
    np.testing.assert_array_equal(
        route.descriptors,
        surefix.Map.from_descriptors(vectors, post=[Standardize(), Normalize()]).descriptors,
    )
    assert route.recipe == {"name": "corners", "parts": 6}
    assert route.names == [f"{index:02}.png" for index in range(12)]
    assert route.descriptor is None
    route.save(tmp_path / "route.safetensors")
    opened = surefix.Map.open(tmp_path / "route.safetensors")
    localizer = surefix.Localizer(opened, descriptor=descriptor)
    by_vectors = surefix.Localizer(opened)
    expected = [by_vectors.push(vector) for vector in vectors]
    assert [localizer.push(image) for image in images] == expected
    localizer.reset()
    assert list(localizer.stream(tmp_path)) == expected
    restored = surefix.Localizer.restore(opened, localizer.snapshot(), descriptor=descriptor)
    assert restored.push(images[3]) == localizer.push(images[3])
    for queries in (images, list(images), str(tmp_path), vectors):
        run = surefix.match(opened, queries, descriptor=descriptor, progress=False)
        assert [run[index] for index in range(12)] == expected
    with pytest.raises(
        surefix.SurefixValueError, match=r"expected a descriptor \(36,\), or Localizer\(map"
    ):
        by_vectors.push(images[0])
    assert by_vectors.push(vectors[0]).frame == 12, "it is as it was"
    other = Corners()
    other.name = "edges"
    with pytest.raises(
        surefix.SurefixValueError, match='expected "corners", as the map\'s own, got "edges"'
    ):
        surefix.Localizer(opened, descriptor=other)
    with pytest.raises(surefix.SurefixValueError, match="on a map of such, got Corners"):
        surefix.Localizer(surefix.Map.from_images(images), descriptor=descriptor)
    with pytest.raises(
        surefix.SurefixValueError, match="expected a learned descriptor beside them"
    ):
        surefix.Map.from_images(images, post=[Normalize()])
    with pytest.raises(surefix.SurefixValueError, match="descriptors"):
        surefix.match(opened, images)


def test_a_descriptor_that_gives_something_else_leaves_the_localizer_as_it_was() -> None:
    images = np.random.default_rng(0).integers(0, 256, (5, 30, 40), np.uint8)
    descriptor = Corners()
    route = surefix.Map.from_images(images, descriptor, progress=False)
    localizer = surefix.Localizer(route, descriptor=descriptor)
    localizer.push(images[0])

    def broken(images: list[NDArray[np.uint8]]) -> Rows:
        raise RuntimeError("out of memory")

    good = descriptor.describe
    for describe, kind, message in (
        (broken, RuntimeError, "out of memory"),
        (lambda images: np.zeros(36, np.float32), surefix.SurefixValueError, r"shape \(1, dim\)"),
        (
            lambda images: np.zeros((1, 35), np.float32),
            surefix.SurefixValueError,
            "expected 36 values, got 35",
        ),
        (lambda images: np.full((1, 36), np.nan, np.float32), surefix.SurefixValueError, "finite"),
    ):
        descriptor.describe = describe  # type: ignore[method-assign]
        with pytest.raises(kind, match=message):
            localizer.push(images[1])
    descriptor.describe = good  # type: ignore[method-assign]
    assert localizer.push(images[1]).frame == 1


def test_numbers_of_numpy_are_numbers() -> None:
    rows = np.random.default_rng(2).standard_normal((12, 6), np.float32)
    first = fit(rows, [Pca(np.int64(3), whiten=np.bool_(True))])  # type: ignore[arg-type]
    assert first.apply(rows).tobytes() == fit(rows, [Pca(3, whiten=True)]).apply(rows).tobytes()
