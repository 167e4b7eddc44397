"""A generated route, seen in two conditions: for demos, tests and trying things out without any
data.
"""

from surefix._core import Route, Traverse

__all__ = ["Route", "Traverse"]
