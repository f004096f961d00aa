"""What the sensors read on a simulated flight; each module draws one kind from the truth."""
