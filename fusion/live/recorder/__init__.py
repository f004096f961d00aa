"""Records every input and output to MCAP: ROS 2 messages with their definitions inside, readable up to any cut."""
