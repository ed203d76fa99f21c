"""Draw book/_static/social.png, the picture in previews of links to the book.

    python tools/social_picture.py [FILE]

Logit-normal densities on one action's box, in the colours of the logo. Services show no SVG.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import torch
from PIL import Image

from inbounds.distributions import LogitNormal

TARGET = Path(__file__).resolve().parents[1] / "book" / "_static" / "social.png"
SIZE = (12, 6.3)  # inches, at 100 dots each
LOW, HIGH = -1.0, 1.0
POLICIES = ((-1.2, 0.7), (0.3, 0.5), (0.9, 1.9))  # mean and standard deviation of the latent
BLUE, GREY, INK = "#0072b2", "#8a8f98", "#22262b"


def draw(target: Path) -> None:
    """Draw the picture into a file."""
    figure = plt.figure(figsize=SIZE, dpi=100, facecolor="white")
    axes = figure.add_axes((0.5, 0.16, 0.44, 0.68))
    x = torch.linspace(LOW, HIGH, 801, dtype=torch.float64)[1:-1]
    for (loc, scale), alpha in zip(POLICIES, (1.0, 0.65, 0.4), strict=True):
        law = LogitNormal(torch.tensor(loc, dtype=x.dtype), torch.tensor(scale, dtype=x.dtype), LOW, HIGH)
        axes.plot(x, law.log_prob(x).exp(), color=BLUE, alpha=alpha, linewidth=6, solid_capstyle="round")
    axes.vlines((LOW, HIGH), 0, 2.2, color=GREY, linewidth=6)
    axes.set(xlim=(-1.06, 1.06), ylim=(-0.05, 2.25))
    axes.axis("off")
    figure.text(0.06, 0.53, "In Bounds", fontsize=62, family="DejaVu Serif", color=INK)
    figure.text(
        0.06,
        0.33,
        "Policy gradients on\nbounded action spaces",
        fontsize=26,
        color="#4a5058",
        linespacing=1.4,
    )
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB")
    picture.quantize(48).save(target, optimize=True)
    plt.close(figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", nargs="?", type=Path, default=TARGET)
    draw(parser.parse_args().file)
