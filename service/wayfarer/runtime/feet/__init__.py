"""Feet that stay where they stand: contact, foot lock, two-bone inverse kinematics."""
