"""Data sets whose images correspond by number or by a truth beside them, on trees with the
publishers' layout.
"""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import real_data
import surefix
from surefix import datasets


def write_images(folder: Path, names: list[str], level: int = 0) -> None:
    """One image a name, told apart by its grey level."""
    folder.mkdir(parents=True)
    for index, name in enumerate(names):
        Image.new("RGB", (16, 8), (level + index, level + index, level + index)).save(
            folder / name, quality=100
        )


@pytest.fixture
def gardens(tmp_path: Path) -> Path:
    for walk in ("day_left", "day_right", "night_right"):
        write_images(tmp_path / walk, [f"Image{i:03d}.jpg" for i in range(12)])
    return tmp_path


@pytest.fixture
def railway(tmp_path: Path) -> Path:
    for level, season in enumerate(("summer", "winter", "fall", "spring")):
        for section, start in ((1, 0), (2, 98)):
            names = [f"{start + i}.png" for i in (3, 1, 0, 2)]
            write_images(
                tmp_path / f"Dataset_images/test/{season}_images_test/section{section}",
                names,
                50 * level,
            )
    return tmp_path


class TestGardensPoint:
    def test_it_pairs_the_walks_by_number(self, gardens: Path) -> None:
        pair = datasets.gardens_point(gardens, query="night_right")
        assert pair.name == "Gardens Point day_left / night_right"
        assert len(pair.references) == len(pair.queries) == 12
        assert pair.references.names[:2] == ["Image000.jpg", "Image001.jpg"]
        assert pair.truth is not None
        assert pair.truth.dtype == np.int64
        np.testing.assert_array_equal(pair.truth, np.arange(12))
        assert pair.reference_positions is pair.query_positions is None
        assert "zenodo.org" in pair.source

    def test_the_images_are_read_when_asked_for(self, gardens: Path) -> None:
        pair = datasets.gardens_point(gardens)
        (gardens / "day_left" / "Image005.jpg").write_bytes(b"no image")
        assert pair.references[4].shape == (8, 16, 3)
        assert [int(image[0, 0, 0]) for image in pair.queries] == list(range(12))
        with pytest.raises(surefix.SurefixValueError, match="Image005"):
            pair.references[5]

    @pytest.mark.parametrize("walk", ["day_left", "day_right"])
    def test_a_missing_walk_is_named_with_its_source(self, gardens: Path, walk: str) -> None:
        (gardens / walk).rename(gardens / "elsewhere")
        with pytest.raises(surefix.SurefixFileError) as said:
            datasets.gardens_point(gardens)
        for part in (str(gardens / walk), "images of the walk", "zenodo.org", "Licence:"):
            assert part in str(said.value)
        assert "\n" not in str(said.value)

    def test_an_image_that_one_walk_lacks_is_named(self, gardens: Path) -> None:
        (gardens / "day_right" / "Image007.jpg").unlink()
        with pytest.raises(
            surefix.SurefixValueError, match=r"the query traverse lacks 1, such as Image007\.jpg"
        ):
            datasets.gardens_point(gardens)

    def test_an_unknown_walk_is_refused(self, gardens: Path) -> None:
        with pytest.raises(surefix.SurefixValueError, match="query: expected one of day_left"):
            datasets.gardens_point(gardens, query="night_left")

    def test_an_empty_walk_is_refused(self, gardens: Path) -> None:
        for path in (gardens / "day_left").iterdir():
            path.unlink()
        with pytest.raises(surefix.SurefixValueError, match="day_left"):
            datasets.gardens_point(gardens)

    def test_the_real_walk(self) -> None:
        pair = datasets.gardens_point(real_data.folder() / "gardens_point")
        assert pair.truth is not None
        np.testing.assert_array_equal(pair.truth, np.arange(100))
        assert pair.references[99].shape == (540, 960, 3)
        from_paths = surefix.Map.from_images(pair.references[:5].paths or [], progress=False)
        from_arrays = surefix.Map.from_images(pair.references[:5], progress=False)
        np.testing.assert_array_equal(from_paths.descriptors, from_arrays.descriptors)
        assert from_paths.names == pair.references.names[:5]


