"""Files of ready descriptors: arrays of other libraries come back as they were; others are named."""

from pathlib import Path
from typing import Any

import faiss
import h5py
import numpy as np
import pytest
from safetensors.numpy import save_file

import surefix
from surefix.descriptors import load, metric_of

ROWS = np.random.default_rng(4).standard_normal((12, 7)).astype(np.float32)
UNIT = ROWS / np.linalg.norm(ROWS, axis=1, keepdims=True)


def write(path: Path, rows: Any, name: str = "rows", **more: Any) -> Path:
    if path.suffix == ".npy":
        np.save(path, rows)
    elif path.suffix == ".npz":
        np.savez(path, **{name: rows}, **more)
    elif path.suffix == ".safetensors":
        save_file({name: rows, **more}, path)
    else:
        with h5py.File(path, "w") as file:
            for key, array in {name: rows, **more}.items():
                file[key] = array
    return path


KINDS = [".npy", ".npz", ".safetensors", ".h5", ".hdf5"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", ["float32", "float16", "float64", "int8", "uint8"])
def test_rows_come_back_and_make_a_map(kind: str, dtype: str, tmp_path: Path) -> None:
    rows = (10 * ROWS).astype(dtype)
    got = load(write(tmp_path / f"a{kind}", rows))
    expected = rows.astype(np.float32) if dtype == "float64" else rows
    assert got.dtype == expected.dtype
    np.testing.assert_array_equal(got, expected)
    route = surefix.Map.from_descriptors(got, metric="euclidean")
    np.testing.assert_array_equal(route.descriptors, expected)
    assert metric_of(tmp_path / f"a{kind}") is None


def test_an_array_file_is_not_read_into_memory(tmp_path: Path) -> None:
    assert isinstance(load(write(tmp_path / "a.npy", ROWS)), np.memmap)


@pytest.mark.parametrize("kind", [".npz", ".safetensors", ".h5"])
def test_one_of_several_is_chosen_by_its_key(kind: str, tmp_path: Path) -> None:
    file = write(tmp_path / f"a{kind}", ROWS, names=np.arange(3, dtype=np.int8))
    np.testing.assert_array_equal(load(file, key="rows"), ROWS)
    with pytest.raises(surefix.SurefixValueError, match=r"names, rows.*got the key 'row'"):
        load(file, key="row")
    with pytest.raises(surefix.SurefixValueError, match=r"names, rows"):
        load(file)
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"names: expected descriptors \(n, dim\), got the shape \(3,\)",
    ):
        load(file, key="names")


def test_a_group_an_image_is_in_the_order_of_counting(tmp_path: Path) -> None:
    file = tmp_path / "global.h5"
    with h5py.File(file, "w") as out:
        for index in reversed(range(12)):
            group = out.create_group(f"day/frame{index}.jpg")
            group["global_descriptor"] = ROWS[index]
            group["image_size"] = [640, 480]
    np.testing.assert_array_equal(load(file, key="global_descriptor"), ROWS)
    with pytest.raises(
        surefix.SurefixValueError, match="data sets global_descriptor, image_size, got no key"
    ):
        load(file)
    with h5py.File(file, "a") as out:
        out["day/frame99.jpg/global_descriptor"] = ROWS[0, :3]
    with pytest.raises(
        surefix.SurefixValueError, match=r"frame99\.jpg/global_descriptor: expected a vector of 7"
    ):
        load(file, key="global_descriptor")


def test_references_and_queries_in_one_file_are_not_mixed(tmp_path: Path) -> None:
    """As hloc writes the features of two folders."""
    file = tmp_path / "global.h5"
    with h5py.File(file, "w") as out:
        for index in range(12):
            folder = "db/2024" if index < 8 else "query"
            out[f"{folder}/frame{index}.jpg/global_descriptor"] = ROWS[index]
    with pytest.raises(
        surefix.SurefixValueError,
        match=r"expected a key with the folder .* before: db/global_descriptor, or "
        r"\*/global_descriptor for all of them, got global_descriptor in db \(8\), query \(4\)",
    ):
        load(file, key="global_descriptor")
    for key in ("db/global_descriptor", "/db/2024/global_descriptor"):
        np.testing.assert_array_equal(load(file, key=key), ROWS[:8])
    np.testing.assert_array_equal(load(file, key="query/global_descriptor"), ROWS[8:])
    np.testing.assert_array_equal(load(file, key="*/global_descriptor"), ROWS)
    with pytest.raises(surefix.SurefixValueError, match="got the key 'map/global_descriptor'"):
        load(file, key="map/global_descriptor")


