"""Scenarios and runs of the project."""
