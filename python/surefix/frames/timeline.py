"""One clock for the messages of a topic, and their order by it."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from surefix._words import plural

Int64 = npt.NDArray[np.int64]

SECOND = 1_000_000_000
# Messages that go on after a jump back tell a clock that was set back from a message that is late.
BACK = 5
# In messages: how late one may be and still be put in its place. Videos send a few out of order.
LATE = 16
# If the recording spans this many times more than the stamps, they are in another unit.
UNIT = 300


@dataclass(frozen=True, eq=False)
class Timeline:
    """When the messages of a topic were taken.

    The clock is that of the stamps; or that of the recording, for all messages, if a stamp is 0 or
    more than one in ten is that of the message before, or they span far less than the recording, as
    those in another unit do.

    A message that was recorded late is put in its place, unless more than ``LATE`` recorded before
    it are newer: then it is left out. If the clock goes back and stays back, a new stretch begins
    there: times ascend within a stretch. Of messages with equal times in a stretch, and of copies
    in several files, the first is kept.

    Attributes
    ----------
    order : list of int
        The numbers of the messages that are kept, in their order.
    time : array of int64
        Of each message, kept or not, in nanoseconds.
    breaks : set of int
        The numbers of the messages before which the drive is broken: a new stretch, or a pause
        between two files.
    recorded : bool
        Whether the clock is that of the recording.
    remarks : list of str
        All of the above that happened.
    """

    order: list[int]
    time: Int64
    breaks: set[int]
    recorded: bool
    remarks: list[str]


def timeline(
    stamps: Int64, recorded: Int64, file: Int64, whole: npt.NDArray[np.bool_], files: list[str]
) -> Timeline:
    """Of messages in the order of their recording: their stamps (0 if they have none) and the times
    of their recording in nanoseconds, the file of each, and whether it can be read.
    """
    remarks: list[str] = []
    numbers = np.flatnonzero(whole)
    # The same message in two files, or twice in one.
    pairs = np.stack([stamps[numbers], recorded[numbers]], axis=1)
    first = np.sort(np.unique(pairs, axis=0, return_index=True)[1])
    if copies := len(numbers) - len(first):
        remarks.append(f"{plural(copies, 'message')} left out: a copy of the one before")
    numbers = numbers[first]
    given = stamps[numbers]
    steps = np.diff(given)
    zero, still = int((given <= 0).sum()), int((steps == 0).sum())
    # A simulator's clock begins at 0: the next stamp follows on it.
    if zero == 1 and len(given) > 1 and given[0] == 0 and 0 < steps[0] <= 5 * np.median(steps):
        zero = 0
    spans = [(int(np.ptp(each[numbers])) if len(numbers) else 0) for each in (stamps, recorded)]
    small = UNIT * spans[0] < spans[1]
    by_recording = zero > 0 or 10 * still > len(given) or small
    if by_recording:
        count = plural(len(given), "stamp")
        why = f"{zero} of {count} are 0" if zero else f"{still} of {count} repeat the one before"
        if small and not zero and 10 * still <= len(given):
            span, whole_span = (each / SECOND for each in spans)
            why = f"{count} span {span:.3g} s, the recording {whole_span:.3g} s"
        remarks.append(f"{why}: times are those of the recording")
    time = recorded.copy() if by_recording else stamps.copy()
    order: list[int] = []
    breaks: set[int] = set()
    late = equal = stray = 0
    for whole_stretch in _stretches(numbers, time):
        rank = np.argsort(np.argsort(time[whole_stretch], kind="stable"), kind="stable")
        stretch = whole_stretch[np.arange(len(rank)) - rank <= LATE]
        stray += len(whole_stretch) - len(stretch)
        ranked = stretch[np.argsort(time[stretch], kind="stable")]
        late += int((np.diff(time[stretch]) < 0).sum())
        fresh = np.concatenate([[True], np.diff(time[ranked]) > 0])
        equal += int((~fresh).sum())
        kept = ranked[fresh].tolist()
        if order:
            breaks.add(kept[0])
            back = (time[order[-1]] - time[kept[0]]) / SECOND
            remarks.append(f"the clock goes back by {back:.3f} s at message {kept[0]}: a gap")
        order += kept
    if late:
        remarks.append(f"{plural(late, 'message')} recorded late, put in order")
    if stray:
        remarks.append(f"{plural(stray, 'message')} left out: older than {LATE} recorded before")
    if equal:
        remarks.append(f"{plural(equal, 'message')} left out: the time of another message")
    if len(order) > 1 and len(files) > 1:
        pauses, said = _pauses(order, time, file, files)
        breaks |= pauses
        remarks += [*said, *_overlaps(np.flatnonzero(whole), time, file, files)]
    return Timeline(order, time, breaks, by_recording, remarks)


def _stretches(numbers: Int64, time: Int64) -> list[Int64]:
    """The messages between two times at which the clock is set back."""
    starts, peak = [0], -1
    times = time[numbers].tolist()
    for at, now in enumerate(times):
        if now < peak:
            after = times[at + 1 : at + 1 + BACK]
            if after and all(each < peak for each in after):
                starts.append(at)
                peak = now
        peak = max(peak, now)
    return [part for part in np.split(numbers, starts[1:]) if len(part)]


def _pauses(
    order: list[int], time: Int64, file: Int64, files: list[str]
) -> tuple[set[int], list[str]]:
    """The messages before which there is a pause between two files."""
    steps = np.diff(time[order])
    ahead = steps[steps > 0]
    longest = max(SECOND, 5 * float(np.median(ahead)) if len(ahead) else 0)
    found = [
        (before, after, step / SECOND)
        for (before, after), step in zip(pairwise(order), steps.tolist(), strict=True)
        if file[before] != file[after] and step > longest
    ]
    names = ((files[file[before]], files[file[after]], step) for before, after, step in found)
    remarks = [f"a gap of {step:.1f} s between {one} and {other}" for one, other, step in names]
    return {after for _, after, _ in found}, remarks


def _overlaps(numbers: Int64, time: Int64, file: Int64, files: list[str]) -> list[str]:
    """Files of which one begins before another ends; and those without any of the messages."""
    of_file = [time[numbers[file[numbers] == number]] for number in range(len(files))]
    known = zip(of_file, files, strict=True)
    spans = sorted((int(of.min()), int(of.max()), name) for of, name in known if len(of))
    remarks = [
        f"{one} and {other} overlap by {(min(end, last) - start) / SECOND:.1f} s: taken by time"
        for (_, end, one), (start, last, other) in pairwise(spans)
        if start < end
    ]
    known = zip(of_file, files, strict=True)
    return [*remarks, *(f"{name} has none of these messages" for of, name in known if not len(of))]
