"""The counter counts what array code does: against counts by hand, and it lets nothing leak."""

from fractions import Fraction
from types import ModuleType

import numpy as np
import pytest
import scipy.linalg
from beartype import beartype
from jaxtyping import Float64, jaxtyped
from scipy.linalg import lapack

from benchmarks.flops import FlopCounter
from poise.errors import ConfigurationError

A = np.arange(15.0).reshape(3, 5) + 1.0
B = np.linspace(-1.0, 1.0, 20).reshape(5, 4)
x = np.linspace(0.5, 2.5, 5)
S = A @ A.T + 10.0 * np.eye(3)
L = np.linalg.cholesky(S)


@pytest.fixture
def counter():
    return FlopCounter()


BY_HAND = {
    "product of matrices": (lambda c: c(A) @ B, 3 * 4 * 9),
    "product from the right": (lambda c: B.T @ c(A).T, 4 * 3 * 9),
    "matrix times vector": (lambda c: c(A) @ x, 3 * 9),
    "vector times matrix": (lambda c: c(x) @ B, 4 * 9),
    "vector times vector": (lambda c: c(x) @ x, 9),
    "np.dot": (lambda c: np.dot(A, c(x)), 3 * 9),
    "method dot": (lambda c: c(A).dot(x), 3 * 9),
    "a stack of products": (lambda c: np.stack([c(A), A]) @ B, 2 * 3 * 4 * 9),
    "triple product": (lambda c: c(A) @ B @ B.T, 3 * 4 * 9 + 3 * 5 * 7),
    "sum of arrays": (lambda c: c(A) + 1.0, 15),
    "broadcast sum": (lambda c: c(x) - np.zeros((7, 5)), 35),
    "difference from the right": (lambda c: x - c(x), 5),
    "scaled": (lambda c: 2.0 * c(A), 15),
    "quotient": (lambda c: c(A) / 3.0, 15),
    "square": (lambda c: c(x) ** 2, 5),
    "root": (lambda c: np.sqrt(c(x)), 5),
    "sum of entries": (lambda c: c(A).sum(), 14),
    "sum along an axis": (lambda c: np.sum(c(A), axis=0), 10),
    "reduction": (lambda c: np.add.reduce(c(x)), 4),
    "norm": (lambda c: np.linalg.norm(c(x)), 10),
    "outer product": (lambda c: np.outer(c(x), x), 25),
    "cross product": (lambda c: np.cross(c(x[:3]), x[:3]), 9),
    "inner product": (lambda c: np.vdot(c(A), A), 29),
    "trace": (lambda c: np.trace(c(S)), 2),
    "negation": (lambda c: -c(A), 0),
    "transpose and slice": (lambda c: c(A).T[1:3, ::2].copy().reshape(-1), 0),
    "choice": (lambda c: np.maximum(c(A), 0.0), 0),
    "stacking": (lambda c: np.vstack([c(A), A]), 0),
    "inverse": (lambda c: np.linalg.inv(c(S)), 9),
    "Cholesky factor": (lambda c: np.linalg.cholesky(c(S)), 9),
    "solution": (lambda c: np.linalg.solve(c(S), A), 18 + 2 * 9 * 5),
    "eigenvalues": (lambda c: np.linalg.eigh(c(S)).eigenvalues, 9 * 27),
}


@pytest.mark.parametrize("case", BY_HAND)
def test_counts_are_those_by_hand_and_values_those_of_plain_arrays(counter, case):
    run, wanted = BY_HAND[case]
    result = run(counter.array)
    assert counter.total == wanted
    np.testing.assert_array_equal(result.value, run(np.asarray))


@pytest.fixture
def module():
    """A module as code is written: solvers imported by name, by module and as LAPACK."""
    made = ModuleType("code_under_count")
    made.linalg, made.lapack = scipy.linalg, lapack
    made.solve_triangular, made.cho_factor = scipy.linalg.solve_triangular, scipy.linalg.cho_factor
    made.qz = scipy.linalg.qz
    return made


SOLVERS = {
    "factor": (lambda m, c: m.cho_factor(c(S))[0], 9),
    "solution by a factor": (lambda m, c: m.linalg.cho_solve((c(L), True), A), 2 * 9 * 5),
    "substitution": (lambda m, c: m.solve_triangular(c(L), x[:3], lower=True), 9),
    "LAPACK through linalg": (lambda m, c: m.linalg.lapack.dpotrf(c(S), lower=1)[0], 9),
    "LAPACK factor": (lambda m, c: m.lapack.dpotrf(c(S), lower=1)[0], 9),
    "LAPACK substitution": (lambda m, c: m.lapack.dtrtrs(c(L), A, lower=1)[0], 9 * 5),
    "LAPACK triangle": (lambda m, c: m.lapack.dtrtri(c(L), lower=1)[0], 9),
    "LAPACK two substitutions": (lambda m, c: m.lapack.dpotrs(c(L), A, lower=1)[0], 2 * 9 * 5),
    "LAPACK reflectors": (lambda m, c: m.lapack.dgeqrf(c(B))[0], 2 * 16 * (5 - Fraction(4, 3))),
}  # fmt: skip


