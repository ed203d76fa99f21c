"""An explorable: the greenhouse of *Your own environment*, run by a rule whose numbers the reader sets.

::

    from inbounds.book.explorables.greenhouse_by_hand import greenhouse_by_hand

    greenhouse_by_hand()

The greenhouse runs in the reader's browser (`explorables/greenhouse_by_hand.js`) and is tested against
`inbounds.book.own_task.greenhouse`. Its days are days for choosing, so that nobody tunes a rule on the table's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from bokeh.models import ColumnDataSource, CustomJSTickFormatter, Slider
from bokeh.plotting import figure
from matplotlib.figure import Figure
from numpy.typing import NDArray

from inbounds.book.drawing import figures
from inbounds.book.explorables.frame import Explorable, curve, plot, slider
from inbounds.book.explorables.legend import Mark
from inbounds.book.own_task import greedy
from inbounds.book.own_task import greenhouse as house
from inbounds.book.own_task import greenhouse_runs as runs

__all__ = ["DAYS", "WHO", "HandRule", "a_day", "greenhouse_by_hand"]

WHO: dict[str, figures.FamilyStyle] = {
    "yours": figures.FamilyStyle("your rule", "#A8330A", "#DD5B33", "-", "s"),
    "chapter": figures.FamilyStyle("the chapter's", "#4B1E78", "#A98BF0", "--", "o"),
    "learned": figures.FamilyStyle("a learned policy", "#1F8277", "#52CCAB", "-.", "^"),
    "asked": figures.FamilyStyle("most power asked for", "#CC7E14", "#FFD394", ":", "D"),
}
"""Who runs the greenhouse, and what the reader's rule asks the pump for, and the look of each."""

DAYS = {"cold": 5007, "mild": 5004, "warm": 5012}
"""The days for choosing with the coldest, the middle and the warmest season: names and seeds."""

_AIM, _GAIN, _OPENS = (15.0, 26.0), (0.0, 8.0), (20.0, 30.0)


@dataclass(frozen=True)
class HandRule:
    """The chapter's thermostat with an aim for the night and one for the day; as it stands, that thermostat.

    Its `act` has an example.
    """

    night: float = 22.0
    """Aim while the sun is down [°C]."""
    day: float = 22.0
    """Aim while the sun is up [°C]."""
    gain: float = 4.0
    """[kW per °C]."""
    opens: float = 23.0
    """Where the vent begins to open; it is wide open 2 °C above [°C]."""

    def asks(self, obs: NDArray[Any]) -> NDArray[Any]:
        """Return the power that the rule asks for `[N]`, before any bound [kW], of observations `[N, 5]`."""
        aim = np.where(obs[:, 2] > 1e-6, np.float32(self.day), np.float32(self.night))
        return np.float32(self.gain) * (aim - obs[:, 0])

    def act(self, obs: NDArray[Any]) -> NDArray[Any]:
        """Return actions `[N, 2]` of observations `[N, 5]`; the rule heats or does not, it never cools.

        Example:
            >>> import numpy as np
            >>> rule = HandRule(night=18.0, day=21.0)
            >>> rule.act(np.array([[17.0, 0, 0.0, 0, 0], [17.0, 0, 2.0, 0, 0]], np.float32)).tolist()
            [[4.0, 0.0], [8.0, 0.0]]
        """
        power = np.clip(self.asks(obs), 0, house.HIGH[0])
        vent = np.clip((obs[:, 0] - self.opens) / 2, 0, 1)
        return np.stack([power, vent], -1).astype(np.float32)


