"""MMCP, the Motion Model Context Protocol (animatica.ai/mmcp): clips on a user's skeleton."""
