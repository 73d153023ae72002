"""Formulas as MathML, which browsers set by themselves: nothing is loaded from anywhere, and text stays text."""

from __future__ import annotations

import html
import re
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

LOGGER = logging.getLogger(__name__)

WIDE = 36
"""More characters of LaTeX may be wider than the screen of a telephone."""
NAMESPACE = "http://www.w3.org/1998/Math/MathML"
ACCENTS = {"ˆ", "ˉ", "˙"}
BARS = {"|", "‖", "∥"}
ENTITY = re.compile(r"&(?!lt;|gt;|amp;)\w+;")
"""Of HTML, unknown to XML."""


def corrected(text: str) -> str:
    """MathML of the converter with what it does not know: primes and norms stand close, indices beside accents."""
    ElementTree.register_namespace("", NAMESPACE)
    root = ElementTree.fromstring(ENTITY.sub(lambda found: html.unescape(found[0]), text))
    for element in list(root.iter()):
        _space_functions(element)
        word = element.text or ""
        if word == "'":
            element.text = "′"
            element.attrib.update(lspace="0", rspace="0")
        elif word in BARS:  # else an operator between two terms
            form = "prefix" if element.attrib.pop("class", "") == "mathopen" else "postfix"
            element.attrib.update(form=form, lspace="0", rspace="0", stretchy="false")
        elif element.tag == f"{{{NAMESPACE}}}munderover" and element[2].text in ACCENTS:
            base, index, accent = element
            element.tag = f"{{{NAMESPACE}}}msub"
            beside = ElementTree.Element(f"{{{NAMESPACE}}}mover", accent="true")
            beside.extend([base, accent])
            element[:] = [beside, index]
    return ElementTree.tostring(root, encoding="unicode")


def _space_functions(row: ElementTree.Element) -> None:
    """Leave room between the name of a function and its neighbours: sin x, not sinx."""
    for child in list(row):
        place = list(row).index(child)
        if child.tag == f"{{{NAMESPACE}}}mi" and len(child.text or "") > 1:
            after = row[place + 1 : place + 2]
            if after and after[0].tag != f"{{{NAMESPACE}}}mo":
                row.insert(place + 1, ElementTree.Element(f"{{{NAMESPACE}}}mspace", width="0.17em"))
            if place and row[place - 1].tag != f"{{{NAMESPACE}}}mo":
                row.insert(place, ElementTree.Element(f"{{{NAMESPACE}}}mspace", width="0.17em"))


def mathml(node: nodes.Element, display: bool) -> str:
    r"""A formula as MathML; what cannot be read is a warning. ``\cr`` ends a row where ``\\`` would be an escape."""
    text = node.astext()
    try:
        return corrected(str(tex2mathml(text.replace(r"\cr ", r"\\ "), as_block=display)))
    except MathError as error:
        LOGGER.warning("formula %s: %s", text, error, location=node)
        return f"<code>{text}</code>"


def visit_math(self: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line."""
    wide = " wide" if len(node.astext()) > WIDE else ""
    self.body.append(f'<span class="math{wide}">{mathml(node, display=False)}</span>')
    raise nodes.SkipNode


def visit_math_block(self: HTML5Translator, node: nodes.math_block) -> None:
    """A formula of its own; one that is too wide scrolls inside itself."""
    self.body.append(f'<div class="math">{mathml(node, display=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))  # type: ignore[arg-type]
    return {"parallel_read_safe": True, "parallel_write_safe": True}
