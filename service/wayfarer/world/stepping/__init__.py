"""Who is stepped when: scheduler, batches, playback, load."""
