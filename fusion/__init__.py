"""The filter, its gates and supervisor, and the readings that go in."""
