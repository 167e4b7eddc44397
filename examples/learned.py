"""Plain image differences and a learned descriptor side by side, on your drives, with and without
standardisation.

The mean and the spread of a network's numbers depend more on the season than on the place. Removing
them, number by number, often gains more than a better network; the question is whose statistics to
use. Those of the whole drive are best, but are known only after it. A robot has those of the
reference drive, and those of its queries so far.

Run it with: python examples/learned.py MODEL.onnx --output feat_s16 --size 256 128 NAME REFERENCES
QUERIES [...] Query i must show the place of reference i. It prints a table in Markdown.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import surefix
from surefix.descriptors import Onnx, extract
from surefix.post import Standardize, standardized


def figures(route: surefix.Map, queries: object) -> str:
    """The figures of a table's row, with default options."""
    run = surefix.match(route, queries, progress=False)
    truth = np.arange(len(run))
    right = np.abs(run.single_place - truth) <= 1
    trusted = run.trusted
    precision = f"{right[trusted].mean():.3f}" if trusted.any() else "none trusted"
    area = surefix.evaluate(run, truth, tolerance=1, recall="correct").auc(0.2)
    return f"{right.mean():.3f} | {trusted.mean():.3f} | {precision} | {area:.3f} |"


def main() -> None:
    """Reads the command line, and prints the table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("model", help="an ONNX file")
    options.add_argument(
        "routes",
        nargs="+",
        metavar="NAME REFERENCES QUERIES",
        help="folders, patterns or .npy files",
    )
    options.add_argument(
        "--output",
        action="append",
        required=True,
        help="one of the model's outputs; may be repeated",
    )
    options.add_argument("--size", nargs=2, type=int, metavar=("WIDTH", "HEIGHT"))
    given = options.parse_args()
    if len(given.routes) % 3:
        options.error("expected NAME REFERENCES QUERIES for each route")
    print(
        "| route | descriptor | query statistics | R@1 | trusted | of these right "
        "| area to 20 % recall |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, *places in zip(*[iter(given.routes)] * 3, strict=True):
        references, queries = (
            np.load(place) if Path(place).suffix == ".npy" else place for place in places
        )
        sad = figures(surefix.Map.from_images(references, progress=False), queries)
        print(f"| {name} | Sad | none needed | {sad}", flush=True)
        for output in given.output:
            network = Onnx(given.model, output=output, size=given.size)
            with TemporaryDirectory() as folder:
                theirs = extract(references, network, cache=Path(folder, "references"))
                ours = extract(queries, network, cache=Path(folder, "queries"))
                theirs, ours = np.array(theirs), np.array(ours)
                # The cosine does not mind their lengths.
                for statistics, steps, rows in (
                    ("not standardised", [], ours),
                    ("the references'", [Standardize()], ours),
                    ("so far", [Standardize("running")], ours),
                ):
                    route = surefix.Map.from_descriptors(theirs, post=steps)
                    print(
                        f"| {name} | {output} | {statistics} | {figures(route, rows)}", flush=True
                    )
                route = surefix.Map.from_descriptors(standardized(theirs))
                print(
                    f"| {name} | {output} | the drive's own | {figures(route, standardized(ours))}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
