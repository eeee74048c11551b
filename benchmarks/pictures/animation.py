"""An animated WebP of screenshots: Chromium scales and encodes each of them, `webp` joins them."""

from __future__ import annotations

import base64
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

QUALITIES = (0.85, 0.75, 0.65, 0.5, 0.35)  # of lossy WebP, tried in this order until the file is small enough
DO_NOT_BLEND = 0b10
ANIMATED = 0b10

# scales a picture and encodes what differs from the picture before, null where nothing does
ENCODE = """async ([picture, width, height, quality, first]) => {
    const image = new Image();
    image.src = 'data:image/png;base64,' + picture;
    await image.decode();
    const canvas = new OffscreenCanvas(width, height);
    const all = canvas.getContext('2d', {alpha: false});
    all.imageSmoothingQuality = 'high';
    all.drawImage(image, 0, 0, width, height);
    const now = new Uint32Array(all.getImageData(0, 0, width, height).data.buffer);
    const before = first ? null : window.fvBefore;
    window.fvBefore = now;
    let left = width, right = -1, top = height, bottom = -1;
    for (let y = 0, i = 0; y < height; y++) for (let x = 0; x < width; x++, i++)
        if (!before || before[i] !== now[i]) {
            left = Math.min(left, x); right = Math.max(right, x);
            top = Math.min(top, y); bottom = Math.max(bottom, y);
        }
    if (right < 0) return null;
    left -= left % 2; top -= top % 2;  // a frame's place is stored in steps of 2 pixels
    const part = new OffscreenCanvas(right - left + 1, bottom - top + 1);
    part.getContext('2d', {alpha: false}).drawImage(canvas, -left, -top);
    const blob = await part.convertToBlob({type: 'image/webp', quality});
    let bytes = '';
    for (const byte of new Uint8Array(await blob.arrayBuffer())) bytes += String.fromCharCode(byte);
    return [left, top, part.width, part.height, btoa(bytes)];
}"""


@dataclass(frozen=True)
class Frame:
    """A part of the animation's picture that changes, and how long it then stands."""

    left: int  # [pixels], even
    top: int  # [pixels], even
    width: int  # [pixels]
    height: int  # [pixels]
    duration: int  # [ms]
    picture: bytes  # a WebP file


@dataclass(frozen=True)
class Shot:
    """A picture of the whole page, and how long it stands."""

    picture: bytes  # a PNG file
    duration: int  # [ms]


def animation(page: Any, shots: Sequence[Shot], size: tuple[int, int], most: int) -> bytes:
    """The animation of pictures, scaled to `size`, of `most` bytes if it can be."""
    file = b""
    for quality in QUALITIES:
        file = webp(size, frames(page, shots, size, quality))
        if len(file) <= most:
            break
    return file


def frames(page: Any, shots: Sequence[Shot], size: tuple[int, int], quality: float) -> list[Frame]:
    """One frame per picture that differs from the one before it."""
    made: list[Frame] = []
    for shot in shots:
        encoded = page.evaluate(ENCODE, [base64.b64encode(shot.picture).decode(), *size, quality, not made])
        if encoded is None:
            made[-1] = replace(made[-1], duration=made[-1].duration + shot.duration)
        else:
            left, top, width, height, content = encoded
            made.append(Frame(left, top, width, height, shot.duration, base64.b64decode(content)))
    return made


def webp(size: tuple[int, int], frames: Iterable[Frame]) -> bytes:
    """An endlessly repeated animation (https://developers.google.com/speed/webp/docs/riff_container)."""
    width, height = size
    chunks = chunk(b"VP8X", bytes([ANIMATED, 0, 0, 0]) + int24(width - 1) + int24(height - 1))
    chunks += chunk(b"ANIM", bytes([255, 255, 255, 255]) + struct.pack("<H", 0))
    for frame in frames:
        place = int24(frame.left // 2) + int24(frame.top // 2)
        extent = int24(frame.width - 1) + int24(frame.height - 1)
        head = place + extent + int24(frame.duration) + bytes([DO_NOT_BLEND])
        chunks += chunk(b"ANMF", head + bitstream(frame.picture))
    return b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WEBP" + chunks


def bitstream(file: bytes) -> bytes:
    """The chunks of a WebP file that hold its picture."""
    kept, place = b"", 12
    while place < len(file):
        name, (length,) = file[place : place + 4], struct.unpack_from("<I", file, place + 4)
        end = place + 8 + length + length % 2
        if name in (b"VP8 ", b"VP8L", b"ALPH"):
            kept += file[place:end]
        place = end
    return kept


def chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)


def int24(value: int) -> bytes:
    return struct.pack("<I", value)[:3]
