"""Poise: whole-body control for humanoid robots."""
