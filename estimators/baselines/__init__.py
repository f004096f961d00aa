"""Published blur-length methods, as faithful as their papers allow; for comparison, not for flying."""
