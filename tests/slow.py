"""Parameters with which a test takes longer than five seconds: the others run with all tests."""

import pytest


def slow(*values):
    """Values of a parametrized test, run by `-m slow` alone."""
    return pytest.param(*values, marks=pytest.mark.slow)
