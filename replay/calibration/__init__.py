"""What a flight says of its own sensors: focal length, blur scale, range offset, delays, IMU densities."""
