"""Writes a model on a chequered floor as a .glb whose material is a mirror or glass: the documentation's pictures.

python make_glb.py MODEL.off mirror|glass OUT.glb
"""

import json
import struct
import sys
import zlib

import numpy as np


def read_off(path):
    with open(path) as file:
        words = file.read().split()
    assert words[0] == "OFF", path
    vertices, faces = int(words[1]), int(words[2])
    positions = np.array(words[4 : 4 + 3 * vertices], dtype=np.float32).reshape(-1, 3)
    rest = np.array(words[4 + 3 * vertices : 4 + 3 * vertices + 4 * faces], dtype=np.uint32).reshape(-1, 4)
    assert (rest[:, 0] == 3).all(), "triangles only"
    return positions, rest[:, 1:]


def vertex_normals(positions, triangles):
    corners = positions[triangles]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # weighted by area
    normals = np.zeros_like(positions)
    for k in range(3):
        np.add.at(normals, triangles[:, k], face)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)


def chequers_png(dark, light):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + bytes(a + b) for a, b in ((dark, light), (light, dark)))
    header = struct.pack(">IIBBBBB", 2, 2, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Glb:
    def __init__(self):
        self.blob = b""
        self.views, self.accessors = [], []

    def view(self, data):
        self.blob += b"\0" * (-len(self.blob) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)})
        self.blob += data
        return len(self.views) - 1

    def accessor(self, array, kind):
        array = np.ascontiguousarray(array)
        entry = {
            "bufferView": self.view(array.tobytes()),
            "componentType": 5125 if array.dtype == np.uint32 else 5126,
            "count": array.size if kind == "SCALAR" else len(array),
            "type": kind,
        }
        if kind == "VEC3":
            entry |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        self.accessors.append(entry)
        return len(self.accessors) - 1

    def write(self, path, scene):
        self.blob += b"\0" * (-len(self.blob) % 4)
        scene |= {
            "buffers": [{"byteLength": len(self.blob)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        text = json.dumps(scene).encode()
        text += b" " * (-len(text) % 4)
        with open(path, "wb") as out:
            out.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(self.blob)))
            out.write(struct.pack("<I4s", len(text), b"JSON") + text)
            out.write(struct.pack("<I4s", len(self.blob), b"BIN\0") + self.blob)


def main(model, look, out):
    positions, triangles = read_off(model)
    lo, hi = positions.min(0), positions.max(0)
    positions = (positions - [(lo[0] + hi[0]) / 2, lo[1], (lo[2] + hi[2]) / 2]) * (2 / (hi - lo).max())
    positions = positions.astype(np.float32)
    glb = Glb()
    body = {
        "attributes": {
            "POSITION": glb.accessor(positions, "VEC3"),
            "NORMAL": glb.accessor(vertex_normals(positions, triangles).astype(np.float32), "VEC3"),
        },
        "indices": glb.accessor(triangles.reshape(-1).astype(np.uint32), "SCALAR"),
        "material": 0,
    }
    size = 8
    square = np.array([[-size, 0, size], [size, 0, size], [size, 0, -size], [-size, 0, -size]], dtype=np.float32)
    floor = {
        "attributes": {
            "POSITION": glb.accessor(square, "VEC3"),
            "TEXCOORD_0": glb.accessor(np.array([[0, 0], [8, 0], [8, 8], [0, 8]], dtype=np.float32), "VEC2"),
        },
        "indices": glb.accessor(np.array([0, 1, 2, 0, 2, 3], dtype=np.uint32), "SCALAR"),
        "material": 1,
    }
    picture = glb.view(chequers_png((60, 70, 80), (225, 220, 210)))
    materials = {
        "mirror": {
            "pbrMetallicRoughness": {"baseColorFactor": [0.95, 0.9, 0.8, 1], "metallicFactor": 1, "roughnessFactor": 0}
        },
        "glass": {
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.85, 0.97, 0.9, 1],
                "metallicFactor": 0,
                "roughnessFactor": 0,
            },
            "extensions": {
                "KHR_materials_transmission": {"transmissionFactor": 1},
                "KHR_materials_ior": {"ior": 1.5},
            },
        },
    }
    used = ["KHR_lights_punctual"] + (list(materials[look].get("extensions", {})))
    glb.write(
        out,
        {
            "asset": {"version": "2.0", "generator": "raybench make_glb.py"},
            "extensionsUsed": used,
            "scene": 0,
            "scenes": [{"nodes": [0, 1, 2, 3, 4]}],
            "nodes": [
                {"mesh": 0},
                {"mesh": 1},
                {"translation": [3, 5, 4], "extensions": {"KHR_lights_punctual": {"light": 0}}},
                {"translation": [-4, 6, 2], "extensions": {"KHR_lights_punctual": {"light": 1}}},
                {"translation": [0, 1.7, 4], "rotation": [-0.1, 0, 0, 0.995], "camera": 0},
            ],
            "cameras": [{"type": "perspective", "perspective": {"yfov": 0.66, "znear": 0.1}}],
            "extensions": {
                "KHR_lights_punctual": {
                    "lights": [
                        {"type": "point", "intensity": 38, "color": [1, 0.95, 0.85]},
                        {"type": "point", "intensity": 16, "color": [0.8, 0.9, 1]},
                    ]
                }
            },
            "meshes": [{"primitives": [body]}, {"primitives": [floor]}],
            "materials": [
                {"name": look, **materials[look]},
                {
                    "name": "floor",
                    "pbrMetallicRoughness": {
                        "baseColorTexture": {"index": 0},
                        "metallicFactor": 0,
                        "roughnessFactor": 1,
                    },
                },
            ],
            "textures": [{"source": 0, "sampler": 0}],
            "samplers": [{"magFilter": 9728, "minFilter": 9728}],
            "images": [{"bufferView": picture, "mimeType": "image/png"}],
        },
    )


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[2] not in ("mirror", "glass"):
        sys.exit(__doc__)
    main(*sys.argv[1:])
