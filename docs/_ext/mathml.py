"""Write equations as MathML, which browsers draw themselves: the pages need no network and no script."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

LOG = logging.getLogger(__name__)


def _write(translator: Any, node: nodes.Element, *, as_block: bool) -> None:
    tex = node.astext()
    try:
        mathml = latex2mathml.tex2mathml(tex, as_block=as_block)
    except MathError as error:
        LOG.warning("equation cannot be written as MathML: %s in %r", error, tex, location=node)
        mathml = f"<code>{translator.encode(tex)}</code>"
    translator.body.append(f'<div class="equation">{mathml}</div>' if as_block else mathml)
    raise nodes.SkipNode


def _inline(translator: Any, node: nodes.Element) -> None:
    _write(translator, node, as_block=False)


def _display(translator: Any, node: nodes.Element) -> None:
    _write(translator, node, as_block=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
