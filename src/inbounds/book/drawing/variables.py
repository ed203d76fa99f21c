"""Colours as variables of CSS, so that what the browser draws follows the page's theme."""

from collections.abc import Mapping

from inbounds.book.drawing.figures import LOOKS, FamilyStyle


def color_variables(
    selector: str,
    prefix: str,
    colors: Mapping[str, Mapping[str, str]],
    looks: Mapping[str, FamilyStyle] = LOOKS,
    dark: str = 'html[data-theme="dark"] {}',
) -> str:
    """Return rules that give an element its colours, and those of the families or other curves, in both themes.

    Args:
        selector: of the element.
        prefix: with which the variables' names begin, after the two hyphens.
        colors: a name's colour, by theme, `light` and `dark`.
        looks: whose colours join them.
        dark: what the selector becomes in the dark theme.

    Example:
        >>> paper = {"light": {"page": "#fff"}, "dark": {"page": "#000"}}
        >>> print(color_variables(".a", "my", paper, looks={}))
        .a { --my-page: #fff; }
        html[data-theme="dark"] .a { --my-page: #000; }
    """
    curves = {
        "light": {name: look.color for name, look in looks.items()},
        "dark": {name: look.color_on_dark for name, look in looks.items()},
    }
    blocks = []
    for theme, scope in (("light", selector), ("dark", dark.format(selector))):
        values = {**colors[theme], **curves[theme]}
        blocks.append(
            f"{scope} {{ {' '.join(f'--{prefix}-{key}: {value};' for key, value in values.items())} }}"
        )
    return "\n".join(blocks)
