"""How numbers are written for readers."""

import pytest

from app.html import number, numbers, whole


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (0, 4, "0"),
        (12345.6, 6, "12\u2009345.6"),
        (-0.00123, 3, "−0.00123"),
        (1.2e-7, 2, "1.2e-07"),
        (-1.2e-7, 2, "−1.2e-07"),
        (float("nan"), 3, "nan"),
    ],
)
def test_a_number_has_thin_spaces_and_so_many_digits(value: float, digits: int, shown: str):
    assert number(value, digits) == shown


def test_a_list_of_numbers_is_told_apart_from_the_spaces_within_one():
    assert numbers([4353.2, 22.14, -50.3], 3) == "4\u2009353 · 22.1 · −50.3"
    assert whole(1234567) == "1\u2009234\u2009567"
