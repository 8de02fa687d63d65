"""Manoeuvres, compared with people: orders, figures, and the bars that figures have to meet."""
