"""Parts of the report that hold numbers of their own: pictures, sections, chi-square shares, the verdict, frames."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from scipy import stats

from axialnav.fusion.config import Config, Corridor, Section
from axialnav.fusion.outcome import InnovationLog, Verdict
from axialnav.fusion.supervisor import SOURCE_STATES, SourceState
from axialnav.models.rig import BlurMeter, Camera, Flow
from axialnav.replay.flight import SensorTable
from axialnav.replay.image_velocity import image_velocities
from axialnav.replay.report.corridor import section_marks, section_spans
from axialnav.replay.report.judgement import judge
from axialnav.replay.report.moments import moments
from axialnav.replay.report.nis import chi_square_shares
from axialnav.replay.report.page import render_report
from axialnav.replay.report.png import png
from axialnav.replay.report.sections import frames, strip, supervisor
from axialnav.replay.run import Run
from tests.replay.made_runs import make_run

MAX_BYTES = 8_000_000
DOWN = ((1.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
FOCAL_PX = 100.0
HEIGHT_M = 2.0


def flying_run() -> Run:
    """A made run level above the floor, image x forward along the corridor."""
    run = make_run()
    position = run.track.position_m.copy()
    position[:, 2] = HEIGHT_M
    return replace(run, track=replace(run.track, position_m=position))


def seen_by(run: Run, spec: Flow | BlurMeter, asked_m_s: float, window_s: float) -> Run:
    """The run with one image sensor, every reading of which asks for another ``asked_m_s`` of axial velocity."""
    t_ns = run.track.t_ns[10::25]
    sign = 1.0 if isinstance(spec, BlurMeter) else -1.0  # a length grows with speed; content moves backwards
    innovation = np.full((t_ns.size, 3), np.nan)
    innovation[:, 0] = sign * asked_m_s * FOCAL_PX * window_s / HEIGHT_M
    ones = np.ones(t_ns.size, np.int64)
    log = InnovationLog(
        ("eye0",), t_ns, 0 * ones, np.where(ones.cumsum() % 5 == 0, int(Verdict.GATED), int(Verdict.FUSED)), 0 * ones,
        ones, innovation, np.abs(innovation), innovation[:, 0] ** 2, 10.0 * ones, 1.0 * ones,
    )  # fmt: skip
    config = replace_sensor(run, spec)
    table = SensorTable(t_ns, {"window_s": np.full(t_ns.size, window_s)})
    return replace(run, log=log, config=config, flight=replace(run.flight, tables={"eye0": table}))


def replace_sensor(run: Run, spec: Flow | BlurMeter | Camera) -> Config:
    return msgspec.structs.replace(run.config, sensor={"eye0": spec})


@pytest.mark.parametrize("window_s", [0.01, 0.04])
def test_image_motion_reads_as_the_velocity_it_asks_for(window_s: float) -> None:
    spec = Flow(T_BS=DOWN, rate_hz=10.0, focal_px=(FOCAL_PX, FOCAL_PX), surface="floor")
    run = seen_by(flying_run(), spec, 0.3, window_s)
    (found,) = image_velocities(run)
    fused = np.interp(found.t_ns, run.track.t_ns, run.track.velocity_m_s[:, 0])
    np.testing.assert_allclose(found.velocity_m_s, fused + 0.3, atol=1e-9)
    assert np.mean(found.fused) == pytest.approx(0.8, abs=0.01)


def test_a_length_without_sign_takes_the_direction_of_the_filter() -> None:
    spec = BlurMeter(
        T_BS=DOWN, rate_hz=10.0, focal_px=(FOCAL_PX, FOCAL_PX), surface="floor", law="exposure", exposure_s=0.01
    )
    run = seen_by(flying_run(), spec, 0.3, 0.01)
    (found,) = image_velocities(run)
    fused = np.interp(found.t_ns, run.track.t_ns, run.track.velocity_m_s[:, 0])
    np.testing.assert_allclose(np.abs(found.velocity_m_s), np.abs(fused) + 0.3, atol=1e-9)


def test_a_scale_that_swallowed_an_error_shows_as_a_difference() -> None:
    spec = Flow(T_BS=DOWN, rate_hz=10.0, focal_px=(FOCAL_PX, FOCAL_PX), surface="floor")
    run = flying_run()
    run = replace(run, track=replace(run.track, blur_scale=np.full(run.track.t_ns.size, -0.25)))
    (found,) = image_velocities(seen_by(run, spec, 0.0, 0.01))
    fused = np.interp(found.t_ns, run.track.t_ns, run.track.velocity_m_s[:, 0])
    np.testing.assert_allclose(found.velocity_m_s, 0.75 * fused, atol=1e-9)


def test_a_left_handed_survey_shows_no_image_velocity() -> None:
    spec = Flow(T_BS=DOWN, rate_hz=10.0, focal_px=(FOCAL_PX, FOCAL_PX), surface="floor")
    assert list(image_velocities(replace(seen_by(flying_run(), spec, 0.3, 0.01), handedness="left"))) == []


@pytest.mark.parametrize("shape", [(1, 1), (7, 13), (120, 161)])
def test_a_picture_is_what_a_decoder_reads_back(shape: tuple[int, int]) -> None:
    picture = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    decoded = cv2.imdecode(np.frombuffer(png(picture), np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decoded, picture)


@pytest.mark.parametrize("dof", [1, 2, 3])
def test_shares_of_the_chi_square_law(dof: int) -> None:
    edges = np.linspace(0.0, 15.0, 31)
    expected = np.diff(stats.chi2(dof).cdf(edges))
    expected[-1] = stats.chi2(dof).sf(edges[-2])
    np.testing.assert_allclose(chi_square_shares(edges, dof), expected, atol=1e-12)


def test_sections_are_told_in_the_order_they_were_flown() -> None:
    there = Section(kind="straight", start=(-50.0, 0.0, 0.0), end=(0.0, 0.0, 0.0))
    beyond = Section(kind="stairs", start=(0.0, 0.0, 0.0), end=(50.0, 0.0, 0.0))
    run = make_run(corridor=Corridor(section=(there, beyond)))
    spans = section_spans(run)
    assert {name for name, _, _ in spans} == {"straight_1", "stairs_2"}
    assert spans[0][1] == 0.0
    assert all(a[2] == b[1] and a[0] != b[0] for a, b in pairwise(spans))
    begins = [start for _, start, _ in spans]
    x = np.interp(begins, (run.track.t_ns - run.track.t_ns[0]) * 1e-9, run.track.position_m[:, 0])
    assert [name == "stairs_2" for name, _, _ in spans] == (x > 0.0).tolist()
    assert len(section_marks(run)["shapes"]) == len(spans) - 1
    assert section_marks(make_run()) == {}


def test_a_time_out_is_a_line_under_its_sensor() -> None:
    run = make_run()
    sensors = {**run.metrics["sensors"], "uwb0": {**run.metrics["sensors"]["uwb0"], "timeouts": [[3.0, 4.5]]}}
    (figure,) = strip.build(replace(run, metrics={**run.metrics, "sensors": sensors})).figures
    lines = [shape for shape in figure.layout["shapes"] if shape["line"]["color"] == strip.MAGENTA]
    assert [(line["x0"], line["x1"]) for line in lines] == [(3.0, 4.5)]
    assert round(lines[0]["y0"]) == figure.traces[0]["y"].index("uwb0")


def test_the_verdict_is_that_of_the_default_limits() -> None:
    metrics = make_run().metrics
    good = judge(metrics)
    bad = judge({**metrics, "axial_velocity_m_s": {**metrics["axial_velocity_m_s"], "rmse": 1.0}})
    assert good["verdict"] in {"PASS", "WARN"}
    assert bad["verdict"] == "FAIL"
    assert bad["loud"][0].kind == "FAIL"
    assert sum(count for _, count in bad["counts"]) == len(bad["loud"]) + len(bad["quiet"])
    assert '<div class="banner' in render_report(make_run())


def camera_run(folder: Path) -> Run:
    """Frames of a wall of noise that moves by what the fused velocity says."""
    rng = np.random.default_rng(3)
    wall = cv2.GaussianBlur(rng.integers(0, 256, (64, 4096), dtype=np.uint8), (0, 0), 1.0)
    run = flying_run()
    rows = np.arange(0, run.track.t_ns.size, 8)
    data = folder / "mav0" / "eye0" / "data"
    data.mkdir(parents=True)
    names = [f"{k}.png" for k in range(rows.size)]
    travelled = np.cumsum(run.track.velocity_m_s[rows, 0]) * 0.032 * FOCAL_PX / HEIGHT_M
    for name, shift in zip(names, travelled - travelled.min(), strict=True):
        window = np.float32([[1, 0, -shift], [0, 1, 0]])
        cv2.imwrite(str(data / name), cv2.warpAffine(wall, window, (192, 64)))
    spec = Camera(
        T_BS=DOWN, rate_hz=31.25, resolution=(192, 64), intrinsics=(FOCAL_PX, FOCAL_PX, 96.0, 32.0), surface="floor"
    )
    table = SensorTable(run.track.t_ns[rows], {"filename": np.array(names)})
    flight = replace(run.flight, path=folder, tables={**run.flight.tables, "eye0": table})
    return replace(run, flight=flight, config=replace_sensor(run, spec))


def test_moments_hold_the_frames_of_their_time(tmp_path: Path) -> None:
    run = camera_run(tmp_path)
    found = moments(run, "eye0", run.config.sensor["eye0"])
    assert {moment.title for moment in found} == {"slowest", "median speed", "fastest"}
    assert [m.seconds for m in found] == sorted(m.seconds for m in found)
    fastest = next(m for m in found if m.title == "fastest")
    assert abs(fastest.speed_m_s) == max(abs(m.speed_m_s) for m in found)
    a, b = (frame.astype(np.float32) for frame in fastest.frames[:2])
    (shift, _), _ = cv2.phaseCorrelate(a, b, cv2.createHanningWindow((192, 64), cv2.CV_32F))
    assert abs(shift) == pytest.approx(fastest.displacement_px, abs=0.25)


def test_the_page_shows_frames_and_says_why_not(tmp_path: Path) -> None:
    run = camera_run(tmp_path)
    section = frames.build(run)
    assert section is not None
    assert len(section.figures) == 3
    for picture in (tmp_path / "mav0" / "eye0" / "data").iterdir():
        picture.write_bytes(b"no picture")
    broken = frames.build(run)
    assert broken is not None
    assert "cannot be decoded" in broken.note
    assert frames.build(make_run()) is None


def test_ten_minutes_stay_small() -> None:
    run = make_run(count=150_000)
    wander = np.cumsum(np.random.default_rng(1).normal(0.0, 1e-3, (150_000, 8)), axis=0)
    run = replace(run, track=replace(run.track, uwb_bias_m=wander))
    assert len(render_report(run).encode()) < MAX_BYTES


def test_the_supervisor_strip_says_what_it_made_of_each_source_and_where() -> None:
    straight = Section(kind="straight", start=(-9.0, 0.0, 0.0), end=(0.0, 0.0, 0.0))
    corner = Section(kind="corner", start=(0.0, 0.0, 0.0), end=(9.0, 0.0, 0.0))
    run = make_run(corridor=Corridor(section=(straight, corner)))
    section = supervisor.build(run)
    assert section is not None
    (trace,), marks = section.figures[0].traces, section.figures[0].layout["shapes"]
    assert trace["y"] == ["tof0", "uwb0"]
    assert set(trace["z"][0]) == {int(SourceState.OK)}
    expected = np.full(400, int(SourceState.OK))
    expected[240:264], expected[264:272] = (
        int(SourceState.SUSPECT),
        int(SourceState.REACQUIRE),
    )  # 5000 samples, 400 cells
    assert np.count_nonzero(np.array(trace["z"][1]) != expected) <= 3  # cells on a border
    told = trace["text"][1][250]
    assert SOURCE_STATES[SourceState.SUSPECT] in told
    assert told.split(",")[0] in {"straight 1", "corner 2"}
    assert len(marks) == len(section_spans(run)) - 1 > 0
    assert "uwb0 8.0%" in section.figures[0].caption


def test_without_a_supervisor_there_is_no_strip() -> None:
    run = make_run()
    blank = replace(run.track, source_states=np.zeros_like(run.track.source_states))
    assert supervisor.build(replace(run, track=blank)) is None
