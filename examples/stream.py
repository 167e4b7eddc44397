"""A robot's loop: a map made once, then a fix for every camera frame.

Run it with: python examples/stream.py
"""

import surefix
from surefix.simulate import Route

# A generated road replaces your camera: one drive in summer, one on a winter afternoon.
road = Route(places=300, size=(160, 80))
summer, winter = road.reference(), road.revisit()

# Once: the map. It is one file, with all that is needed to use it.
route = surefix.Map.from_images(summer, surefix.Sad(size=(64, 32), patch=8))
print(route)

# For every frame: where am I, and may I trust that answer?
localizer = surefix.Localizer(route, sequence_length=3)
truth = winter.truth(summer)
trusted = right = 0
for fix in localizer.stream(winter):
    if fix.trusted:
        trusted += 1
        right += abs(fix.single.place - truth[fix.frame]) <= 1
    if fix.frame % 50 == 0:
        print(fix)
print(f"{len(winter)} frames, {trusted} trusted, {right} of those right")

# A robot that restarts continues from its snapshot, to the last bit.
localizer = surefix.Localizer.restore(route, localizer.snapshot())
print(localizer.push(winter[-1]))
