"""Write weights of the family `learned` from any training: python3 examples/write_weights.py mine.safetensors

No package is needed. The layout is documented in docs/adding/learned.md; use the file as --features learned[file=mine.safetensors].
"""

import hashlib
import json
import struct
import sys


def write(path, metadata, tensors):
    """Write texts and tensors {name: (shape, values row by row)}."""
    metadata = dict(metadata, format="cfpose-weights/1")
    digest = hashlib.sha256()
    for key in sorted(metadata):
        digest.update(f"{key}={metadata[key]}\n".encode())
    header, data = {}, b""
    for name in sorted(tensors):
        shape, values = tensors[name]
        raw = struct.pack(f"<{len(values)}d", *values)
        digest.update(f"{name} F64 {'x'.join(map(str, shape))}\n".encode() + raw)
        header[name] = {"dtype": "F64", "shape": shape, "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    header["__metadata__"] = dict(metadata, digest=digest.hexdigest())
    text = json.dumps(header, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + data)


if __name__ == "__main__":
    # Four waves in the plane, a cos(w.x) and a sin(w.x); here w and a are made up where a training would put its own.
    frequencies = [[1.0, 0.0], [0.0, 1.0], [1.5, 1.5], [1.5, -1.5]]
    write(
        sys.argv[1],
        {"kind": "frequencies", "dim": "2", "seed": "none", "data": "none"},
        {
            "frequencies": ([4, 2], [value for row in frequencies for value in row]),
            "amplitudes": ([4], [1.0, 1.0, 0.5, 0.5]),
        },
    )
