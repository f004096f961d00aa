"""Flights from disk, replay, metrics, report and the command line."""
