"""Figures with a range on both sides: do people move as much, and as differently, as recorded ones?

A bar that says "at most" is met by a statue. Here a figure holds when the median of people lies
between the 10th and the 90th percentile of recorded people who do the same, and people differ by
at least 30 % as much as those.
"""
