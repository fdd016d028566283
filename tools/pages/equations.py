"""Equations as MathML: browsers draw it themselves, so that a page needs no script and no font from elsewhere."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

# What `pymdownx.arithmatex` makes of $…$ and $$…$$.
_SPAN = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
# The bars of |x|, which a browser would space as those of "given".
_BAR = re.compile(r"<mo[^>]*>(?:&#x0007C;|&#x2223;|\|)</mo>")
_TIGHT = '<mo stretchy="false" lspace="0" rspace="0">|</mo>'


def to_mathml(page: str, source: str) -> str:
    """Replace every equation of a page.

    Raises
    ------
    ValueError
        An equation cannot be read; the page and the equation are named.
    """

    def one(match: re.Match[str]) -> str:
        tag, opening, latex = match.groups()
        latex = html.unescape(latex).strip()
        try:
            mathml = convert(latex, display="block" if opening == "[" else "inline")
        except Exception as error:
            raise ValueError(f"{source}: the equation {latex!r} cannot be read: {error}") from error
        if "\\" in re.sub(r"<[^>]*>", "", mathml):
            raise ValueError(f"{source}: the equation {latex!r} has a command that is not known")
        return f'<{tag} class="equation">{_BAR.sub(_TIGHT, mathml)}</{tag}>'

    return _SPAN.sub(one, page)
