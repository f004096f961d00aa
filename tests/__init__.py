"""Tests mirror the tree; benches print tables."""