class TestNordland:
    def test_frames_are_in_the_order_of_their_numbers(self, railway: Path) -> None:
        pair = datasets.nordland(railway)
        assert pair.references.names == ["98.png", "99.png", "100.png", "101.png"]
        assert [int(image[0, 0, 0]) for image in pair.references] == [2, 1, 3, 0]
        assert [int(image[0, 0, 0]) for image in pair.queries] == [52, 51, 53, 50]
        assert pair.truth is not None
        assert pair.truth.tolist() == [0, 1, 2, 3]
        assert pair.name == "Nordland test 2 summer / winter"

    @pytest.mark.parametrize("inside", ["", "Dataset_images"])
    def test_the_root_may_be_any_folder_on_the_way(self, railway: Path, inside: str) -> None:
        pair = datasets.nordland(railway / inside, reference="fall", query="spring", section=1)
        assert pair.references.names == ["0.png", "1.png", "2.png", "3.png"]
        assert int(pair.queries[0][0, 0, 0]) == 152

    def test_the_unpacked_archive_has_a_folder_more(
        self, railway: Path, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        root = tmp_path_factory.mktemp("download")
        (root / "Partitioned_Nordland_Dataset").symlink_to(railway)
        assert len(datasets.nordland(root).references) == 4

    def test_a_missing_season_is_named_with_its_source(self, railway: Path) -> None:
        (railway / "Dataset_images/test/winter_images_test").rename(railway / "elsewhere")
        with pytest.raises(
            surefix.SurefixFileError,
            match=r"test/winter_images_test/section2: .*winter.*unizar.*Licence",
        ):
            datasets.nordland(railway)

    def test_a_missing_root_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(surefix.SurefixFileError, match="nowhere"):
            datasets.nordland(tmp_path / "nowhere")

    def test_a_frame_that_one_season_lacks_is_named(self, railway: Path) -> None:
        (railway / "Dataset_images/test/summer_images_test/section2/99.png").unlink()
        with pytest.raises(
            surefix.SurefixValueError, match=r"the reference traverse lacks 1, such as 99\.png"
        ):
            datasets.nordland(railway)

    def test_unknown_seasons_and_sections_are_refused(self, railway: Path) -> None:
        with pytest.raises(surefix.SurefixValueError, match="'autumn'"):
            datasets.nordland(railway, query="autumn")
        with pytest.raises(surefix.SurefixValueError, match="train 3"):
            datasets.nordland(railway, split="train", section=3)

    def test_one_array_a_season(self, tmp_path: Path) -> None:
        np.save(tmp_path / "summer_thumbnails.npy", np.zeros((5, 4, 6), np.uint8))
        np.save(tmp_path / "winter_thumbnails.npy", np.ones((5, 4, 6), np.uint8))
        pair = datasets.nordland(tmp_path)
        assert pair.references.paths is None
        assert int(pair.queries[4].max()) == 1
        np.save(tmp_path / "winter_thumbnails.npy", np.ones((4, 4, 6), np.uint8))
        with pytest.raises(surefix.SurefixValueError, match="got 4 queries and 5 references"):
            datasets.nordland(tmp_path)
        np.save(tmp_path / "winter_more.npy", np.ones((4, 4, 6), np.uint8))
        with pytest.raises(surefix.SurefixValueError, match=r"one winter_\*\.npy"):
            datasets.nordland(tmp_path)

    def test_the_real_railway(self) -> None:
        pair = datasets.nordland(real_data.folder() / "nordland")
        assert len(pair.references) == len(pair.queries) == 1150
        assert pair.truth is not None
        np.testing.assert_array_equal(pair.truth, np.arange(1150))
        route = surefix.Map.from_images(pair.references[:60], progress=False)
        run = surefix.match(route, pair.queries[:60], progress=False)
        assert (np.abs(run.place - pair.truth[:60]) <= 1)[2:].mean() > 0.5


@pytest.fixture
def two_folders(tmp_path: Path) -> Path:
    write_images(tmp_path / "reference", [f"frame{i}.png" for i in range(11)])
    write_images(tmp_path / "query", [f"frame{i}.png" for i in range(3)], level=100)
    return tmp_path


class TestFolders:
    def test_files_are_in_the_order_a_person_would_put_them_in(self, two_folders: Path) -> None:
        pair = datasets.folders(two_folders)
        assert pair.references.names[-2:] == ["frame9.png", "frame10.png"]
        assert pair.truth is None

    def test_a_table_of_truth(self, two_folders: Path) -> None:
        (two_folders / "truth.csv").write_text(
            "\ufeffquery,reference\r\n2,\r\n0,10\r\n\r\n1,-1\r\n"
        )
        assert datasets.folders(two_folders, truth="truth.csv").truth is not None
        assert datasets.folders(two_folders, truth="truth.csv").truth.tolist() == [10, -1, -1]  # type: ignore[union-attr]

    @pytest.mark.parametrize(
        "text",
        ["reference,note,query\n10,clear,0\n-1,,1\n4,fog,2\n", "0,10\n1,\n2,4\n2,4\n"],
    )
    def test_columns_come_in_any_order_and_a_header_may_be_left_out(
        self, two_folders: Path, text: str
    ) -> None:
        (two_folders / "truth.csv").write_text(text)
        assert datasets.folders(two_folders, truth="truth.csv").truth.tolist() == [10, -1, 4]  # type: ignore[union-attr]

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            (
                "query,reference\n0,1\n1,2\n",
                "a row for each of the 3 queries, got 2; the first that lacks one is 2",
            ),
            (
                "query,reference\n0,1\n1,2\n2,x\n",
                "row 4, column reference: expected a whole number from 0 to 10, or -1 for none, got 'x'",
            ),
            (
                "query,reference\n0,1\n1,2\n2,11\n",
                "row 4, column reference: expected a whole number from 0 to 10, or -1 for none, got '11'",
            ),
            (
                "query,reference\n0,1\n3,2\n",
                "row 3, column query: expected a whole number from 0 to 2, got '3'",
            ),
            (
                "query,reference\n0,1\n0,2\n",
                "row 3: expected one reference a query, got 2 for query 0, which has 1 in row 2",
            ),
            ("query,reference\n0\n", "row 2: expected 2 values, query,reference, got 1"),
            ("q,r\n0,1\n", "row 1: expected the columns query,reference, got q,r"),
            ("query,reference\n", "expected rows of query,reference, got none"),
            ("query,reference\n0,99999999999999999999\n", "row 2"),
        ],
    )
    def test_a_malformed_truth_is_named_by_row(
        self, two_folders: Path, text: str, said: str
    ) -> None:
        (two_folders / "truth.csv").write_text(text)
        with pytest.raises(surefix.SurefixValueError) as error:
            datasets.folders(two_folders, truth="truth.csv")
        assert str(two_folders / "truth.csv") in str(error.value)
        assert said in str(error.value)

    def test_a_truth_that_is_no_text(self, two_folders: Path) -> None:
        (two_folders / "truth.csv").write_bytes(b"\xff\xfe\x00")
        with pytest.raises(surefix.SurefixValueError, match="UTF-8"):
            datasets.folders(two_folders, truth="truth.csv")

    def test_an_array_of_truth(self, two_folders: Path) -> None:
        np.save(two_folders / "truth.npy", np.array([4, -1, 10], np.int32))
        pair = datasets.folders(two_folders, truth="truth.npy")
        assert pair.truth is not None
        assert (pair.truth.dtype, pair.truth.tolist()) == (np.int64, [4, -1, 10])
        matrix = np.zeros((11, 3), np.int64)
        for wrong in (np.array([4, -1]), np.array([4.5, 1, 2]), np.array([4, 1, 11]), matrix):
            np.save(two_folders / "truth.npy", wrong)
            with pytest.raises(surefix.SurefixValueError, match="expected"):
                datasets.folders(two_folders, truth="truth.npy")

    def test_the_identity_needs_equal_counts(self, two_folders: Path) -> None:
        with pytest.raises(surefix.SurefixValueError, match="got 3 queries and 11 references"):
            datasets.folders(two_folders, truth="identity")

    @pytest.mark.parametrize("columns", ["x,y", "easting,northing"])
    def test_positions_in_metres_give_the_truth(self, two_folders: Path, columns: str) -> None:
        rows = "".join(f"{10 * i},0\n" for i in range(11))
        (two_folders / "map.csv").write_text(f"{columns}\n{rows}")
        (two_folders / "drive.csv").write_text(
            f"{columns},name\n0,50,frame2.png\n71,3,frame0.png\n28,0,frame1.png\n"
        )
        pair = datasets.folders(
            two_folders, reference_positions="map.csv", query_positions="drive.csv", tolerance=4.0
        )
        assert pair.truth is not None
        assert pair.truth.tolist() == [7, 3, -1]
        assert pair.query_positions is not None
        assert pair.query_positions.tolist() == [[71, 3], [28, 0], [0, 50]]

    def test_latitude_and_longitude_share_an_origin(self, two_folders: Path) -> None:
        rows = "".join(f"{51.75 + 0.0001 * i},-1.26\n" for i in range(11))
        (two_folders / "map.csv").write_text(f"latitude,longitude\n{rows}")
        (two_folders / "drive.csv").write_text(
            "Latitude, Longitude\n51.7502,-1.26\n51.7506,-1.26\n51.76,-1.26\n"
        )
        pair = datasets.folders(
            two_folders, reference_positions="map.csv", query_positions="drive.csv", tolerance=1
        )
        assert pair.truth is not None
        assert pair.truth.tolist() == [2, 6, -1]
        assert pair.query_positions is not None
        assert pair.reference_positions is not None
        np.testing.assert_allclose(pair.query_positions[0], pair.reference_positions[2], atol=1e-6)
        step = pair.reference_positions[1] - pair.reference_positions[0]
        np.testing.assert_allclose(
            step, [0, 0.0001 * 111262], rtol=1e-3
        )  # a degree of latitude at 51.75 N

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("x,y\n1,2\n3,4\n", "a row for each of the 3 images, got 2"),
            ("x,y\n1,2\n3,nan\n5,6\n", "row 3: expected y, a finite number, got 'nan'"),
            ("x,y\n1,2\n3,4,5\n5,6\n", "row 3: expected 2 values, got 3"),
            ("a,b\n1,2\n", "row 1: expected the columns x,y[,z]"),
            ("name,x,y\nframe0.png,1,2\nframe0.png,1,2\n", "row 3: expected each image once"),
            ("name,x,y\nframe0.png,1,2\nother.png,1,2\n", "got none for 2, such as frame1.png"),
            ("latitude,longitude\n1,2\n1,2\n1,2\n", "got metres: they share no plane"),
        ],
    )
    def test_malformed_positions_are_named(self, two_folders: Path, text: str, said: str) -> None:
        (two_folders / "map.csv").write_text("x,y\n" + "0,0\n" * 11)
        (two_folders / "drive.csv").write_text(text)
        with pytest.raises(surefix.SurefixValueError) as error:
            datasets.folders(
                two_folders, reference_positions="map.csv", query_positions="drive.csv"
            )
        assert str(two_folders) in str(error.value)
        assert said in str(error.value)

    def test_positions_of_one_traverse_only_are_refused(self, two_folders: Path) -> None:
        with pytest.raises(surefix.SurefixValueError, match="query_positions alone"):
            datasets.folders(two_folders, query_positions="drive.csv")

    @pytest.mark.parametrize(
        ("options", "named"),
        [
            ({"references": "nowhere"}, "nowhere"),
            ({"queries": "nowhere.npy"}, "nowhere.npy"),
            ({"truth": "truth.csv"}, "truth.csv"),
            ({"reference_positions": "map.csv", "query_positions": "drive.csv"}, "map.csv"),
        ],
    )
    def test_every_missing_file_is_named(
        self, two_folders: Path, options: dict[str, str], named: str
    ) -> None:
        with pytest.raises(surefix.SurefixFileError) as error:
            datasets.folders(two_folders, **options)  # type: ignore[arg-type]
        assert str(two_folders / named) in str(error.value)

    def test_arrays_instead_of_folders(self, tmp_path: Path) -> None:
        images = np.arange(5 * 4 * 6, dtype=np.uint8).reshape(5, 4, 6)
        np.save(tmp_path / "a.npy", images)
        pair = datasets.folders(tmp_path, references="a.npy", queries="a.npy", truth="identity")
        np.testing.assert_array_equal(np.stack(list(pair.queries)), images)
        np.save(tmp_path / "b.npy", images.astype(np.float32))
        with pytest.raises(surefix.SurefixValueError, match="got float32"):
            datasets.folders(tmp_path, references="a.npy", queries="b.npy")
        (tmp_path / "b.npy").write_bytes(b"\x93NUMPY")
        with pytest.raises(surefix.SurefixValueError, match=r"b\.npy"):
            datasets.folders(tmp_path, references="a.npy", queries="b.npy")

    def test_the_real_corridor(self) -> None:
        pair = datasets.folders(real_data.folder() / "corridor", truth="ground_truth.csv")
        assert pair.truth is not None
        np.testing.assert_array_equal(pair.truth, np.arange(111))