def a_day(act: Any, seed: int) -> dict[str, NDArray[np.float64]]:
    """Return what a day in the greenhouse was like, of T ≤ 96 quarters of an hour.

    Args:
        act: who acts, observations `[N, 5]` to actions `[N, 2]`.
        seed: the day's.

    Returns:
        inside, the temperatures `[T + 1]`, the last in single precision; outside, power and vent as executed, and
        reward `[T]`.

    Example:
        >>> from inbounds.book.explorables.greenhouse_by_hand import DAYS, HandRule
        >>> from inbounds.book.own_task import greenhouse as house
        >>> day = a_day(HandRule(gain=0.0).act, DAYS["cold"])
        >>> len(day["reward"]) < house.DAY, bool(day["inside"][-1] < house.COLD)
        (True, True)
    """
    envs, record = house.GreenhouseBatch(1), []
    obs, _ = envs.reset(seed=[seed])
    over = False
    while not over:
        inside, *now = envs.state[:, 0].tolist()
        power, vent = np.clip(act(obs), house.LOW, house.HIGH)[0].tolist()
        obs, reward, terminated, truncated, info = envs.step(np.array([[power, vent]], np.float32))
        record.append((inside, house.weather(*now)[0], power, vent, float(reward[0])))
        over = bool(terminated[0] or truncated[0])
    inside, outside, power, vent, reward = np.array(record).T
    inside = np.append(inside, info["final_obs"][0, 0])
    return {"inside": inside, "outside": outside, "power": power, "vent": vent, "reward": reward}


def greenhouse_by_hand(
    day: str = "warm", night_aim: float = 20.0, day_aim: float = 20.0, gain: float = 2.0, opens: float = 23.0
) -> Explorable:
    """Run the greenhouse for a day by a rule of one's own, beside the chapter's rule and a policy that has learned.

    Args:
        day: Initial day, a key of `DAYS`.
        night_aim: Initial aim while the sun is down [°C], in [15, 26].
        day_aim: Initial aim while the sun is up [°C], in [15, 26].
        gain: Initial power for each degree below the aim [kW per °C], in [0, 8].
        opens: Initial temperature from which the vent opens [°C], in [20, 30].

    Returns:
        An explorable with the temperature inside, the pump's power and the vent over a day, and a table of returns,
        of what cold, warmth and the pump cost, and of how often a bound is executed.

    Raises:
        ValueError: If a value lies outside its slider.

    Example:
        >>> greenhouse_by_hand(day="warm").name
        'greenhouse-by-hand'
    """
    values = (night_aim, _AIM), (day_aim, _AIM), (gain, _GAIN), (opens, _OPENS)
    if day not in DAYS or not all(low <= value <= high for value, (low, high) in values):
        raise ValueError(
            f"day={day!r}, night_aim={night_aim:g}, day_aim={day_aim:g}, gain={gain:g}, opens={opens:g} lie outside "
            f"the sliders: choose day among {', '.join(DAYS)}, the aims in [15, 26], gain in [0, 8], opens in [20, 30]"
        )
    rule = HandRule(night_aim, day_aim, gain, opens)
    earned, rival = (float(a_day(one.act, DAYS[day])["reward"].sum()) for one in (rule, HandRule()))
    return Explorable(
        name="greenhouse-by-hand",
        title="a day in the greenhouse under a rule of your own, over day, aims, gain and vent",
        alt=(
            "Three plots over the hours of a day, each with a curve for your rule, the chapter's and a learned policy: "
            "the temperature inside, with a band from 17 to 25 °C and the temperature outside; the pump's power, with "
            f"lines at its bounds, and what your rule asked for; the vent. On the {day} day a rule with the aims "
            f"{night_aim:g} °C at night and {day_aim:g} °C by day, {gain:g} kW per degree and a vent that opens from "
            f"{opens:g} °C on earns {earned:.1f}, the chapter's {rival:.1f}."
        ),
        controls=(
            _days(day),
            slider("night", "aim at night [°C]", *_AIM, night_aim, 0.5, digits=1),
            slider("day", "aim by day [°C]", *_AIM, day_aim, 0.5, digits=1),
            slider("gain", "power per °C below the aim [kW]", *_GAIN, gain, 0.5, digits=1),
            slider("opens", "vent opens from [°C]", *_OPENS, opens, 0.5, digits=1),
        ),
        plots=_course(),
        columns={name: WHO[name].label for name in ("yours", "chapter", "learned")},
        rows={
            "earned": "return of this day",
            "cold": "lost to cold",
            "warm": "lost to warmth",
            "pump": "paid for the pump",
            "hours": "hours at 17 to 25 °C",
            "asked": WHO["asked"].label,
            "pump_bound": "pump at a bound",
            "vent_bound": "vent at a bound",
            "mean": f"mean of {len(runs.CHOSEN_BY)} days",
        },
        fallback=lambda: _static(rule, day),
        looks=WHO,
        legend=(
            Mark("band", "grid", "17 to 25 °C, where the crop grows well", of=("band",)),
            Mark("thin", "line", "first plot: the temperature outside", of=("outside",)),
            Mark("thin", "line", "second plot: the pump’s bounds, −2 and 8 kW", of=("bounds",)),
        ),
    )


