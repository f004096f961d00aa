"""The report: one file, no network, small, and it draws without complaint."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from axialnav.fusion.config import Corridor, Section
from axialnav.replay.report.decimate import envelope, line_points, minmax_rows, scatter_rows
from axialnav.replay.report.page import render_report
from tests.replay.made_runs import make_run

MAX_BYTES = 8_000_000
LOADING = {"src", "href", "action", "data", "poster", "srcset"}


class Page(HTMLParser):
    """Everything the page would load, its text, and its scripts."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.scripts: list[str] = []
        self.text = ""
        self._inside = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._inside = tag
        self.loads += [value or "" for name, value in attrs if name in LOADING and not (value or "").startswith("#")]
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
        elif self._inside != "style":
            self.text += data


@pytest.fixture(scope="module")
def html() -> str:
    return render_report(make_run())


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def figures(page: Page) -> list[dict]:
    return json.loads(page.scripts[0])


def test_it_is_small_and_holds_plotly_once(html: str) -> None:
    assert len(html.encode()) < MAX_BYTES
    assert html.count("plotly.js v") == 1


def test_it_loads_nothing_and_forbids_itself_to(html: str, page: Page) -> None:
    assert page.loads == []
    assert "@import" not in html.split("<script")[0]
    assert "default-src 'none'" in html


def test_verdict_and_coverage_come_first(html: str, page: Page) -> None:
    titles = re.findall(r"<h2>(.*?)</h2>", html)
    assert titles[:2] == ["Verdict and coverage", "Axial velocity"]
    assert "3501 of 3501" in page.text


def test_no_trace_has_more_points_than_the_screen_can_show(page: Page) -> None:
    traces = [trace for figure in figures(page) for trace in figure["traces"] if isinstance(trace["x"], dict)]
    sizes = [len(base64.b64decode(trace["x"]["bdata"])) // 4 for trace in traces]
    assert len(sizes) > 15
    assert max(sizes) <= 4000  # a band runs there and back


def test_without_truth_the_page_says_not_evaluated() -> None:
    text = Page(render_report(make_run(truth=False))).text
    assert "NOT_EVALUATED" in text
    assert "Nothing was scored" in text


def test_after_rigid_alignment_the_page_says_so() -> None:
    assert "rigid alignment" in Page(render_report(make_run(initial=False))).text


def test_each_section_of_a_corridor_has_its_row() -> None:
    straight = Section(kind="straight", start=(-3.0, 0.0, 0.0), end=(0.0, 0.0, 0.0))
    stairs = Section(kind="stairs", start=(90.0, 0.0, 0.0), end=(99.0, 0.0, 3.0))
    html = render_report(make_run(corridor=Corridor(section=(straight, stairs))))
    assert re.search(r"<th>straight_1</th><td>0\.\d+</td>", html)
    assert "<th>stairs_2</th><td>NOT_EVALUATED</td>" in html


def test_text_from_a_recording_cannot_become_markup() -> None:
    run = make_run()
    object.__setattr__(run.flight, "name", "</script><b>bold</b>")
    run.flight.info["note"] = "<img src=x>"  # type: ignore[index]
    html = render_report(run)
    assert "<b>bold</b>" not in html
    assert "<img src=x>" not in html


def test_decimation_keeps_every_extreme() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=100_000)
    values[[12_345, 98_765]] = [50.0, -60.0]
    values[500:520] = np.nan
    rows = minmax_rows(values, 2000)
    assert rows.size <= 2000
    assert {0, 12_345, 98_765, 99_999} <= set(rows.tolist())
    for chunk in np.array_split(np.arange(values.size), 500):
        kept = values[rows[(rows >= chunk[0]) & (rows <= chunk[-1])]]
        assert kept.size >= 2


def test_a_thinned_cloud_keeps_its_density_and_its_extremes() -> None:
    values = np.random.default_rng(1).normal(size=50_000)
    values[777] = 40.0
    rows = scatter_rows(values, 2000)
    assert rows.size <= 2000
    assert 777 in rows
    assert np.median(np.abs(values[rows])) < 1.15  # 0.67 for the whole cloud, 3.3 for its extremes alone
    assert scatter_rows(values[:100], 2000).tolist() == list(range(100))


def test_readings_that_come_in_turns_are_all_drawn() -> None:
    anchor = np.arange(40_000) % 8
    rows = scatter_rows(np.zeros(anchor.size), 2000)
    assert np.bincount(anchor[rows], minlength=8).min() > 120


def test_a_line_breaks_at_gaps_and_nowhere_else() -> None:
    seconds = np.concatenate((np.arange(0.0, 50.0, 0.01), np.arange(60.0, 100.0, 0.01)))
    x, y = line_points(seconds, np.sin(seconds), 2000)
    breaks = np.flatnonzero(np.isnan(y))
    assert x.size <= 2000
    assert breaks.size == 1
    assert x[breaks[0] - 1] == pytest.approx(49.99)
    assert x[breaks[0] + 1] == pytest.approx(60.0)


def test_a_band_never_shrinks_by_decimation() -> None:
    seconds = np.arange(0.0, 100.0, 0.01)
    low, high = np.sin(7.0 * seconds) - 1.0, np.sin(7.0 * seconds) + 1.0
    x, lower, upper = envelope(seconds, low, high, 500)
    assert x.size == 500
    assert lower.min() == low.min()
    assert upper.max() == high.max()
    assert np.all(np.interp(x, seconds, high) <= upper + 1e-12)
