"""What was converted, and what was left out, in lines for a terminal."""

from __future__ import annotations

from axialnav.replay.flight import Flight


def summary(flight: Flight) -> str:
    """One line a sensor with its rows and rate, then one line for everything that was left out."""
    lines = [f"flight     {flight.name}"]
    for name, table in flight.tables.items():
        span_s = (int(table.t_ns[-1]) - int(table.t_ns[0])) / 1e9 if len(table) > 1 else 0.0
        rate = f"   {(len(table) - 1) / span_s:.1f} Hz" if span_s > 0.0 else ""
        lines.append(f"{name:<10} {len(table):>9}{rate}")
    for name, reference in (("truth", flight.truth), ("gps", flight.gps)):
        if reference is not None:
            lines.append(f"{name:<10} {len(reference.t_ns):>9}")
    lines += [f"left out   {drop.sensor}: {drop.reason} ({drop.count}; {drop.example})" for drop in flight.drops]
    return "\n".join(lines)
