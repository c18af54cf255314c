"""The page about rigs: its example runs."""

from tests.docs.pages import printed


def test_the_example_moves_the_cart():
    # 10 mm, less what friction holds: Kp·e of at most d1 + d2 = 0.61 V
    position = float(printed("docs/rig.md").removesuffix(" mm\n"))
    assert 10.0 - 0.61 / 0.1 < position < 12.0
