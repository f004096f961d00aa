"""Noise parameters, delays and lever arms from the likelihood of the innovations."""
