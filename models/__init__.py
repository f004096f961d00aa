"""What a sensor reads, given the state: physics only."""
