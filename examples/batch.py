"""From ready distances to trusted places, for any technique that yields a distance matrix.

Run it with: python examples/batch.py
"""

import numpy as np

import surefix

# D[i, j] is the distance between place i and query j. Here: descriptors of 500 places along a
# street of 30 kinds of house, so that places look alike, and the same with much noise.
rng = np.random.default_rng(7)
kinds = rng.standard_normal((30, 64))
street = kinds[np.repeat(rng.integers(0, 30, 50), 10)] + 0.5 * rng.standard_normal((500, 64))
places = street + np.roll(street, 1, axis=0) + np.roll(street, 2, axis=0)
queries = places + 4 * rng.standard_normal(places.shape)
cosines = (
    places @ queries.T / np.outer(np.linalg.norm(places, axis=1), np.linalg.norm(queries, axis=1))
)
D = (1 - cosines).astype(np.float32)

# The plain sequence, and the paper's: trusted cells are lowered towards the minimum of the whole
# matrix.
plain = surefix.match_distances(D, weight=0.0)
weighted = surefix.match_distances(D, weight=0.99)

truth = np.arange(500)
right = np.abs(weighted.single_place - truth) <= 1
trusted = weighted.trusted
print(
    f"single frames: {right.mean():.1%} right; "
    f"of the {trusted.sum()} trusted {right[trusted].mean():.1%}"
)
for name, run in (("plain", plain), ("weighted", weighted)):
    curve = surefix.evaluate(run, truth, tolerance=1)
    print(
        f"{name:8} sequence: area under the precision-recall curve to 20 % recall "
        f"{curve.auc(0.2):.3f}"
    )

print(weighted)
