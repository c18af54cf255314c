from tests.each import each
from tests.identification.recordings import fuzz


@each("first", range(0, 200, 50))
def test_damaged_files_are_read_or_refused_in_the_usual_form(tmp_path, first):
    outcomes = [fuzz.run(seed, tmp_path)[1] for seed in range(first, first + 50)]
    assert outcomes.count("refused") >= 10
    assert outcomes.count("refused") < 50


def test_the_files_are_sound_before_they_are_damaged(tmp_path):
    for name, data in fuzz.sound_files().items():
        (tmp_path / name).write_bytes(data)
    for name in fuzz.sound_files():
        rig = tmp_path / "rig.toml" if name in ("e.asc", "f.log") else None
        if name != "rig.toml":
            (run,) = fuzz.read_recordings(tmp_path / name, rig=rig)
            assert run.n == 301
