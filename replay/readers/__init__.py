"""Recordings to :class:`axialnav.replay.flight.Flight`; one format or topic a file."""
