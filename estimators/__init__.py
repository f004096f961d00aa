"""Camera frames to image motion, with sigma and a verdict."""
