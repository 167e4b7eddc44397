"""Which frames of a recording are taken: options that several commands have."""

from dataclasses import dataclass
from typing import Annotated

import typer

from surefix.streams import Stream, open_stream

__all__ = ["Every", "Metres", "Odometry", "Stride", "Taking", "Topic"]

Topic = Annotated[
    str | None, typer.Option(help="A bag: the topic of the images, if there are several.")
]
Stride = Annotated[int, typer.Option(min=1, help="A video or a bag: take every n-th frame.")]
Every = Annotated[
    float | None, typer.Option(help="A video or a bag: take a frame every so many seconds.")
]
Metres = Annotated[
    float | None,
    typer.Option(help="A video or a bag: take a frame every so many metres, by --odometry."),
]
Odometry = Annotated[
    str | None,
    typer.Option(
        help="A .csv with the columns time and x,y[,z] or distance, or a topic of poses of the bag."
    ),
]


@dataclass(frozen=True)
class Taking:
    """As for ``open_stream``; by default each frame."""

    topic: str | None = None
    stride: int = 1
    every: float | None = None
    metres: float | None = None
    odometry: str | None = None

    def open(self, recording: str) -> Stream:
        """The frames that are taken."""
        return open_stream(recording, **vars(self))

    def check_none(self, got: object) -> None:
        """Refuses a choice where there is no recording."""
        if self != Taking():
            raise typer.BadParameter(
                f"--topic, --stride, --every, --metres, --odometry: expected a video or a bag, got {got}"
            )
