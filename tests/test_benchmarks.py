"""The benchmark commands run; their times are not judged here."""

import re

from benchmarks import import_faults, real, speed
from flexviz.measurements import read_set
from flexviz.resources import sessions_dir
from tests.planar_arm import HELD_OUT, planar_set


def test_speed_prints_ratios(capsys):
    planar = read_set(sessions_dir() / "planar-2r-demo")
    speed.against_pinocchio(planar, "2-DOF")
    speed.against_trust_constr(planar, limit=0.5)
    speed.observer()
    printed = capsys.readouterr().out
    assert re.search(r"2-DOF: solver \d+ ms .* ratio \d+\.\d+", printed)
    assert re.search(r"ratio (≥ )?\d+", printed.split("trust-constr")[1])
    assert "ESO, 20 s × 1 kHz × 7 joints" in printed


def test_import_faults_prints_counts(capsys):
    import_faults.main([str(sessions_dir() / "planar-2r-demo")])
    printed = capsys.readouterr().out
    assert "sets as they are: 0 of 1 raised an issue" in printed
    assert len(re.findall(r": named in 1 of 1", printed)) == 7


def test_real_skips_what_is_absent_and_prints_a_line_per_set(tmp_path, capfd):
    planar_set(tmp_path / "arm", ["coulomb_friction:joint1"], seed=1, groups=HELD_OUT)
    real.main([str(tmp_path / "absent"), str(tmp_path)])
    printed = capfd.readouterr().out
    assert f"{tmp_path / 'absent'}: skipped" in printed
    before, after = map(float, re.findall(r"\| arm \| 2 \| ([\d.]+) → ([\d.]+) \|", printed)[0])
    assert after < 0.2 * before
