"""Whole experiments, from patterns to numbers held against what is known."""
