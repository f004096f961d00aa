"""The report in a real browser: it draws without complaint, zooms, toggles, explains, in the dark and on a phone."""

from __future__ import annotations

import html as html_text
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from axialnav.replay.report.page import render_report
from tests.replay.made_runs import make_run

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PROBE = Path(__file__).with_name("report_probe.js")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run")
DARK = "--blink-settings=preferredColorScheme=0"
PHONE_PX, DESK_PX = 360, 1200

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine to open the page with"),
]


def used(folder: Path, width: int, *flags: str) -> dict[str, Any]:
    """What the probe found; no line of the browser's console may speak of the page."""
    page = folder / "report.html"
    probe = f"<script>{PROBE.read_text(encoding='utf-8')}</script></body>"
    page.write_text(render_report(make_run()).replace("</body>", probe), encoding="utf-8")
    # a browser window cannot be as narrow as a phone, a frame in it can
    frame = f'<iframe src="report.html" style="border: 0; width: {width}px; height: 12000px"></iframe>'
    outer = "<meta name=color-scheme content='light dark'><pre id=told></pre>"
    listener = "onmessage = (event) => { document.getElementById('told').textContent = event.data; };"
    (folder / "outer.html").write_text(f"{outer}<script>{listener}</script>{frame}", encoding="utf-8")
    options = [f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr", "--virtual-time-budget=20000"]
    command = [str(CHROMIUM), *FLAGS, *flags, *options, f"--window-size={DESK_PX + 100},12100", "--dump-dom"]
    done = subprocess.run(
        [*command, (folder / "outer.html").as_uri()], capture_output=True, text=True, timeout=240, check=True
    )
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    told = re.search(r'<pre id="told">(.+?)</pre>', done.stdout, re.DOTALL)
    assert told is not None, "the probe did not come to its end"
    found: dict[str, Any] = json.loads(html_text.unescape(told[1]))
    assert "error" not in found
    return found


@pytest.mark.parametrize(("width", "flags"), [(PHONE_PX, ()), (DESK_PX, (DARK,))], ids=["phone", "dark"])
def test_the_page_can_be_used(tmp_path: Path, width: int, flags: tuple[str, ...]) -> None:
    found = used(tmp_path, width, *flags)
    assert found["drawn"] == found["plots"] > 10

    assert found["width"] == width
    if width == PHONE_PX:
        assert found["touching"] == []  # no legend lies under the buttons
    assert found["overflow"] == 0  # nothing to scroll sideways

    brightness = sum(map(int, re.findall(r"\d+", found["paper"])[:3])) / 3
    assert (brightness < 100) == bool(flags)
    assert found["ink"] == ("#e4e8ee" if flags else "#1d2430")

    assert len({tuple(span) for span in found["before"]}) == 1  # all plots over time begin with the same seconds
    (low, high), (first, last) = found["after"][0], found["before"][0]
    assert first + 0.2 * (last - first) < low < high < first + 0.55 * (last - first)
    assert all(span == found["after"][0] for span in found["after"])  # a zoom in one shows in all

    assert found["hidden"] >= 1  # a click on the legend
    assert sorted(found["supervised"]) == ["tof0", "uwb0"]
    assert found["colours"] >= 3  # ok, suspect and reacquired, as a person sees them
    assert "reference" in found["tip"]
    assert found["tipInside"]
    assert found["untold"] == 0  # cards and heads of columns explain themselves
