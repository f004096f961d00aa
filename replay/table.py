"""The printed summary of a run: the same text on a terminal and in a pipe."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from axialnav.replay.findings import nees_verdict
from axialnav.replay.inputs import combined
from axialnav.replay.rates import sensor_rates
from axialnav.replay.settings import changed_settings

if TYPE_CHECKING:
    from axialnav.replay.run import Run

NOT_EVALUATED = "NOT_EVALUATED"
COUNTS = ("available", "fused", "gated", "late", "blind", "suspect", "invalid")
MAX_LISTED = 6
WHY_NOT = {
    "none": "no ground truth in the flight",
    "gps": "GPS is the only reference",
    "truth": "no truth inside the scoring window",
}


def summary(run: Run) -> str:
    """Settings, sensors, verdicts per sensor, scores with their coverage, and the digest; one line a topic."""
    lines = [
        *_settings(run),
        *_flight(run),
        *_inputs(run),
        *_dropped(run),
        _speed(run.metrics),
        *_sensors(run.metrics),
        *_scores(run),
    ]
    return "\n".join([*lines, *_condition(run.metrics), f"digest     {run.metrics['digest'][:16]}"])


def _settings(run: Run) -> Iterator[str]:
    changed = changed_settings(run.config, run.flight.config)
    listed = ", ".join(f"{name} {before} -> {after}" for name, before, after in changed[:MAX_LISTED])
    more = f", and {len(changed) - MAX_LISTED} more (config.toml)" if len(changed) > MAX_LISTED else ""
    if changed:
        yield f"settings   {len(changed)} differ{'s' * (len(changed) == 1)} from defaults: {listed}{more}"
    else:
        yield "settings   defaults"


def _flight(run: Run) -> Iterator[str]:
    rates = sensor_rates(run.flight, int(run.track.t_ns[0]))
    known = [f"{r.name} {_count(r.count)}" + (f" ({r.rate_hz:.1f} Hz)" if r.rate_hz else "") for r in rates]
    yield f"flight     {run.flight.name}   {run.metrics['timing']['flight_s']:.1f} s   {'   '.join(known)}"
    gaps = [f"{r.name} {r.gaps} (max {r.longest_s:.1f} s at {r.longest_at_s:.1f} s)" for r in rates if r.gaps]
    if gaps:
        yield f"gaps       {', '.join(gaps)}"


def _inputs(run: Run) -> Iterator[str]:
    files = run.flight.inputs
    if files:
        size = sum(one.bytes for one in files) / 1e6
        yield f"input      {_counted(len(files), 'file')}, {size:.1f} MB, SHA-256 {combined(files)[:16]}"


def _counted(count: int, noun: str) -> str:
    return f"{_count(count)} {noun}{'s' * (count != 1)}"


def _dropped(run: Run) -> Iterator[str]:
    for drop in run.flight.drops:
        yield f"dropped    {drop.sensor}: {_count(drop.count)} x {drop.reason} ({drop.example})"


def _speed(metrics: dict[str, Any]) -> str:
    timing = metrics["timing"]
    compiled = f" after compiling for {timing['compiled_s']:.0f} s" * (timing["compiled_s"] > 1.0)
    taken = timing["wall_s"] - timing["compiled_s"]
    return (
        f"replay     {timing['flight_s']:.1f} s in {taken:.2f} s ({timing['real_time_factor']:.0f}x){compiled}"
        f"   kernel {timing['kernel_us_per_imu']:.2f} us per IMU sample{'   smoothed' * metrics.get('smoothed', False)}"
    )


def _sensors(metrics: dict[str, Any]) -> Iterator[str]:
    head = ["sensor", *COUNTS, "mean NIS", "lag-1", "time-outs"]
    rows = [[name, *sensor_cells(sensor)] for name, sensor in metrics["sensors"].items()]
    yield from aligned([head, *rows], left=(0, len(head) - 1))
    for name, sensor in metrics["sensors"].items():
        if sensor["unprocessed"]:
            many = _count(sensor["unprocessed"])
            yield f"           {name}: {many} outside the IMU's time span, or pictures before a first full window"
    if not any(sensor["fused"] for sensor in metrics["sensors"].values()):
        yield "warning    no reading was fused: this is dead reckoning from the first state"


def sensor_cells(sensor: dict[str, Any]) -> list[str]:
    """Texts of one row of the sensor table: counts, mean NIS, lag-1, time-outs."""
    counts = [_count(sensor[key]) for key in COUNTS]
    return [*counts, _number(sensor["mean_nis"], ".2f"), _number(sensor["lag1"], "+.2f"), _timeouts(sensor)]


def _timeouts(sensor: dict[str, Any]) -> str:
    if sensor["disabled"]:
        return "switched off"
    spans = [f"{start:.1f}-{end:.1f} s" for start, end in sensor["timeouts"]]
    if not spans:
        return "never"
    return ", ".join(spans[:3]) + (f", {len(spans) - 3} more" if len(spans) > 3 else "")


def _scores(run: Run) -> Iterator[str]:
    metrics = run.metrics
    used, available, kind = (metrics["reference"][key] for key in ("used", "available", "kind"))
    coverage = (
        f"used {_count(used)}/{_count(available)} ({100.0 * used / available:.0f} %)" if available else "used 0/0"
    )
    if kind == "gps":
        speed = _number(metrics["horizontal_speed_rmse_m_s"], ".3f")
        late = _number(metrics["gps_latency_s"], ".2f")
        bias = _number(metrics["horizontal_speed_mean_error_m_s"], "+.3f")
        words = f"RMS {speed} m/s   bias {bias}   GPS late by about {late} s (scored as stamped)"
        yield f"horizontal speed vs GPS   {words}   {coverage}"
    if metrics["position_rmse_m"] is None:
        scored = "" if kind == "gps" else f"   {coverage}"
        yield f"axial velocity vs reference   {NOT_EVALUATED} ({WHY_NOT[kind]}){scored}"
        return
    yield from _truth_scores(metrics, coverage)


def _truth_scores(metrics: dict[str, Any], coverage: str) -> Iterator[str]:
    if metrics["axial_velocity_m_s"]["rmse"] is None:
        yield f"axial velocity vs reference   {NOT_EVALUATED} (the truth carries no velocity)   {coverage}"
    else:
        yield f"axial velocity vs reference   {_axial(metrics['axial_velocity_m_s'])}   {coverage}"
    for name, section in metrics["sections"].items():
        yield f"  in {name}   {NOT_EVALUATED if section['rmse'] is None else _axial(section)}"
    if metrics["velocity_rmse_m_s"] is not None:
        yield f"velocity x y z   RMS {_three(metrics['velocity_rmse_m_s'])} m/s   {_nees(metrics)}"
    aligned_note = "   after rigid alignment (frames unrelated)" if metrics["alignment"] == "rigid" else ""
    position, total = _three(metrics["position_rmse_m"]), metrics["position_rmse_3d_m"]
    yield f"position x y z   RMS {position} m   3-D {total:.3f} m{aligned_note}"


def _axial(score: dict[str, float]) -> str:
    return (
        f"RMS {score['rmse']:.3f} m/s   bias {score['mean_error']:+.3f}   max {score['max_abs_error']:.2f}"
        f"   mean sigma {score['mean_sigma']:.3f}   in 3 sigma {100.0 * score['in_3_sigma']:.1f} %"
    )


def _nees(metrics: dict[str, Any]) -> str:
    if metrics["nees_velocity"] is None:
        return f"NEES {NOT_EVALUATED} (covariance not positive definite)"
    low, high = metrics["nees_velocity_band"]
    return f"NEES {metrics['nees_velocity']:.2f}, {nees_verdict(metrics)} (95 % band {low:.2f}..{high:.2f})"


def _condition(metrics: dict[str, Any]) -> Iterator[str]:
    words = [
        f"{name.replace('_', ' ')} {100.0 * share:.1f} % of the flight" for name, share in metrics["health"].items()
    ]
    if metrics["resets"]:
        words.append(f"{metrics['resets']} position reset{'s' * (metrics['resets'] > 1)}")
    if words:
        yield f"condition  {', '.join(words)}"


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> Iterator[str]:
    """Lines of a text table; columns named in ``left`` are flush left, the others flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (c.ljust(w) if i in left else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True)))
        yield "  ".join(cells).rstrip()


def _count(value: int) -> str:
    return f"{value:,}".replace(",", " ")


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _three(values: Sequence[float]) -> str:
    return " ".join(f"{value:.3f}" for value in values)
