"""The report says what there is, calls missing what is not, and needs no other file."""

import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from inbounds.book.report import html
from inbounds.book.report.arms import columns_of
from inbounds.book.report.changes import changes
from inbounds.book.report.study_report import write_report
from inbounds.cli.studying import study
from inbounds.study import StudyFolder, analysis
from inbounds.study.analysis import ENDPOINTS, Contrast
from inbounds.study.grid import select
from inbounds.study.outcomes import Column, Outcomes
from inbounds.study.statistics import Comparison, Estimate
from inbounds.study.words import number, p_value, spoken, verdict
from tests.study.small import folder_in
from tests.study.synthetic import write_cells


class Page(HTMLParser):
    """What a page holds: rows of its tables by caption, texts of its images, headings, addresses, items."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.images: list[str] = []
        self.headings: list[str] = []
        self.addresses: list[str] = []
        self.missing: list[str] = []
        self.items: list[str] = []
        self.open: list[str] = []
        self.caption = ""
        self.feed(text)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.addresses += [values[name] for name in ("src", "href") if name in values]
        if tag == "img":
            self.images.append(values["alt"])
        if tag not in ("meta", "img", "source", "br", "!doctype"):
            self.open.append(tag)
        if tag == "tr":
            self.tables[self.caption].append([])
        if tag in ("td", "th"):
            self.tables[self.caption][-1].append("")
        self.set_back = tag == "p" and values.get("class") == "missing"

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        here = self.open[-1] if self.open else ""
        data = data.replace("\N{NO-BREAK SPACE}", " ")
        if here == "caption":
            assert data not in self.tables, "two tables with one caption"
            self.caption = data
            self.tables[data] = []
        elif here in ("td", "th"):
            self.tables[self.caption][-1][-1] += data
        elif here in ("h1", "h2", "h3"):
            self.headings.append(data)
        elif here == "li":
            self.items.append(data)
        elif here == "p" and self.set_back:
            self.missing.append(data)

    def table(self, start: str) -> list[list[str]]:
        """Rows of the first table whose caption starts so."""
        return next(rows for caption, rows in self.tables.items() if caption.startswith(start))


def report(folder: StudyFolder, path: Path) -> Page:
    before = dict(mpl.rcParams)
    sections: list[str] = []
    write_report(Outcomes.read(folder), path / "report.html", sections.append)
    assert dict(mpl.rcParams) == before
    page = Page((path / "report.html").read_text(encoding="utf8"))
    assert [heading for heading in page.headings if heading in sections] == sections
    assert len(sections) == 9
    assert all(address.startswith(("data:image/png;base64,", "#")) for address in page.addresses)
    assert all(len(alt.split()) > 8 for alt in page.images)
    for rows in page.tables.values():
        assert {len(row) for row in rows} == {len(rows[0])}
    return page


def test_nothing_is_finished(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "report.html"
    (tmp_path / "r").mkdir()
    where = ["--results", str(tmp_path / "r"), "--work", str(tmp_path / "w"), "--out", str(out)]
    assert study(["report", *where]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "reading the cells"  # a pipe, too, says what is under way
    assert sum(line.startswith("writing: ") for line in said) > 3
    assert said[-2] == "0 of 136 cells are finished"
    page = Page(out.read_text(encoding="utf8"))
    assert page.images == []
    assert (
        len(page.missing) == 3 + 5 + 1 + 6 + 1
    )  # arms, groups of the fourth, cells of later, second study, provenance
    assert page.table("Finished cells")[1] == ["Arm 1: standard practice", *["0 of 5"] * 6]


def test_one_cell_is_finished(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    write_cells(folder, select(["standard-hopper-ppo-beta"]))
    page = report(folder, tmp_path)
    curves, finals = page.images
    assert "Hopper: Gaussian, clipped missing, Beta" in curves
    assert "Swimmer" not in curves + finals  # robots of which nothing is finished have one place, the strip
    assert {"Hopper: 1 of 3", "Swimmer: 0 of 3", "Ant: 0 of 3"} <= set(page.items)
    assert any("of no robot are two cells to be compared finished" in text for text in page.missing)
    assert not any(caption.startswith("Differences of means (PPO") for caption in page.tables)
    rows = page.table("Endpoints (PPO, standard")
    (there,) = [row for row in rows[1:] if row[2] != "missing"]
    assert there[:2] + there[-2:] == ["Hopper", "Beta", "10", "0"]
    outcome = Outcomes.read(folder).finished["standard-hopper-ppo-beta"]
    assert there[2] == spoken(analysis.estimate(outcome, "final"))
    assert there[5] == spoken(analysis.estimate(outcome, "area", "iqm"))
    assert len(rows) == 1 + 3
    (endpoints,) = [caption for caption in page.tables if caption.startswith("Endpoints (PPO")]
    assert endpoints.endswith("Not finished: HalfCheetah, Swimmer, Walker2d, Ant, Humanoid.")
    assert any("aggregates need all six robots" in text for text in page.missing)
    ran_on = page.table("What the cells ran on")
    assert ran_on[1][::3] == ["1", "1"]  # one part, on the first machine of the list
    processor = outcome.metadata["sessions"][0]["processor"]
    assert any(text.startswith("1: ") and text.endswith(f"; {processor}") for text in page.items)


@pytest.mark.slow
def test_all_robots_and_some_mechanisms_are_finished(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    odd = select(["standard-swimmer-ppo-gaussian"])
    write_cells(folder, [cell for cell in select(["standard-*-ppo-*"]) if cell not in odd])
    write_cells(folder, odd, diverged=(0, 4))
    write_cells(folder, select(["mechanisms-hopper-ppo-*-entropy-0", "beyond-hopper-trpo-beta"]))
    write_cells(folder, select(["afterwards-ant-ppo-*", "afterwards-halfcheetah-trpo-gaussian-*"]))
    page, outcomes = report(folder, tmp_path), Outcomes.read(folder)
    gaps = analysis.differences(outcomes, Contrast("standard", "ppo", "logit-normal", "gaussian"), "greedy")
    row = next(
        r
        for r in page.table("Differences of means (PPO, standard practice)")
        if r[:2] == ["Ant", "Logit-normal − Gaussian"]
    )
    assert row[8:] == [spoken(gaps["Ant"].difference), verdict(gaps["Ant"]), p_value(gaps["Ant"].p_adjusted)]
    without = page.table("Means of the cells concerned (PPO")
    assert [line[:2] + line[-1:] for line in without[1:]] == [["Swimmer", "Gaussian, clipped", "8"]]
    assert "Differences of means (PPO, standard practice, without seeds that diverged" in " ".join(
        page.tables
    )
    iqm = analysis.aggregate(outcomes, Column("standard", "ppo", "beta"), "final")
    assert f"Beta {number(iqm.value)}" in next(a for a in page.images if "IQM of the normalised final" in a)  # type: ignore[union-attr]
    assert len(page.table("IQM of normalised scores (")) == 1 + 5
    assert len(page.table("Probability of improvement (standard practice)")) == 1 + 4
    profiles = [alt for alt in page.images if alt.startswith("Performance profiles")]
    assert len(profiles) == 2
    # What all rows share is in the caption.
    changes = page.table("Entropy bonus (Hopper, PPO, entropy 0): changed cell minus")
    assert changes[0][:2] == ["family", "final return"]
    assert [line[0] for line in changes[1:]] == ["Gaussian, clipped", "Beta", "Logit-normal"]
    assert {"Hopper, entropy 0: 3 of 3", "HalfCheetah, entropy 0: 0 of 3"} <= set(page.items)
    later = page.table("Initial noise, asked afterwards (Ant, PPO, ")  # TRPO: nothing to compare with
    assert len(later) == 2
    (found,) = outcomes.and_of(select(["afterwards-ant-ppo-*"])).finished.keys() - outcomes.finished.keys()
    change = analysis.change(outcomes, outcomes.and_of(select([found])).finished[found], "final")
    assert spoken(change) == later[1][1]
    assert len(page.table("Final policies by way to act")) == 1 + 18
    beyond = {row[1] for row in page.table("Endpoints (TRPO, beyond the thesis)")[1:]}
    assert beyond == {"Gaussian, clipped", "CAPG", "Beta", "Logit-normal"}


def test_damaged_cells_are_listed(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    (cell,) = select(["printed-hopper-ppo-beta"])
    write_cells(folder, [cell])
    folder.cell_file(cell).write_bytes(b"nothing")
    report(folder, tmp_path)
    assert f"<li>{cell.id}: damaged</li>" in (tmp_path / "report.html").read_text(encoding="utf8")


def test_arm_three_stands_beside_arm_one() -> None:
    assert columns_of("beyond", "trpo") == {
        "gaussian": Column("standard", "trpo", "gaussian"),
        "clipped-gaussian": Column("beyond", "trpo", "clipped-gaussian"),
        "beta": Column("beyond", "trpo", "beta"),
        "logit-normal": Column("standard", "trpo", "logit-normal"),
    }
    assert list(columns_of("standard", "trpo")) == ["gaussian", "logit-normal"]
    assert {c.arm for c in columns_of("printed", "ppo").values()} == {"printed"}


@pytest.mark.parametrize(
    ("low", "value", "high", "p", "said"),
    [
        (1, 2, 3, 0.01, "higher"),
        (-3, -2, -1, 0.01, "lower"),
        (-1, 2, 3, 0.01, "unresolved"),
        (1, 2, 3, 0.2, "not after Holm"),
    ],
)
def test_verdicts(low: float, value: float, high: float, p: float, said: str) -> None:
    gap = Estimate(*map(np.asarray, (value, low, high)), 10, 0, 0.95, "difference of means")
    assert verdict(Comparison(gap, p, p)) == said


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: number(-1234.5), "−1234"),
        (lambda: number(9.96), "10.0"),
        (lambda: number(-0.04), "0.0"),  # no minus before a zero
        (lambda: spoken(Estimate(*map(np.asarray, (-0.2, -1.0, 0.3)), 10, 0, 0.95, "mean"), 0), "0 [−1, 0]"),
        (lambda: p_value(0.00099), "< 0.001"),
        (lambda: p_value(0.0421), "0.042"),
        (lambda: spoken(None), "missing"),
    ],
)
def test_numbers_in_words(make: Callable[[], str], said: str) -> None:
    assert make() == said


def test_text_is_escaped_and_alt_text_is_asked_for() -> None:
    table = html.table("Caption.", ["x", "y"], [["", "a < b"]])
    assert "<td>a &lt; b</td>" in table
    assert 'scope="row"' not in table  # nothing heads nothing
    with pytest.raises(ValueError, match="too short"):
        html.figure_of(lambda narrow: mpl.figure.Figure(), "A figure")


def test_the_first_word_of_a_row_heads_it() -> None:
    table = html.table("Caption.", ["x", "y"], [["Ant", "5"], ["Hopper", "6"]])
    assert re.findall(r"<(t[hd])(.*?)>(.*?)</t[hd]>", table.partition("<tbody>")[2]) == [
        ("th", ' scope="row" class="words"', "Ant"),
        ("td", "", "5"),
        ("th", ' scope="row" class="words"', "Hopper"),
        ("td", "", "6"),
    ]
    assert 'scope="row"' not in html.table("Caption.", ["x", "y"], [["1", "word"]], words=(1,))


def test_changes_are_told_in_a_line_each_and_by_every_endpoint_in_a_fold(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    write_cells(folder, select(["standard-hopper-ppo-*", "mechanisms-hopper-ppo-beta-entropy-*"]))
    write_cells(folder, select(["mechanisms-hopper-ppo-gaussian-entropy-0.01", "standard-ant-ppo-gaussian"]))
    write_cells(folder, select(["mechanisms-ant-ppo-gaussian-raw-cost"]))
    outcomes = Outcomes.read(folder)

    def told(family: str, weight: str, endpoint: str) -> str:
        cell = outcomes.finished.get(f"mechanisms-hopper-ppo-{family}-entropy-{weight}")
        return spoken(cell and analysis.change(outcomes, cell, endpoint))

    text = changes(outcomes, "entropy").html
    page, weights = Page(text), ("0", "0.001", "0.01")
    assert page.table("Entropy bonus (Hopper, PPO): change of the mean final return") == [
        ["changed", "Gaussian, clipped", "Beta"],
        *([f"entropy {w}", told("gaussian", w, "final"), told("beta", w, "final")] for w in weights),
    ]
    assert told("gaussian", "0", "final") == "missing" != told("gaussian", "0.01", "final")
    beta = [["Beta", *(told("beta", w, endpoint) for endpoint in ENDPOINTS)] for w in weights]
    assert page.table("Entropy bonus (Hopper, PPO): changed cell minus")[1:] == [
        *(["entropy 0"], beta[0]),
        *(["entropy 0.001"], beta[1]),
        *(["entropy 0.01"], ["Gaussian, clipped", *(told("gaussian", "0.01", e) for e in ENDPOINTS)]),
        beta[2],
    ]
    fold = text.partition("<details>")[2].partition("</details>")[0]
    assert fold.count('<th scope="rowgroup" colspan="4"') == fold.count("<tbody>") == 3
    assert "<details>" not in changes(outcomes, "raw-cost").html


def test_changes_on_several_robots_stand_below_the_robot(tmp_path: Path) -> None:
    folder, robots = folder_in(tmp_path), ("Hopper", "HalfCheetah")
    write_cells(folder, select([f"*-{robot.lower()}-ppo-gaussian*" for robot in robots]))
    table = Page(changes(Outcomes.read(folder), "entropy").html).table(
        "Entropy bonus (PPO): change of the mean"
    )
    weights = ["entropy 0", "entropy 0.001", "entropy 0.01"]
    assert [row[0] for row in table] == ["changed", "HalfCheetah", *weights, "Hopper", *weights]
    assert {len(row) for row in table} == {1, 2}


def test_a_file_that_cannot_be_written_is_a_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "r").mkdir()
    where = ["--results", str(tmp_path / "r"), "--work", str(tmp_path / "w")]
    assert study(["report", *where, "--out", str(tmp_path / "file" / "report.html")]) == 1
    assert "choose another --out" in capsys.readouterr().err
