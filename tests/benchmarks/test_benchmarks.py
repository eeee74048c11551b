"""The benchmark commands run; their times are not judged here."""

import re

import pytest

from benchmarks import import_faults, real, speed
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import read_set
from tests.planar_arm import HELD_OUT, planar_set


def test_speed_prints_ratios(capsys):
    planar = read_set(sessions_dir() / "planar-2r-demo")
    speed.against_pinocchio(planar, "2-DOF")
    speed.observer()
    printed = capsys.readouterr().out
    assert re.search(r"2-DOF: solver \d+ ms .* ratio \d+\.\d+", printed)
    assert "ESO, 20 s × 1 kHz × 7 joints" in printed


@pytest.mark.slow
def test_import_faults_prints_counts(capsys):
    import_faults.main([str(sessions_dir() / "planar-2r-demo")])
    printed = capsys.readouterr().out
    assert "good columns: 0 of 1 raised an issue" in printed
    assert "good samples: 0 of 7 raised an issue" in printed
    kinds, _, doubt, silent, wrong = map(
        int, re.findall(r"\| (\d+) kinds \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|", printed)[0]
    )
    assert kinds >= 40 and wrong == 0 and silent == 0 and doubt <= 2  # gravity along the axes of a planar arm


@pytest.mark.slow
def test_real_skips_what_is_absent_and_prints_a_line_per_set(tmp_path, capfd):
    planar_set(tmp_path / "arm", ["coulomb_friction:joint1"], seed=1, groups=HELD_OUT)
    real.main([str(tmp_path / "absent"), str(tmp_path)])
    printed = capfd.readouterr().out
    assert f"{tmp_path / 'absent'}: skipped" in printed
    before, after = map(float, re.findall(r"\| arm \| 2 \| ([\d.]+) → ([\d.]+) \|", printed)[0])
    assert after < 0.2 * before
