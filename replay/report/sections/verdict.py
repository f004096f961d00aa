"""First section: the main numbers with their coverage, what stands out, and the table per sensor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from axialnav.replay.findings import findings, nees_verdict
from axialnav.replay.report.judgement import judge
from axialnav.replay.report.section import Section
from axialnav.replay.run import Run
from axialnav.replay.table import COUNTS, NOT_EVALUATED, sensor_cells

Card = tuple[str, str, str, str]
TIPS = {
    "available": "readings in the recording",
    "fused": "used by the filter, some with reduced weight",
    "gated": "refused: too far from the prediction",
    "late": "older than the filter can reach back",
    "blind": "cannot inform now (blur too short, beam misses): not a rejection",
    "suspect": "held back by the supervisor",
    "invalid": "out of the sensor's range or nonsense",
    "mean NIS": "normalised innovation squared per degree of freedom, gated ones at the gate; 1 is honest",
    "lag-1": "correlation of neighbouring innovations; 0 is white",
    "time-outs": "not fused for longer than the time-out",
}
SECTION_HEADS = {
    "RMS": "root mean square of fused minus truth along the axis of this section",
    "bias": "mean of fused minus truth; it adds up to position",
    "max": "largest error without its sign",
    "mean sigma": "what the filter states on average; honest if it is near the RMS",
    "within 3 sigma": "share of errors inside three stated sigmas; 99.7 % is honest",
}


def build(run: Run) -> Section:
    """Numbers without a reference read NOT_EVALUATED and never 0."""
    metrics = run.metrics
    sensors = [(name, sensor_cells(sensor)) for name, sensor in metrics["sensors"].items()]
    values = {
        **judge(metrics),
        "cards": cards(metrics),
        "findings": findings(metrics),
        "heads": [*COUNTS, "mean NIS", "lag-1", "time-outs"],
        "tips": TIPS,
        "sensors": sensors,
        "section_heads": SECTION_HEADS,
        "sections": [(name, _section_cells(score)) for name, score in metrics["sections"].items()],
    }
    return Section("Verdict and coverage", template="verdict.html.j2", values=values)


def _section_cells(score: dict[str, Any]) -> list[str]:
    if score["rmse"] is None:
        return [NOT_EVALUATED, "-", "-", "-", "-"]
    numbers = [f"{score[key]:.3f}" for key in ("rmse", "mean_error", "max_abs_error", "mean_sigma")]
    return [*numbers, f"{100.0 * score['in_3_sigma']:.1f} %"]


def cards(metrics: dict[str, Any]) -> list[Card]:
    """Label, value, remark and explanation of each main number."""
    return [*_coverage(metrics), *_axial(metrics), *_consistency(metrics), *_position(metrics), *_speed(metrics)]


def _coverage(metrics: dict[str, Any]) -> Iterator[Card]:
    used, available, kind = (metrics["reference"][key] for key in ("used", "available", "kind"))
    share = f"{100.0 * used / available:.0f} %" if available else NOT_EVALUATED
    tip = "Estimates that have a reference, of those inside the scoring window. The scores speak for these only."
    yield "scored samples", share, f"{used} of {available}, reference: {kind}", tip


def _axial(metrics: dict[str, Any]) -> Iterator[Card]:
    axial = metrics["axial_velocity_m_s"]
    tip = "Root mean square of fused minus truth along the corridor; bias is the mean, max the largest error."
    if axial["rmse"] is None:
        yield "axial velocity RMS", NOT_EVALUATED, "no ground truth", tip
        return
    remark = f"bias {axial['mean_error']:+.3f}, max {axial['max_abs_error']:.2f}"
    yield "axial velocity RMS", f"{axial['rmse']:.3f} m/s", remark, tip
    remark = f"mean sigma {axial['mean_sigma']:.3f} m/s"
    tip = "Share of axial velocity errors inside three of the sigmas that the filter stated. 99.7 % is honest."
    yield "within 3 sigma", f"{100.0 * axial['in_3_sigma']:.1f} %", remark, tip


def _consistency(metrics: dict[str, Any]) -> Iterator[Card]:
    if metrics["nees_velocity"] is not None:
        low, high = metrics["nees_velocity_band"]
        remark = f"{nees_verdict(metrics)}: 95 % band {low:.2f} to {high:.2f}"
        tip = (
            "Normalised estimation error squared of the three velocity axes. 3 is honest, more means that errors are "
            "larger than stated. The band allows for errors that last."
        )
        yield "velocity NEES", f"{metrics['nees_velocity']:.2f}", remark, tip


def _position(metrics: dict[str, Any]) -> Iterator[Card]:
    if metrics["position_rmse_3d_m"] is not None:
        axes = " ".join(f"{value:.3f}" for value in metrics["position_rmse_m"])
        tip = "Root mean square distance between fused and true position, and the same along each world axis."
        yield "position RMS, 3-D", f"{metrics['position_rmse_3d_m']:.3f} m", f"x y z {axes}", tip


def _speed(metrics: dict[str, Any]) -> Iterator[Card]:
    if metrics["horizontal_speed_rmse_m_s"] is not None:
        late = metrics["gps_latency_s"]
        remark = "against GPS" if late is None else f"against GPS, which is about {late:.2f} s late"
        tip = "Root mean square of the difference in horizontal speed. GPS itself is no better than 0.1 to 0.3 m/s."
        yield "horizontal speed RMS", f"{metrics['horizontal_speed_rmse_m_s']:.3f} m/s", remark, tip
