"""The paper's experiments on image motion, run again on rendered walls."""
