"""The API reference holds what the packages offer."""

import re
import warnings

import fairing
import fairing.io
from tests.api_reference import MODULES, write_reference


def test_the_reference_is_written_without_warnings_and_names_everything_public(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_reference(tmp_path)
    for name in MODULES:
        assert (tmp_path / f"{name.replace('.', '/')}.html").exists()
    for package in (fairing, fairing.io):
        page = (tmp_path / f"{package.__name__.replace('.', '/')}.html").read_text()
        for member in package.__all__:
            assert f'id="{member}"' in page, f"{package.__name__}.{member}"
    assert not re.findall(r'(?:src|href)="https?://(?!pdoc\.dev)[^"]*"', page)
