#!/usr/bin/env python3
"""Writes the first inputs of a target of libFuzzer into a folder: seeds.py TARGET FOLDER."""

import base64
import json
import random
import struct
import sys
from pathlib import Path

POINTS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
FLAT = [x for point in POINTS for x in point]


def obj():
    yield "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS) + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)
    yield (
        "mtllib none.mtl\no thing\ng a b\ns 1\nv 0 0 0 1\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0 0\nvt 1 1\n"
        "vn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/3/1 4//1\nf -4 -3 -2\nl 1 2\np 1\ncstype bezier\ncurv 0 1 1 2\nend\n"
    )
    yield "v 0 0 0\nv 1e-40 0 \\\n0\nv 0 1 0\r\nf 1 2 3 # comment\n"


def off():
    body = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    yield f"OFF\n4 4 0\n{body}"
    yield "COFF\n# colours\n3 1 3\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 255\n3 0 1 2 0.5 0.5 0.5\n"
    yield "STNOFF\n4 1 0\n" + "0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n" + "4 0 1 2 3\n"
    yield f"4OFF\n3 1 0\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n{body}"


def ply():
    head = "ply\nformat {} 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{}"
    faces = "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    text = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS) + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)
    yield head.format("ascii", faces) + text
    for name, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        data = struct.pack(f"{order}12f", *FLAT) + b"".join(struct.pack(f"{order}B3i", 3, *face) for face in FACES)
        yield head.format(name, faces).encode() + data
    yield head.format("ascii", "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n"
                      "property uchar red\nelement face 1\nproperty list uchar uint vertex_index\nproperty int flags\n"
                      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n") + (
        "0 0 0 0 0 1 0 0 9\n1 0 0 0 0 1 1 0 9\n1 1 0 0 0 1 1 1 9\n0 1 0 0 0 1 0 1 9\n4 0 1 2 3 7\n5 0 1 2 -1 3\n")


def stl():
    facets = [[POINTS[v] for v in face] for face in FACES]
    yield "solid s\n" + "".join(
        "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in facet) + "endloop\nendfacet\n"
        for facet in facets) + "endsolid s\n"
    yield b"binary".ljust(80, b" ") + struct.pack("<I", 4) + b"".join(
        struct.pack("<12fH", 0, 0, 1, *[x for point in facet for x in point], 0) for facet in facets)


def nff():
    yield ("v\nfrom 2 1 2\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.1\nresolution 8 8\nb 0.1 0.5 0.7\nl 4 3 2\nl 1 -4 4 1 0 0\n"
           "f 1 0.75 0.33 0.8 0.2 10 0.5 1.5\ns 0 0 0 0.5\nc\n0 0 0 0.5\n1 0 0 0.25\np 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
           "pp 3\n0 0 1 0 0 1\n1 0 1 0 0 1\n0 1 1 0 0 1\n# end\n")


def gltf_root(uri):
    root = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 2, -1]},
                  {"camera": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
                  {"extensions": {"KHR_lights_punctual": {"light": 0}}, "children": [3]}, {"mesh": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0},
                                   {"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "mode": 5}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 0.5], "metallicFactor": 0.5,
                                                "roughnessFactor": 0.1}, "alphaMode": "MASK", "alphaCutoff": 0.4,
                       "emissiveFactor": [1, 0, 0], "doubleSided": True,
                       "extensions": {"KHR_materials_ior": {"ior": 1.4}, "KHR_materials_transmission": {"transmissionFactor": 1}}}],
        "buffers": [{"byteLength": 104}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24},
                        {"buffer": 0, "byteOffset": 72, "byteLength": 32}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
                      {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
                      {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2",
                       "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 2}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 10, "spot": {"outerConeAngle": 0.5}}]}},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_ior", "KHR_materials_transmission"],
    }
    if uri:
        root["buffers"][0]["uri"] = uri
    return root


GLTF_BUFFER = struct.pack("<12f", *FLAT) + struct.pack("<12H", *[v for face in FACES for v in face]) + bytes(32)


def gltf():
    yield json.dumps(gltf_root("data:application/octet-stream;base64," + base64.b64encode(GLTF_BUFFER).decode()))


def glb():
    text = json.dumps(gltf_root("")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(GLTF_BUFFER), b"BIN\0") + GLTF_BUFFER
    yield struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def mtl():
    yield ("newmtl a\nKa 0.1 0.1 0.1\nKd 0.5 0.5 0.5\nKs 1 1 1\nKe 0 0 1\nNs 50\nd 0.5\nTr 0.5\nNi 1.5\nillum 7\nTf 1 1 1\n"
           "map_Kd -s 1 1 1 none.png\nnewmtl b\nPr 0.1\nPm 0.9\nKd spectral file.rfl\nKd xyz 0.1 0.2 0.3\n")


def rays():
    head = b"\x89RAYS\r\n\x1a" + struct.pack("<IIQIIQQ", 1, 256, 2, 0, 0, 0, 0) + b"camera".ljust(32, b"\0")
    head += b"traced".ljust(16, b"\0") + b"a program".ljust(48, b"\0") + b"icosphere(level=1)".ljust(104, b"\0") + bytes(8)
    body = struct.pack("<8f", 0, 0, -3, 0, 0, 0, 1, float("inf")) + struct.pack("<8f", 0, 0, 0, 0, 0, 0, 0, 1)
    yield b"\1" + head + body
    yield b"\0" + head + body


def parameters():
    yield "bvh_sah(leaf_size=2,numerics=exact),grid(density=3.5)"
    yield "soup(size=200,seed=7),subdivide(levels=1)"
    yield "kdtree_sah(empty_bonus=0.2),embree(robust=true,quality=high),octree"


def case():
    for file in sorted((Path(__file__).resolve().parent.parent / "cases").glob("*.case")):
        yield file.read_bytes()
    yield ("raybench-case 1\nstructure bvh_sah(leaf_size=2)\nmode chaotic\ncheck closest\nseed 7\nvertex 0 0 0\nvertex 1e-45 -0 0.1\n"
           "vertex 0 1 0\nvertex 0 1 1\ntriangle 0 1 2\nsphere 1 2 3 -0.5\ncone 0 0 0 1  0 0 1 0.5\npolygon 0 1 2 3\nray 0 0 -1 0  0 -0 1 inf\n")


def core():
    source = random.Random(1)
    for size in (40, 80, 160, 320):
        for _ in range(24):
            yield source.randbytes(size)


MAKERS = {maker.__name__: maker for maker in (obj, off, ply, stl, nff, gltf, glb, mtl, rays, parameters, case, core)}


def main():
    target, folder = sys.argv[1], Path(sys.argv[2])
    for number, content in enumerate(MAKERS[target]()):
        data = content.encode() if isinstance(content, str) else content
        (folder / f"seed_{number}").write_bytes(data)


if __name__ == "__main__":
    main()
