"""Counts in sentences."""


def plural(count: int, one: str, more: str = "") -> str:
    """The count with its noun, ``1 fix``, ``2 fixes``; by default the plural takes an s."""
    return f"{count} {one if count == 1 else more or one + 's'}"


def verb(count: int) -> str:
    """The verb after a count."""
    return "is" if count == 1 else "are"
