"""Poses: rotations, and the distance driven along the robot's own axis."""

import numpy as np
import numpy.typing as npt

from surefix.tables.metres import subsample

Float64 = npt.NDArray[np.float64]
# The least part of the way that lies along the robot's own axis, if its orientation is to be used.
ALONG = 0.8
# In metres.
STRETCH = 0.5


def rotations(quaternions: npt.ArrayLike) -> Float64:
    """The matrices of unit quaternions (x, y, z, w), shape (n, 3, 3): I + 2 w [v] + 2 [v] [v]."""
    x, y, z, w = np.asarray(quaternions, np.float64).T
    o = np.zeros_like(x)
    cross = np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + 2 * w[:, None, None] * cross + 2 * cross @ cross)


def driven(positions: Float64, turns: Float64) -> Float64 | None:
    """The distance driven so far, shape (n,); it decreases if the robot reverses.

    Parameters
    ----------
    positions : array, shape (n, 2) or (n, 3)
    turns : array, shape (n, 3, 3)
        From the robot's own axes to those of the positions.

    Returns
    -------
    array or None
        The robot drives along the direction, seen from itself, in which most of the way lies:
        ahead if that is along one of its axes (x of a robot, z of a camera), and back if against
        it. None if the way does not lie along it (a drone's, or an orientation that was never set).
    """
    # Of stretches longer than the jitter of a robot that stands.
    extent = float(np.linalg.norm(np.ptp(positions, axis=0)))
    some = subsample(positions, min(STRETCH, extent / 50))
    own, lengths = _own(positions[some], turns[some])
    forward = np.linalg.eigh(own.T @ own)[1][:, -1]
    main = int(np.argmax(np.abs(forward)))
    forward = forward * np.sign(forward[main])
    least = ALONG
    if not np.ptp(turns, axis=0).any():
        # One orientation for the whole drive is a default, unless the drive is straight along it.
        forward, least = np.eye(3)[main], 1 - 1e-9
    if np.abs(own @ forward).sum() < least * lengths.sum():
        return None
    return np.concatenate([[0.0], np.cumsum(_own(positions, turns)[0] @ forward)])


def _own(positions: Float64, turns: Float64) -> tuple[Float64, Float64]:
    """The steps from pose to pose, seen from the robot halfway between them, and their lengths."""
    steps = np.diff(positions, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    steps = np.pad(steps, ((0, 0), (0, 3 - steps.shape[1])))
    own = np.einsum("kji,kj->ki", (turns[1:] + turns[:-1]) / 2, steps)
    # The mean of two rotations shortens what it turns.
    own *= (lengths / np.maximum(np.linalg.norm(own, axis=1), 1e-300))[:, None]
    return own, lengths