def _days(day: str) -> Slider:
    """Return the slider over the days, which shows their names."""
    names = list(DAYS)
    choice = slider("which", "day", 0, len(names) - 1, names.index(day), 1)
    choice.format = CustomJSTickFormatter(code=f"return {names}[Math.round(tick)]")
    return choice


def _course() -> tuple[figure, ...]:
    """Return the three plots over the hours, empty."""
    parts = {
        "inside": ("inside [°C]", 260),
        "power": ("pump [kW]", 190),
        "vent": ("vent [share]", 150),
    }
    plots = []
    for part, (label, height) in parts.items():
        fig = plot("hour" if part == "vent" else "", label, (0.0, 24.0), f"{part}-range", height=height)
        fig.xaxis.ticker.desired_num_ticks = 5
        fig.xaxis.ticker.mantissas = [1, 3, 6]
        fig.min_border_left = 58
        fig.yaxis.ticker.desired_num_ticks = {"inside": 5, "power": 4, "vent": 2}[part]
        if part == "inside":
            band = ColumnDataSource({"x": [], "y": []}, name="band")
            fig.patch("x", "y", source=band, name="grid", fill_alpha=0.7, line_alpha=0.0)
        if part != "vent":
            thin = ColumnDataSource({"x": [], "y": []}, name="outside" if part == "inside" else "bounds")
            fig.line("x", "y", source=thin, name="line", line_width=1)
        if part == "power":
            curve(fig, "asked", WHO["asked"], source="asked")
        for name in ("learned", "chapter", "yours"):
            curve(fig, name, WHO[name], source=f"{name}-{part}")
            fig.renderers[-1].glyph.line_width = 2.5
        plots.append(fig)
    return tuple(plots)


def _static(rule: HandRule, day: str) -> Figure:
    """Draw the static figure of `greenhouse_by_hand`."""
    acts = {"learned": greedy(runs.policies("logit-normal")[0]), "chapter": HandRule().act, "yours": rule.act}
    with figures.use_style():
        fig, axes = plt.subplots(3, 1, figsize=(figures.WIDTH, 7.2), sharex=True)
        axes[0].axhspan(17, 25, color="#DFE3E8")
        for bound in (house.LOW[0], house.HIGH[0]):
            axes[1].axhline(bound, color="#5F6770", linewidth=1)
        for name, act in acts.items():
            look, found = WHO[name], a_day(act, DAYS[day])
            kind = {"color": look.color, "linestyle": look.linestyle}
            hours = np.arange(len(found["inside"])) / 4
            axes[0].plot(hours, found["inside"], label=look.label, **kind)
            for ax, part in zip(axes[1:], ("power", "vent"), strict=True):
                ax.stairs(found[part], hours, baseline=None, linewidth=2, **kind)
            if name == "yours":
                axes[0].plot(hours[:-1], found["outside"], color="#5F6770", linewidth=1)
        for ax, label in zip(axes, ("inside [°C]", "pump [kW]", "vent [share]"), strict=True):
            ax.set(ylabel=label, xlim=(0, 24))
        axes[1].set_ylim(-3, 10)
        axes[2].set(xlabel="hour", xticks=[0, 6, 12, 18, 24], ylim=(-0.05, 1.05))
        axes[0].legend(loc="upper center", bbox_to_anchor=(0.5, 1.25), ncols=3)
    return fig
