"""The time series of a run: which rows SIERRA gets, and when they were sampled."""

PERIOD_S = 10.0
"""Sim time between two rows of series.csv of `maes batch`, which has one more at the end."""


def row_count(duration_s: float) -> int:
    """Rows of a run that lasts for its whole duration, from 0 s on."""
    return int(duration_s / PERIOD_S) + 1