@pytest.mark.parametrize("case", SOLVERS)
def test_solvers_of_scipy_count_within_the_modules_that_are_named(counter, module, case):
    run, wanted = SOLVERS[case]
    before = dict(vars(module))
    with counter.solvers_of(module):
        result = run(module, counter.array)
    assert counter.total == wanted
    np.testing.assert_array_equal(result.value, run(module, lambda a: a.copy()))
    assert vars(module) == before


def test_solvers_are_put_back_after_an_error_too(counter, module):
    with pytest.raises(ZeroDivisionError), counter.solvers_of(module):
        raise ZeroDivisionError
    assert module.linalg is scipy.linalg
    assert module.cho_factor is scipy.linalg.cho_factor


def test_plain_arrays_pass_through_uncounted(counter, module):
    with counter.solvers_of(module):
        factor, _ = module.lapack.dpotrf(S, lower=1)
    assert type(factor) is np.ndarray
    assert counter.total == 0


def test_in_place_sums_go_on_counting_where_they_began_plain(counter):
    total = np.zeros(3)
    total += counter.array(A) @ x
    total = total + 1.0
    total[1:] *= 2.0
    assert counter.total == 27 + 3 + 3 + 2
    np.testing.assert_array_equal(total.value, (A @ x + 1.0) * [1.0, 2.0, 2.0])


def test_entries_in_a_row_can_be_read_and_written(counter):
    counted = counter.array(S.copy())
    counted.flat[::4] -= 1.0
    assert counter.total == 3
    np.testing.assert_array_equal(counted.value, S - np.eye(3))


def test_kinds_of_operations_are_told_apart(counter):
    counter.array(A) @ x + 1.0
    assert counter.by_operation == {"matmul": 27, "add": 3}
    counter.add("by hand", 5)
    assert counter.total == 35
    counter.reset()
    assert counter.total == 0


def into_plain_buffer(c):
    buffer = np.zeros(3)
    buffer[:] = c(A) @ x


LEAKS = {
    "a plain array of it": lambda c: np.asarray(c(A)),
    "a plain array filled with it": into_plain_buffer,
    "a product into a plain array": lambda c: np.matmul(c(A), x, out=np.zeros(3)),
    "np.dot into a plain array": lambda c: np.dot(c(A), B, out=np.zeros((3, 4))),
    "a solver that was not exchanged": lambda c: scipy.linalg.solve_triangular(c(L), x[:3]),
}


@pytest.mark.parametrize("case", LEAKS)
def test_nothing_becomes_uncounted_in_silence(counter, case):
    with pytest.raises(ConfigurationError, match="plain"):
        LEAKS[case](counter.array)


UNKNOWN = {
    "a function of NumPy": lambda c: np.linalg.det(c(S)),
    "a universal function": lambda c: np.cbrt(c(x)),
    "a method of one": lambda c: np.add.accumulate(c(x)),
    "norm by name": lambda c: np.linalg.norm(c(S), ord=2),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_an_operation_of_unknown_cost_is_an_error(counter, case):
    with pytest.raises(ConfigurationError, match="no known cost"):
        UNKNOWN[case](counter.array)


def test_a_solver_of_unknown_cost_is_an_error(counter, module):
    with counter.solvers_of(module), pytest.raises(ConfigurationError, match="got 'qz'"):
        module.qz(counter.array(S), S)


def test_an_unknown_method_is_an_attribute_error(counter):
    with pytest.raises(AttributeError, match="cumsum"):
        counter.array(x).cumsum()


def test_code_with_checked_shapes_takes_counted_arrays(counter):
    @jaxtyped(typechecker=beartype)
    def apply(
        J: Float64[np.ndarray, "m n"], v: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " m"]:
        return J @ v

    assert apply(counter.array(A), counter.array(x)).shape == (3,)
    assert counter.total == 27


def paper_original(J, J_p, M_inv, Lambda_p_inv, mu_p, Gamma, h, drift):
    """Eq. (23) as Table 1 charges it: J M^-1 anew in each of three steps, V + G given as one."""
    Lambda_inv = (J @ M_inv) @ J.T
    mu = np.linalg.inv(Lambda_inv) @ ((J @ M_inv) @ h - drift)
    return (J @ M_inv) @ Gamma + Lambda_p_inv @ mu_p - Lambda_inv @ mu


def test_the_papers_formulas_counted_are_table_1(counter):
    """Table 1 without its symmetry of J M^-1 J^T, which NumPy's product does not use."""
    rng = np.random.default_rng(0)
    n, m = 30, 3
    J, J_p, Gamma, h = (rng.normal(size=s) for s in ((m, n), (m, n), n, n))
    M_inv = np.eye(n)
    drift, mu_p, Lambda_p_inv = rng.normal(size=m), rng.normal(size=m), np.eye(m)
    counted = [counter.array(a) for a in (J, J_p, M_inv, Lambda_p_inv, mu_p, Gamma, h, drift)]
    paper_original(*counted)
    rows = (
        Fraction(m**3, 3)
        + 2 * m * n**2 + m**2 * n - Fraction(m**2 + m, 2)
        + 2 * m * n**2 + m * n + 2 * m**2 - m
        + 2 * m * n**2 + m * n - m
        + 4 * m**2
    )  # fmt: skip
    triangle = (2 * n - 1) * m * (m - 1) // 2
    assert counter.total == rows + triangle
