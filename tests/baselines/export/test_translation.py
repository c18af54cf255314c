"""The step in MATLAB as text: every effect of the catalogue can be written, and what is written is MATLAB as well as Octave."""

import re
import xml.etree.ElementTree as ET

import pytest

from baselines.controllers import design
from baselines.export import export_linear, export_matlab, export_mujoco, function_name
from baselines.export.translation import Translator, UntranslatableError, first_sample, one_sample
from flexdrive_gym import DEFAULT_DRIVE, Drive
from flexdrive_gym.drive.drive import Provenance
from flexdrive_gym.drive.effects import EFFECTS
from flexdrive_gym.drive.step import step
from flexdrive_gym.units import Units
from tests.each import each

EVERYWHERE = [(e.id, where) for e in EFFECTS if not e.base for where in e.where]
# from the libraries of both
LIBRARY = {
    "abs", "conv", "cos", "end", "exist", "exp", "expm1", "fix", "floor", "function", "if", "isempty", "max", "min", "mod",
    "numel", "sin", "sqrt", "ss", "struct", "tf", "zeros",
}  # fmt: skip


def translated(*which):
    return Translator(which).translate(first_sample, one_sample, step=step)


@each(
    "which",
    [*[(w,) for w in EVERYWHERE], tuple(EVERYWHERE), ()],
    ids=lambda w: ".".join(*w) if len(w) == 1 else str(len(w)),
)
def test_every_effect_is_translated(which):
    text = translated(*which).functions
    code = re.sub(r"%.*", "", text)
    defined = set(re.findall(r"^function .*?(\w+)\(", code, re.MULTILINE))
    called = set(re.findall(r"(?<![\w.])([A-Za-z]\w*)\(", code))
    assert called - defined <= LIBRARY | {"z", "memory"}
    # an early return apart, whatever opens is closed
    openings = len(re.findall(r"^\s*(?:function|if|for)\b", code, re.MULTILINE))
    assert openings == len(re.findall(r"^\s*end$", code, re.MULTILINE))
    # only the arrays are indexed, from 1 on
    assert not re.search(r"\b(?:z|memory)\(0\)", code)


def test_an_effect_is_in_the_text_only_where_it_is_in_the_drive():
    assert "stribeck" not in translated().functions
    text = translated(("stribeck", "cart_1")).functions
    assert "p.stribeck_cart_1_vs" in text
    assert "stribeck_cart_2" not in text


def test_the_file_keeps_to_what_matlab_takes():
    text = export_matlab(DEFAULT_DRIVE.replace({"presliding.cart_1.fd": 0.1}), "rig").text
    code = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("%"))
    # Octave would take all of these
    for octave_only in (r"!=", r"\+=", r"-=", r"endfunction", r"endif", r'"', r"^\s*#", r"\*\*", r"(?<![=~<>])!"):
        assert not re.search(octave_only, code, re.MULTILINE), octave_only
    assert code.startswith("function drive = rig()")


def test_parameters_are_in_the_rigs_units():
    drive = Drive({**DEFAULT_DRIVE.values}, units=Units("rad", "N m", 100.0, 5.0))
    text = export_matlab(drive, "rig").text
    assert re.search(r"p\.k = 1\.92\d*;\s+% N m/rad: stiffness", text)  # 0.0961 V/mm · 100 mm/rad / (5 V/(N m))
    assert " V/mm" not in text
    assert "[rad/s]" in text


def test_what_cannot_be_translated_is_named():
    def strange(v, p):
        while v > 0.0:
            v -= 1.0
        return v

    with pytest.raises(UntranslatableError, match=r"While in .*strange, line"):
        Translator(()).translate(strange)


@each(("name", "better"), [("2-5 rig.m", "rig_2_5_rig.m"), ("end.m", "rig_end.m"), ("µ.m", "rig_.m")])
def test_a_file_whose_name_is_no_function_is_refused(tmp_path, name, better):
    with pytest.raises(ValueError, match=f"-o .*{re.escape(better)}"):
        function_name(tmp_path / name)
    assert function_name(tmp_path / "rig_3.m") == "rig_3"


def test_texts_of_a_user_stay_in_comments():
    strange = DEFAULT_DRIVE.replace(name="rig */ -- >\nsystem('x')", provenance=Provenance("ml", note="a\nb -- c --"))
    text = export_matlab(strange, "rig").text
    assert not [line for line in text.splitlines() if "system('x')" in line and not line.startswith("%")]
    assert ET.fromstring(export_mujoco(strange, "rig").text).tag == "mujoco"
    law = design("p_x2", strange).controller
    code = export_linear(law, "p", "c", about=["for rig */ int x; /* --"]).text
    assert "*/ int x" not in code
