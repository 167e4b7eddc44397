"""Images in order: folders, also ones that grow, arrays, videos, bags of ROS 1 and 2, cameras.

>>> import surefix                                                               # doctest: +SKIP
>>> for frame in surefix.frames.open("drive.mp4", every=0.5):                    # doctest: +SKIP
...     fix = localizer.push(frame.image)

``open`` finds the kind by the name. ``Localizer.stream`` takes ``Frames``, or any iterable of
``Frame``, and tells the matcher where the drive is broken. Videos, bags and cameras need
``surefix[video]``, ``surefix[bags]`` and ``surefix[camera]``.
"""

from surefix.frames.advances import Advances
from surefix.frames.bag import BagFrames
from surefix.frames.camera import CameraFrames
from surefix.frames.follow import FollowFrames
from surefix.frames.frame import Frame, Frames, Shot
from surefix.frames.images import ImageFrames
from surefix.frames.levels import in_8_bits
from surefix.frames.nearest import Every, EveryMetres
from surefix.frames.newest import KeepNewest
from surefix.frames.odometry import Odometry
from surefix.frames.opening import open
from surefix.frames.passing import SkipBad
from surefix.frames.ros_image import image_of
from surefix.frames.sampling import Gaps, Selection, Stride
from surefix.frames.shape import Crop
from surefix.frames.video import VideoFrames

__all__ = [
    "Advances",
    "BagFrames",
    "CameraFrames",
    "Crop",
    "Every",
    "EveryMetres",
    "FollowFrames",
    "Frame",
    "Frames",
    "Gaps",
    "ImageFrames",
    "KeepNewest",
    "Odometry",
    "Selection",
    "Shot",
    "SkipBad",
    "Stride",
    "VideoFrames",
    "image_of",
    "in_8_bits",
    "open",
]