class TestPair:
    def test_images_are_a_sequence(self) -> None:
        images = datasets.ImageArray(
            np.arange(5, dtype=np.uint8)[:, None, None] * np.ones((1, 2, 2), np.uint8)
        )
        assert int(images[-1][0, 0]) == 4
        assert images[1:4:2].names == ["1", "3"]
        assert [int(image[0, 0]) for image in images.take(np.array([3, 0]))] == [3, 0]
        assert [int(image[0, 0]) for image in reversed(images)] == [4, 3, 2, 1, 0]
        with pytest.raises(IndexError):
            images[5]
        image = images[0]
        image[:] = 9
        assert int(images[0][0, 0]) == 0

    @pytest.mark.parametrize(
        "fields",
        [
            {"truth": np.array([0])},
            {"truth": np.array([0, 3])},
            {"truth": np.array([0, -2])},
            {"query_positions": np.zeros((3, 2))},
            {"reference_positions": np.zeros((3, 4))},
        ],
    )
    def test_what_does_not_agree_is_refused(self, fields: dict[str, np.ndarray]) -> None:
        images = datasets.ImageArray(np.zeros((3, 2, 2), np.uint8))
        with pytest.raises(surefix.SurefixValueError, match="some route: expected"):
            datasets.Pair("some route", images, images[:2], **fields)


