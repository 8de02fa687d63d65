"""Between the wire and the world: messages, bases, units, files."""
