"""Of a figure ``NAME.png`` with a ``NAME-dark.png`` beside it, a page shows the one of its mode."""

from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class DarkFigures(SphinxTransform):
    """Doubles such images, with furo's classes."""

    # Before Sphinx collects the images.
    default_priority = 200

    def apply(self, **kwargs: Any) -> None:
        folder = Path(self.env.doc2path(self.env.docname)).parent
        for image in list(self.document.findall(nodes.image)):
            light = Path(image["uri"])
            dark = light.with_name(f"{light.stem}-dark{light.suffix}")
            if not (folder / dark).is_file():
                continue
            other = image.deepcopy()
            other["uri"] = dark.as_posix()
            other["classes"].append("only-dark")
            image["classes"].append("only-light")
            image.parent.insert(image.parent.index(image) + 1, other)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_transform(DarkFigures)
    return {"parallel_read_safe": True}
