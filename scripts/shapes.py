#!/usr/bin/env python3
"""Draws the shapes for topiary in docs/shapes: white on transparent, 240 px. Python's standard library suffices.

    scripts/shapes.py [FOLDER]
"""

import math
import struct
import sys
import zlib
from pathlib import Path

SIDE = 240


def pentagon(x: float, y: float) -> bool:
    corners = [(math.sin(k * math.tau / 5), math.cos(k * math.tau / 5)) for k in range(5)]
    return all((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) <= 0 for a, b in zip(corners, corners[1:] + corners[:1]))


def heart(x: float, y: float) -> bool:
    x, y = 1.15 * x, 1.15 * y + 0.1
    return (x * x + y * y - 1) ** 3 <= x * x * y * y * y


def vase(x: float, y: float) -> bool:
    return abs(y) <= 0.95 and abs(x) <= 0.48 + 0.3 * math.sin(2.6 * y + 2.2) + 0.12 * y


# x from left to right, y upwards, -1 to 1.
SHAPES = {
    "triangle": lambda x, y: -0.9 <= y and abs(x) <= 0.95 * (0.95 - y) / 1.85,
    "circle": lambda x, y: math.hypot(x, y) <= 0.95,
    "pentagon": pentagon,
    "heart": heart,
    "vase": vase,
}


def png(inside) -> bytes:
    rows = bytearray()
    for v in range(SIDE):
        rows.append(0)
        for u in range(SIDE):
            x, y = (u + 0.5) / SIDE * 2 - 1, 1 - (v + 0.5) / SIDE * 2
            rows += b"\xff\xff\xff\xff" if inside(x, y) else b"\xff\xff\xff\x00"

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", SIDE, SIDE, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b"")


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent.parent / "docs" / "shapes"
    folder.mkdir(parents=True, exist_ok=True)
    for name, inside in SHAPES.items():
        (folder / f"{name}.png").write_bytes(png(inside))


if __name__ == "__main__":
    main()
