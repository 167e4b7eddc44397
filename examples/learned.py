"""Plain image differences and a learned descriptor side by side, on drives of yours, and what standardisation gives.

A network's numbers have a mean and a spread that say more of the season than of the place. Taking them away, number by
number, is often worth more than a better network; the question is whose statistics to use. Those of the whole drive are
best, and only known once it is over. A robot has those of the reference drive, and what it has seen so far.

Run it with: python examples/learned.py MODEL.onnx --output feat_s16 --size 256 128 NAME REFERENCES QUERIES [...]
Query i must show the place of reference i. It prints a table in Markdown.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt

import surefix
from surefix.descriptors import Onnx, extract

Rows = npt.NDArray[np.float32]
# A number that hardly varies is noise, and is not made larger.
SMALLEST = 1e-6


def standardized(rows: Rows, like: Rows) -> Rows:
    """Each number less its mean over ``like``, divided by its spread there."""
    mean, std = like.mean(axis=0, dtype=np.float64), like.std(axis=0, dtype=np.float64)
    return ((rows - mean) / np.maximum(std, SMALLEST)).astype(np.float32)


def standardized_so_far(rows: Rows, references: Rows) -> Rows:
    """Each row by the statistics of the rows up to it, itself among them (Welford).

    They begin as those of the references, which count as one row: the first queries have no spread of their own.
    """
    count, mean = 1.0, references.mean(axis=0, dtype=np.float64)
    squares = references.var(axis=0, dtype=np.float64)
    out = np.empty_like(rows)
    for index, row in enumerate(rows):
        count += 1
        off = row - mean
        mean = mean + off / count
        squares = squares + off * (row - mean)
        out[index] = (row - mean) / np.maximum(np.sqrt(squares / count), SMALLEST)
    return out


def figures(route: surefix.Map, queries: object) -> str:
    """What a table's row says, with default options."""
    run = surefix.match(route, queries, progress=False)
    truth = np.arange(len(run))
    right = np.abs(run.single_place - truth) <= 1
    trusted = run.trusted
    precision = f"{right[trusted].mean():.3f}" if trusted.any() else "none trusted"
    area = surefix.evaluate(run, truth, tolerance=1, recall="correct").auc(0.2)
    return f"{right.mean():.3f} | {trusted.mean():.3f} | {precision} | {area:.3f} |"


def learned_map(rows: Rows) -> surefix.Map:
    """A map of vectors; the cosine does not mind their lengths."""
    return surefix.Map.from_descriptors(rows, metric="cosine")


def main() -> None:
    """Reads the command line, and prints the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("model", help="an ONNX file")
    options.add_argument("routes", nargs="+", metavar="NAME REFERENCES QUERIES", help="folders, patterns or .npy files")
    options.add_argument("--output", action="append", required=True, help="one of the model's outputs; may be repeated")
    options.add_argument("--size", nargs=2, type=int, metavar=("WIDTH", "HEIGHT"))
    given = options.parse_args()
    if len(given.routes) % 3:
        options.error("expected NAME REFERENCES QUERIES for each route")
    print("| route | descriptor | query statistics | R@1 | trusted | of these right | area to 20 % recall |")
    print("|---|---|---|---|---|---|---|")
    for name, *places in zip(*[iter(given.routes)] * 3, strict=True):
        references, queries = (np.load(place) if Path(place).suffix == ".npy" else place for place in places)
        sad = figures(surefix.Map.from_images(references, progress=False), queries)
        print(f"| {name} | Sad | none needed | {sad}", flush=True)
        for output in given.output:
            network = Onnx(given.model, output=output, size=given.size)
            with TemporaryDirectory() as folder:
                theirs = extract(references, network, cache=Path(folder, "references"))
                ours = extract(queries, network, cache=Path(folder, "queries"))
                plain, fitted = learned_map(np.array(theirs)), learned_map(standardized(theirs, theirs))
                for statistics, route, rows in (
                    ("not standardised", plain, np.array(ours)),
                    ("the query drive's own", fitted, standardized(ours, ours)),
                    ("the references'", fitted, standardized(ours, theirs)),
                    ("so far", fitted, standardized_so_far(ours, theirs)),
                ):
                    print(f"| {name} | {output} | {statistics} | {figures(route, rows)}", flush=True)


if __name__ == "__main__":
    main()
