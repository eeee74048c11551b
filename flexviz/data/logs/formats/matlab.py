"""MATLAB .mat files (up to v7.2): variables and the fields of structs as columns, written as MATLAB does."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Literal

from flexviz.base._scipy import sp
from flexviz.base.errors import InputError
from flexviz.data.logs.formats.arrays import IN_MATLAB, Flattening
from flexviz.data.logs.formats.base import Log, LogFormat, ReadOptions
from flexviz.data.measurements import readable

HEADER, COMPRESSED, BLOCK = 128, 15, 1 << 20  # [bytes] of version 5, type of an element, [bytes] read at once
LARGEST_MAT = 2**30  # [bytes] unpacked; loading takes three times as much memory
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
        check_unpacked(path)
        content = sp.io.loadmat(path, simplify_cells=True)
    flattening = Flattening(*IN_MATLAB)
    if "None" in content:
        flattening.unusable["(objects)"] = "timetable, table and timeseries cannot be read outside MATLAB"
    variables = {name: value for name, value in content.items() if not name.startswith("__")}
    return flattening.log(path, "MATLAB", variables)


def check_unpacked(path: Path) -> None:
    """InputError for a file whose compressed variables are too large: they are unpacked and counted."""
    total = 0
    with path.open("rb") as stream:
        head = stream.read(HEADER)
        order: Literal["little", "big"] = "big" if head.endswith(b"MI") else "little"
        if len(head) < HEADER or head[-2:] not in (b"IM", b"MI"):  # version 4: nothing is compressed
            return
        while len(tag := stream.read(8)) == 8:
            kind, size = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind != COMPRESSED:
                stream.seek(size, 1)
                continue
            unpacking, end = zlib.decompressobj(), stream.tell() + size
            while stream.tell() < end and (block := stream.read(min(BLOCK, end - stream.tell()))):
                while block:
                    total += len(unpacking.decompress(block, BLOCK))
                    block = unpacking.unconsumed_tail
                    if total > LARGEST_MAT:
                        raise InputError(f"over {LARGEST_MAT:,} bytes unpacked, expected less", file=path)


MATLAB = LogFormat(".mat", read_mat, suffixes=(".mat",))
