"""A generated route, seen in two conditions, by drives that can stop, reverse, leave the map and
come back: for demos, tests and trying things out without any data.
"""

from surefix._core import Route, Traverse

__all__ = ["Route", "Traverse"]
