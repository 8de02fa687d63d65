"""Tree search over primitives, offline (paper Sec. 3.3.2)."""
