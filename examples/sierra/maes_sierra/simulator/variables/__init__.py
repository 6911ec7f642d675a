"""Batch criteria of the engine."""
