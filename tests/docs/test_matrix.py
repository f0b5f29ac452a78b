"""The table of platforms and Pythons: what is made of the resolver's answers."""

from docs import update_matrix

CELLS = {
    ("Linux", "3.11"): {},
    ("Linux", "3.12"): {"teleop": "no wheel of pad", "dev": "no wheel of pad"},
    ("macOS", "3.11"): {"": "no wheel of core", "sim": "no wheel of core"},
    ("macOS", "3.12"): {},
}


def test_a_row_is_a_platform_and_a_column_a_python():
    assert update_matrix.table(CELLS).splitlines() == [
        "| | 3.11 | 3.12 |",
        "| --- | --- | --- |",
        "| Linux | all extras | not `teleop`, `dev`: no wheel of pad |",
        "| macOS | none: no wheel of core | all extras |",
    ]


def test_a_reason_names_the_packages_without_wheels():
    message = (
        "error: No solution found\n  cause: Because pad==2.6.1 has no usable wheels and poise\n"
        "  depends on pad==2.6.1, we can conclude that your requirements are unsatisfiable.\n"
    )
    assert update_matrix.reason(message) == "no wheel of pad"
    assert update_matrix.reason("error: No solution\n  cause: x") == "error: No solution cause: x"


def test_the_page_has_a_table_of_the_platforms_and_of_the_classifiers():
    page = update_matrix.PAGE.read_text(encoding="utf-8")
    lines = update_matrix.TABLE.search(page)[0].splitlines()[1:-1]
    assert lines[0] == f"| | {' | '.join(update_matrix.pythons())} |"
    assert [line.split(" | ")[0].strip("| ") for line in lines[2:]] == [*update_matrix.PLATFORMS]
