"""How colours differ to the eye: with every kind of colour vision, in greyscale, and against a page's ground."""

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np

# sRGB (linear) to CIE XYZ, D65.
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
# Complete dichromacy: Machado, Oliveira & Fernandes (2009), A Physiologically-based Model for Simulation of Color
# Vision Deficiency, severity 1.0.
VISION = {
    name: np.array(rows).reshape(3, 3)
    for name, rows in {
        "normal": [1, 0, 0, 0, 1, 0, 0, 0, 1],
        "protan": [
            0.152286,
            1.052583,
            -0.204868,
            0.114503,
            0.786281,
            0.099216,
            -0.003882,
            -0.048116,
            1.051998,
        ],
        "deutan": [
            0.367322,
            0.860646,
            -0.227968,
            0.280085,
            0.672501,
            0.047413,
            -0.011820,
            0.042940,
            0.968881,
        ],
        "tritan": [
            1.255528,
            -0.076749,
            -0.178779,
            -0.078411,
            0.930809,
            0.147602,
            0.004733,
            0.691367,
            0.303900,
        ],
    }.items()
}
GROUNDS = {"white": "#ffffff", "dark": "#14181e"}


def linear_rgb(color: str) -> np.ndarray:
    srgb = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def cie_lab(rgb: np.ndarray) -> np.ndarray:
    x, y, z = np.cbrt(XYZ @ np.clip(rgb, 1e-4, 1) / [0.95047, 1.0, 1.08883])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def contrast(first: str, second: str) -> float:
    """Ratio of relative luminances; graphics need 3 to 1 (WCAG 2.1, 1.4.11)."""
    dim, bright = sorted(XYZ[1] @ linear_rgb(color) for color in (first, second))
    return float((bright + 0.05) / (dim + 0.05))


def assert_looks_differ(looks: Iterable[Any], ground: str, lightness_gap: float = 0.0) -> None:
    """Assert that looks stand out from the ground, and from each other by colour, lightness and kind of line."""
    looks = list(looks)
    colors = [look.color if ground == "white" else look.color_on_dark for look in looks]
    for color in colors:
        assert contrast(color, GROUNDS[ground]) > 2.95, color
    for pair in itertools.combinations(colors, 2):
        first, second = map(linear_rgb, pair)
        for name, vision in VISION.items():
            assert np.linalg.norm(cie_lab(vision @ first) - cie_lab(vision @ second)) > 15, (pair, name)
        assert abs(cie_lab(first)[0] - cie_lab(second)[0]) > lightness_gap, pair
    assert len({look.linestyle for look in looks}) == len(looks)
