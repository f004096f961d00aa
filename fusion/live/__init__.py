"""What runs on board: MAVLink in and out, serial sensors, camera, recorder, and the node that joins them."""