class TestRegistry:
    def test_every_loader_is_there_by_name(self, gardens: Path) -> None:
        assert list(datasets.DATASETS) == [
            "gardens_point",
            "nordland",
            "four_seasons",
            "robotcar",
            "folders",
        ]
        for name, dataset in datasets.DATASETS.items():
            assert dataset.load is getattr(datasets, name)
            for line in (dataset.origin.title, dataset.origin.source, dataset.origin.licence):
                assert line
                assert "\n" not in line
        assert len(datasets.load("gardens-point", gardens, query="night_right").queries) == 12
        assert datasets.DATASETS["gardens_point"].options == {
            "reference": "day_left",
            "query": "day_right",
        }

    def test_the_traverses_that_are_there_are_listed_the_one_for_the_map_first(
        self, gardens: Path, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        assert datasets.traverses("gardens-point", gardens) == [
            "day_left",
            "day_right",
            "night_right",
        ]
        (gardens / "day_left").rename(gardens / "elsewhere")
        assert datasets.traverses("gardens_point", gardens) == ["day_right", "night_right"]
        assert datasets.traverses("folders", gardens) == []
        arrays = tmp_path_factory.mktemp("arrays")
        for season in ("spring", "winter", "summer"):
            np.save(arrays / f"{season}_thumbnails.npy", np.zeros((2, 4, 6), np.uint8))
        assert datasets.traverses("nordland", arrays) == ["summer", "winter", "spring"]
        with pytest.raises(surefix.SurefixValueError, match="'kitti'"):
            datasets.traverses("kitti", gardens)
        with pytest.raises(surefix.SurefixFileError, match=r"nowhere: no such folder.*unizar"):
            datasets.traverses("nordland", gardens / "nowhere")

    @pytest.mark.parametrize("inside", ["", "Dataset_images"])
    def test_the_seasons_of_the_images_are_listed(self, railway: Path, inside: str) -> None:
        (railway / "Dataset_images/test/fall_images_test").rename(railway / "elsewhere")
        assert datasets.traverses("nordland", railway / inside) == ["summer", "winter", "spring"]

    def test_a_data_set_is_known_by_its_signs(self, gardens: Path, railway: Path) -> None:
        def looks_like(folder: Path) -> list[str]:
            return [
                name
                for name, dataset in datasets.DATASETS.items()
                if any(path for sign in dataset.signs for path in folder.glob(sign))
            ]

        # Both fixtures are trees in one folder.
        assert looks_like(gardens) == ["gardens_point", "nordland"]
        (railway / "Dataset_images").rename(railway / "elsewhere")
        (railway / "reference").mkdir()
        (railway / "recording_2020-03-24_17-36-22").mkdir()
        (railway / "2014-12-09-13-21-02").mkdir()
        for walk in ("day_left", "day_right", "night_right"):
            (railway / walk).rename(railway / f"a {walk}")
        assert looks_like(railway) == ["four_seasons", "robotcar", "folders"]

    def test_unknown_names_and_options_list_the_known_ones(self, gardens: Path) -> None:
        with pytest.raises(surefix.SurefixValueError, match=r"gardens_point, nordland.*'kitti'"):
            datasets.load("kitti", gardens)
        with pytest.raises(surefix.SurefixValueError, match="reference, query, got 'season'"):
            datasets.load("gardens_point", gardens, season="night")

    @pytest.mark.parametrize("name", datasets.__all__)
    def test_its_example_runs(
        self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        text = inspect.getdoc(getattr(datasets, name)) or ""
        test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
        said: list[str] = []
        doctest.DocTestRunner().run(test, out=said.append)
        assert not said, "".join(said)
