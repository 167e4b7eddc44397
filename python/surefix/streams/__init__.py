"""Streams of frames: folders, also ones that grow, videos, bags of ROS 1 and 2, cameras.

>>> from surefix.streams import open_stream
>>> for frame in open_stream("drive.mp4", every=0.5):                                           # doctest: +SKIP
...     fix = localizer.push(frame.image)

``open_stream`` finds the kind by what is named. ``Localizer.stream`` takes what it gives, or any
iterable of ``Frame``, and tells the matcher where the drive is broken. Videos, bags and cameras
need ``surefix[video]``, ``surefix[bags]`` and ``surefix[camera]``.
"""

from surefix.streams.arrays import ArrayStream
from surefix.streams.bag import BagStream
from surefix.streams.camera import CameraStream
from surefix.streams.every import Every, Stride
from surefix.streams.follow import FollowStream
from surefix.streams.frame import Frame
from surefix.streams.gaps import Gaps
from surefix.streams.images import ImageStream
from surefix.streams.metres import EveryMetres
from surefix.streams.newest import KeepNewest
from surefix.streams.odometry import Odometry
from surefix.streams.open import open_stream
from surefix.streams.ros_image import image_of
from surefix.streams.stream import Selection, Shot, Stream
from surefix.streams.video import VideoStream

__all__ = [
    "ArrayStream",
    "BagStream",
    "CameraStream",
    "Every",
    "EveryMetres",
    "FollowStream",
    "Frame",
    "Gaps",
    "ImageStream",
    "KeepNewest",
    "Odometry",
    "Selection",
    "Shot",
    "Stream",
    "Stride",
    "VideoStream",
    "image_of",
    "open_stream",
]
