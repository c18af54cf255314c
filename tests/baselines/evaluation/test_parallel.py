"""Results are kept under a digest of the code that makes them."""

import sys

import pytest

from baselines.evaluation.parallel import code_digest

PLAIN = """
def doubled(x):
    return 2 * x
"""
EXPLAINED = '''"""What is twice as large."""


def doubled(x):
    """Return it."""
    # a sum would do, too
    return 2 * x
'''


@pytest.fixture
def digest_of(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    package = tmp_path / "digested"
    package.mkdir()

    def of(source, name="__init__.py"):
        (package / name).write_text(source)
        return code_digest(["digested"])

    yield of
    sys.modules.pop("digested", None)


def test_what_a_comment_or_a_docstring_says_ends_no_study(digest_of):
    assert digest_of(PLAIN) == digest_of(EXPLAINED)


def test_other_code_has_another_digest(digest_of):
    assert digest_of(PLAIN) != digest_of(PLAIN.replace("2 * x", "3 * x"))


def test_text_that_code_uses_is_code(digest_of):
    assert digest_of('NAME = "cart_1"\n') != digest_of('NAME = "cart_2"\n')


def test_a_module_more_is_other_code(digest_of):
    assert digest_of(PLAIN) != digest_of(PLAIN, "more.py")


def test_a_function_of_nothing_but_its_docstring_is_the_same_with_another(digest_of):
    assert digest_of('def f():\n    """One."""\n') == digest_of('def f():\n    """Another."""\n')


def test_every_python_finds_the_same(digest_of):
    """Parsers differ in fields that are empty, in the text after a nested format, and in how a text is quoted."""
    source = "def f(x: float, form: str = \"g\") -> str:\n    return f\"{x:{form}} 'of' {dict(a=1)['a']!r}\"\n"
    assert digest_of(source) == "1d0f16bd4a24"


def test_how_lines_are_broken_is_no_code(digest_of):
    assert digest_of(PLAIN) == digest_of(PLAIN.replace("(x)", "(\n    x,\n)").replace("2 * x", "(2\n            * x)"))
