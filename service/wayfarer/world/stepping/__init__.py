"""The timing of agents' steps: scheduler, batches, playback, load."""
