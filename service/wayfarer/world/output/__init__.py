"""What is changed in the frames that are sent: feet on the floor, legs on the ground."""
