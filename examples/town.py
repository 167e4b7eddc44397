"""A map of several roads: a ring, a road in and a road out, in two seasons.

Run it with: python examples/town.py
"""

import surefix
from surefix.simulate import Town

# A generated town replaces your recordings: three roads in summer, and once more in autumn.
town = Town(places=300, size=(96, 48))
first, second = (town.mapped(), town.mapped(season=0.5, light=0.3))

# Each road is a map of its own; together they are the town's.
roads = [
    surefix.Map.from_images(first[road.start : road.end], closed=road.closed)
    for road in town.segments
]
known = surefix.Map.join(roads)
# At the end of the road in comes the ring; halfway round it, one may take the road out.
links = [(219, 0), (50, 220)]
segments = surefix.Segments(len(known), known.segments.breaks, closed=[0], links=links)
known = known.with_segments(segments)

# The second drive is laid upon the first one without any label.
known = known.add_traverse(second, motion="steady", label="autumn")
print(known)

# In winter: in, one and a half times round the ring, and out.
drive = town.drive()
localizer = surefix.Localizer(known, motion="any")
for fix in localizer.stream(drive.images):
    if fix.frame % 50 == 0:
        where = f"{town.names[fix.segment]}, place {fix.segment_place}"
        print(f"frame {fix.frame}: {where}, {fix.confidence:.0%} sure")
