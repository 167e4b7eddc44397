"""The topic of a bag that has the camera's images."""

import re
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from surefix._words import plural
from surefix.errors import SurefixError, SurefixValueError, mismatch
from surefix.frames.packets import PACKETS, codec_of
from surefix.frames.recording import Recording, Topic
from surefix.frames.ros_image import COMPRESSED, RAW, check_fits, image_of

IMAGE = (*RAW, *COMPRESSED, *PACKETS)
# The last parts of topics that carry the same images once more.
TRANSPORT = re.compile(r"/(compressed|ffmpeg|h26[45]|foxglove|video|theora)$")
NO_CAMERA = re.compile(r"depth|disparity|mask|segment|semantic|label|confidence|heatmap", re.I)
DEEP = ("mono16", "16uc1", "32fc1")
# An image with fewer shades is a mask, or labels.
SHADES = 9


class Candidate(NamedTuple):
    """An image topic, what it is for the user, and why it is likely no camera's, if so."""

    name: str
    said: str
    doubt: str


def choose_topic(bag: Recording, topic: str | None) -> tuple[str, list[str]]:
    """The topic of the images, and a remark if others are passed over.

    Of several, depth images, masks and those of 16 bits or of floats are passed over beside a
    camera's; an image's compressed form beside itself.

    Raises
    ------
    SurefixValueError
        If there is none, or more than one camera's; or not the one that was asked for.
    """
    images = {name: each for name, each in bag.topics.items() if each.kind in IMAGE}
    if topic is not None and topic in images:
        return topic, []
    if not images:
        listed = ", ".join(_short(name, bag.topics[name]) for name in sorted(bag.topics))
        expected = f"a topic of images ({', '.join(IMAGE)})"
        raise mismatch(bag.name, expected, listed or "a bag without topics")
    if topic is not None:
        listed = ", ".join(_short(name, images[name]) for name in sorted(images))
        raise mismatch(bag.name, f"an image topic, one of {listed}", repr(topic))
    if len(images) == 1:
        return next(iter(images)), []
    # A camera that was off has a topic without messages.
    there = [name for name in sorted(images) if images[name].count] or sorted(images)
    candidates = [_looked_at(bag, name, images[name]) for name in there]
    cameras = [each for each in candidates if not each.doubt] or candidates
    chosen = _one(cameras, images)
    if chosen is None:
        several = "expected the topic of the images, as there are several: "
        listed = ", ".join(each.said for each in cameras)
        raise SurefixValueError(f"{bag.name}: {several}{listed}")
    others = [f"{each.name} ({each.doubt or 'the same camera'})" for each in candidates]
    left = [text for each, text in zip(candidates, others, strict=True) if each.name != chosen]
    return chosen, [f"images of {chosen}; passed over: {', '.join(left)}"] if left else []


def _one(cameras: list[Candidate], images: dict[str, Topic]) -> str | None:
    """The topic of the only camera, in its form with the most messages, raw rather than not."""
    if len({TRANSPORT.sub("", each.name) for each in cameras}) > 1:
        return None
    names = [each.name for each in cameras]
    return max(names, key=lambda name: (images[name].count, images[name].kind in RAW, name))


def _looked_at(bag: Recording, name: str, topic: Topic) -> Candidate:
    with closing(bag.messages(name)) as messages:
        whole = (each for each in messages if not each.damage)
        first = next(whole, None)
    if first is None:
        return Candidate(name, _short(name, topic), "no message of it can be read")
    message, where = first.content, first.where
    encoding = str(getattr(message, "encoding", getattr(message, "format", "")))
    size, doubt = "", ""
    try:
        if codec_of(message, where) is None:
            check_fits(message, where)
            image = image_of(message, where)
            size = f"{image.shape[1]} x {image.shape[0]}, "
            if image.ndim == 2 and 1 < len(np.unique(image)) < SHADES:
                doubt = "a mask by its few shades"
        elif getattr(message, "width", 0):
            size = f"{message.width} x {message.height}, "
    except SurefixError:
        doubt = "cannot be decoded"
    if "compressedDepth" in encoding or encoding.lower() in DEEP:
        doubt = f"{encoding.split(';')[0]}, no 8-bit image"
        if "compressedDepth" in encoding:
            doubt = "a depth image"
        size = size or _size(message)
    elif NO_CAMERA.search(name):
        doubt = doubt or "by its name"
    said = f"{name} ({topic.kind}, {plural(topic.count, 'message')}, {size}{encoding})"
    return Candidate(name, said, doubt)


def _size(message: Any) -> str:
    return f"{message.width} x {message.height}, " if hasattr(message, "width") else ""


def _short(name: str, topic: Topic) -> str:
    return f"{name} ({topic.kind}, {plural(topic.count, 'message')})"