@pytest.mark.parametrize("kind", [".npy", ".npz", ".h5"])
def test_numbers_of_another_byte_order(kind: str, tmp_path: Path) -> None:
    got = load(write(tmp_path / f"a{kind}", ROWS.astype(">f4")))
    np.testing.assert_array_equal(got, ROWS)
    np.testing.assert_array_equal(surefix.Map.from_descriptors(got).descriptors, ROWS)


@pytest.mark.parametrize(
    ("make", "rows", "metric"), [("L2", ROWS, "euclidean"), ("IP", UNIT, "cosine")]
)
def test_a_flat_index_gives_its_vectors_and_its_metric(
    make: str, rows: Any, metric: str, tmp_path: Path
) -> None:
    index = getattr(faiss, f"IndexFlat{make}")(7)
    index.add(rows)
    file = tmp_path / "a.faiss"
    faiss.write_index(index, str(file))
    np.testing.assert_array_equal(load(file), rows)
    assert metric_of(file) == metric
    route = surefix.Map.from_descriptors(load(file), metric=metric)
    # The index itself ranks them in the same way.
    query = np.random.default_rng(1).standard_normal(7).astype(np.float32)
    ranked = index.search(query[None], 12)[1][0]
    np.testing.assert_array_equal(np.argsort(route.distances(query)), ranked)


def test_other_indices_are_refused(tmp_path: Path) -> None:
    def refused(index: Any, message: str) -> None:
        faiss.write_index(index, str(tmp_path / "a.index"))
        with pytest.raises(surefix.SurefixValueError, match=message):
            load(tmp_path / "a.index")

    with_ids = faiss.IndexIDMap(faiss.IndexFlatL2(7))
    with_ids.add_with_ids(ROWS, np.arange(12)[::-1].astype(np.int64).copy())
    refused(with_ids, "expected a flat index .* got IndexIDMap")
    graph = faiss.IndexHNSWFlat(7, 4)
    graph.add(ROWS)
    refused(graph, "got IndexHNSWFlat")
    long = faiss.IndexFlatIP(7)
    long.add(ROWS)
    refused(long, "expected vectors of unit length")
    refused(faiss.IndexFlatL2(7), r"expected descriptors \(n, dim\), got the shape \(0, 7\)")
    refused(faiss.IndexFlat(7, faiss.METRIC_L1), "expected an index of L2 or of inner products")


@pytest.mark.parametrize("kind", [*KINDS, ".faiss"])
def test_what_is_no_such_file_is_named(kind: str, tmp_path: Path) -> None:
    with pytest.raises(surefix.SurefixFileError, match="cannot read the descriptors: No such file"):
        load(tmp_path / f"no{kind}")
    file = tmp_path / f"bad{kind}"
    for content in (b"", b"something else", bytes(200)):
        file.write_bytes(content)
        with pytest.raises(surefix.SurefixValueError, match=rf"bad\{kind}: not an? \S+ "):
            load(file)
    if kind != ".faiss":
        whole = write(tmp_path / f"a{kind}", ROWS).read_bytes()
        file.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(surefix.SurefixValueError, match=rf"bad\{kind}: not an? \S+ "):
            load(file)
    if kind in (".npy", ".faiss"):
        with pytest.raises(surefix.SurefixValueError, match="expected no key"):
            load(file, key="rows")


def test_other_endings_and_other_numbers_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1 2 3")
    with pytest.raises(
        surefix.SurefixValueError, match=r"expected a file that ends in \.npy, \.npz, .*\.index"
    ):
        load(tmp_path / "a.txt")
    for rows, got in (
        (ROWS.astype(complex), "complex"),
        (ROWS > 0, "bool"),
        (ROWS.astype(np.int64), "int64"),
    ):
        with pytest.raises(
            surefix.SurefixValueError, match=f"expected descriptors of float32.*got {got}"
        ):
            load(write(tmp_path / "a.npy", rows))
    with pytest.raises(surefix.SurefixValueError, match=r"got the shape \(2, 6, 7\)"):
        load(write(tmp_path / "a.npy", ROWS.reshape(2, 6, 7)[:, :, :].copy()))
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(surefix.SurefixValueError, match="got one of Python objects"):
        load(tmp_path / "a.npy")


def test_a_tensor_that_numpy_has_no_type_for_is_refused(tmp_path: Path) -> None:
    header = b'{"rows":{"dtype":"BF16","shape":[2,3],"data_offsets":[0,12]}}'
    (tmp_path / "a.safetensors").write_bytes(len(header).to_bytes(8, "little") + header + bytes(12))
    with pytest.raises(surefix.SurefixValueError, match=r"a\.safetensors"):
        load(tmp_path / "a.safetensors")
