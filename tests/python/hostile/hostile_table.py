"""The table of hostile inputs, over every door."""

from hostile_arrays import ARRAYS
from hostile_frames import FRAMES
from hostile_maps import MAPS
from hostile_texts import TEXTS

ROWS = [*MAPS, *ARRAYS, *TEXTS, *FRAMES]
