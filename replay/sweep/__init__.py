"""Many recordings times many settings, on this machine or on a cluster."""
