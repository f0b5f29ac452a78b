import pytest

from poise.errors import MissingExtraError
from poise.hqp import ACCURACY
from poise.hqp._backends import make_backend


@pytest.fixture(params=sorted(ACCURACY))
def backend(request):
    """Every QP backend; a missing one is a reported skip."""
    try:
        make_backend(request.param)
    except MissingExtraError as error:
        pytest.skip(str(error))
    return request.param
