"""MATLAB .mat files (up to v7.2): variables and the fields of structs as columns, written as MATLAB does."""

from __future__ import annotations

from pathlib import Path

from scipy.io import loadmat

from flexviz.errors import InputError
from flexviz.importing.formats.arrays import as_in_matlab
from flexviz.importing.formats.base import Log, LogFormat, ReadOptions
from flexviz.measurements import readable

HDF5 = b"\x89HDF\r\n\x1a\n"


def read_mat(path: Path, options: ReadOptions) -> Log:
    """All columns of numbers of a .mat file."""
    with path.open("rb") as stream:
        head = stream.read(1024)
    if HDF5 in head or head.startswith(b"MATLAB 7.3"):
        raise InputError(
            "a .mat file of version 7.3 is HDF5, expected an older one; in MATLAB load it and save it again: "
            "s = load('FILE.mat'); save('FILE7.mat', '-struct', 's', '-v7'), or write the signals as a table "
            "with parquetwrite or writetable",
            file=path,
        )
    with readable(path, ".mat file"):
        content = loadmat(path, simplify_cells=True)
    flattening = as_in_matlab()
    if "None" in content:
        flattening.unusable["(objects)"] = "timetable, table and timeseries cannot be read outside MATLAB"
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    return flattening.log(path, "MATLAB", variables)


MATLAB = LogFormat(".mat", read_mat, suffixes=(".mat",))
