"""Simulation: rendered camera frames of tunnel walls, and the corridor flights around them."""
