"""Worlds whose time is not the clock's: lock-step sessions, clips, replays."""
