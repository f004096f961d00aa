"""The report page: sections in order, put together by one template."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from axialnav.replay.report.section import Section
from axialnav.replay.report.sections import (
    axial,
    biases,
    frames,
    innovations,
    position,
    provenance,
    settings,
    speed,
    strip,
    supervisor,
    verdict,
    whiteness,
)
from axialnav.replay.run import Run

SECTIONS = (
    verdict,
    axial,
    speed,
    strip,
    supervisor,
    innovations,
    whiteness,
    frames,
    position,
    biases,
    settings,
    provenance,
)
TEMPLATES = Path(__file__).parent / "templates"


def render_report(run: Run) -> str:
    """HTML of the report: one file that loads nothing, with plotly.js inside and a policy that forbids the network."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    sections = [section for module in SECTIONS if (section := module.build(run))]
    figures: list[dict[str, Any]] = []
    span_s = run.metrics["timing"]["flight_s"]
    bodies = [
        environment.get_template(s.template).render(numbered=_numbered(s, figures, span_s), **s.values)
        for s in sections
    ]
    return environment.get_template("page.html.j2").render(
        title=run.flight.name,
        sections=list(zip(sections, bodies, strict=True)),
        # "</" would end the script element, whatever string it stands in
        figures=json.dumps(figures, separators=(",", ":"), allow_nan=False).replace("</", "<\\/"),
        plotly=get_plotlyjs(),
        digest=run.metrics["digest"],
    )


def _numbered(section: Section, figures: list[dict[str, Any]], span_s: float) -> list[tuple[int, Any]]:
    """Give every figure of a section its number on the page and collect its data."""
    result = []
    for figure in section.figures:
        result.append((len(figures), figure))
        figures.append(figure.as_data(span_s))
    return result
