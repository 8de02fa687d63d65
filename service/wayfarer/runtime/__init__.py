"""Agents in real time: slots, scheduler, playback, loop. Never torch."""
