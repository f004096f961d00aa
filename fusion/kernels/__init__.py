"""The compiled heart of the filter: pure functions on preallocated float64 arrays."""
