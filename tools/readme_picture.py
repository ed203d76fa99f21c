"""Draw book/_static/three_laws.svg, the picture of the README: what three policies do with one motor's box.

    python tools/readme_picture.py [FILE]

Written as SVG by hand, so that the file is small and the same on every machine; colours that do on light and dark.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy import stats

from inbounds.book.drawing import figures

TARGET = Path(__file__).resolve().parents[1] / "book" / "_static" / "three_laws.svg"
LOC, SCALE = 0.6, 0.6  # of a Gaussian beside the box [−1, 1]; the two others lie about as high in it
WIDTH, HEIGHT, MARGIN = 240, 150, 16
TOP = 1.3  # the density at the upper edge of a panel
GREY = "#808890"
PANELS = (("gaussian", "Gaussian, clipped"), ("beta", "Beta"), ("logit-normal", "logit-normal"))


def outside() -> float:
    """Probability that the Gaussian draws an action that the motor cannot execute."""
    law = stats.norm(LOC, SCALE)
    return float(law.cdf(-1) + law.sf(1))


def density(family: str, x: np.ndarray) -> np.ndarray:
    """Density of an action on [−1, 1]; the Gaussian's also beyond."""
    if family == "gaussian":
        return stats.norm.pdf(x, LOC, SCALE)
    unit = (x + 1) / 2
    if family == "beta":
        return stats.beta.pdf(unit, 3.0, 1.2) / 2
    logit = np.log(unit) - np.log1p(-unit)
    return stats.norm.pdf(logit, np.log(0.68 / 0.32), 1.0) / (unit * (1 - unit)) / 2


def point(x: float, y: float) -> str:
    """Where an action and a density lie in a panel."""
    across = MARGIN + (x + 1.7) / 3.7 * (WIDTH - 2 * MARGIN)
    return f"{across:.1f} {HEIGHT - 24 - min(y, TOP) / TOP * (HEIGHT - 60):.1f}"


def curve(family: str, low: float, high: float) -> str:
    """The path of a density between two actions."""
    x = np.linspace(low, high, 81)
    end = "" if family == "gaussian" else f"L{point(1, 0)}"
    return "M" + "L".join(point(*each) for each in zip(x, density(family, x), strict=True)) + end


def panel(family: str, name: str) -> str:
    """One policy: the box's edges, the density, and what lies beyond."""
    colour = figures.LOOKS[family].color_on_dark
    edges = "".join(f"M{point(edge, 0)}L{point(edge, TOP)}" for edge in (-1, 1))
    parts = [f'<path d="{edges}" stroke="{GREY}" stroke-width="3"/>']
    ends = (-1.7, 2.0) if family == "gaussian" else (-0.9999, 0.9999)
    if family == "gaussian":
        for low, high in ((-1.7, -1.0), (1.0, 2.0)):
            beyond = f"{curve(family, low, high)}L{point(high, 0)}L{point(low, 0)}Z"
            parts.append(f'<path d="{beyond}" fill="{colour}" fill-opacity=".35" stroke="none"/>')
    parts.append(f'<path d="{curve(family, *ends)}" stroke="{colour}" stroke-width="3"/>')
    told = (
        f"{outside():.0%} of its draws are clipped" if family == "gaussian" else "every draw can be executed"
    )
    middle = WIDTH / 2
    parts.append(f'<text x="{middle:g}" y="18" font-size="15">{name}</text>')
    parts.append(f'<text x="{middle:g}" y="{HEIGHT - 6}" font-size="12">{told}</text>')
    return "".join(parts)


def drawing() -> str:
    """The picture, as SVG."""
    label = (
        "Three densities on one motor's box. The Gaussian spills over the edge: "
        f"{outside():.0%} of its draws are clipped. The Beta and the logit-normal end at the edge: "
        "every draw can be executed."
    )
    panels = "".join(
        f'<g transform="translate({i * WIDTH})">{panel(*each)}</g>\n' for i, each in enumerate(PANELS)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {3 * WIDTH} {HEIGHT}" role="img" aria-label="{label}">\n'
        f'<g fill="none" stroke-linejoin="round">\n'
        f"<style>text{{fill:{GREY};stroke:none;text-anchor:middle;font-family:system-ui,sans-serif}}</style>\n"
        f"{panels}</g>\n</svg>\n"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", nargs="?", type=Path, default=TARGET)
    parser.parse_args().file.write_text(drawing(), encoding="utf8")
