"""Changes of the frames that are sent: feet on the floor, legs on the ground."""
