"""Checks of mesh files for contents that the mesh readers would silently ignore."""

from __future__ import annotations

import json
import re
import struct
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from netsp.base.arrays import Floats
from netsp.base.errors import InputError
from netsp.base.files import read_bytes

_HARMLESS = re.compile(
    r"KHR_(materials_\w+|texture_\w+|lights_\w+|mesh_quantization|xmp\w*|animation_pointer)"
    r"|EXT_(texture_\w+|lights_\w+)|MSFT_(texture_dds|packing_\w+)|CESIUM_primitive_outline"
)
"""Extensions of glTF that move no vertex."""

_SURFACES = {4, 5}
"""Codes of glTF for primitives that are read: triangles and strips of triangles."""

_FAN = 6
"""Code of glTF for a fan of triangles."""


def gltf_parts(path: str | Path) -> tuple[int, list[tuple[str, int]]]:
    """Count the parts of a glTF file that are read, and those left out, by reason.

    Returns
    -------
    used : int
        Number of parts of triangles in the scene of the file.
    left_out : list of (str, int)
        Reasons, and numbers of parts.

    Raises
    ------
    InputError
        Vertices depend on an extension, a skeleton or a morph target.
    """
    page = _gltf_page(path)
    required = [str(e) for e in page.get("extensionsRequired", [])]
    if unknown := [e for e in required if not _HARMLESS.fullmatch(e)]:
        raise InputError(
            f"{path}: needs the extension {unknown[0][:60]}; expected a file without it (save it "
            "without compression)"
        )
    scenes = page.get("scenes", [])
    if not scenes:
        raise InputError(f"{path}: expected a scene, got none")
    shown = int(page.get("scene", 0))
    nodes = page.get("nodes", [])
    inside = _nodes_of(scenes[shown], nodes)
    reasons: Counter[str] = Counter()
    used = 0
    for k in inside:
        used += _node_parts(nodes[k], page, reasons, path)
    outside = {n for scene in scenes for n in _nodes_of(scene, nodes)} - set(inside)
    loose = set(range(len(nodes))) - set(inside) - outside
    for reason, group in (("of another scene", outside), ("in no scene", loose)):
        reasons[reason] += sum(len(_mesh_of(nodes[k], page).get("primitives", [])) for k in group)
    return used, [(reason, count) for reason, count in reasons.items() if count]


def _gltf_page(path: str | Path) -> dict[str, Any]:
    data = read_bytes(path)
    if data[:4] == b"glTF":
        if len(data) < 20 or len(data) < struct.unpack_from("<I", data, 8)[0]:
            raise InputError(f"{path}: cut short; its header states more bytes")
        size = struct.unpack_from("<I", data, 12)[0]
        data = data[20 : 20 + size]
    try:
        page = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise InputError(f"{path}: expected a glTF file, got no JSON") from None
    if not isinstance(page, dict):
        raise InputError(f"{path}: expected a glTF file, got no JSON object")
    return page


def _nodes_of(scene: dict[str, Any], nodes: list[dict[str, Any]]) -> list[int]:
    """Return the nodes of a scene and all below them."""
    found: list[int] = []
    waiting = list(scene.get("nodes", []))
    while waiting:
        k = waiting.pop()
        found.append(k)
        if len(found) > len(nodes):
            break  # a cycle, which the reader refuses
        waiting += nodes[k].get("children", [])
    return found


def _mesh_of(node: dict[str, Any], page: dict[str, Any]) -> dict[str, Any]:
    return page["meshes"][node["mesh"]] if "mesh" in node else {}


def _node_parts(
    node: dict[str, Any], page: dict[str, Any], reasons: Counter[str], path: str | Path
) -> int:
    """Return the number of triangle parts of a node, and count the other parts by reason."""
    mesh = _mesh_of(node, page)
    used = 0
    if "EXT_mesh_gpu_instancing" in node.get("extensions", {}):
        raise InputError(
            f"{path}: needs the extension EXT_mesh_gpu_instancing; expected each instance as a node"
        )
    if "skin" in node and mesh:
        raise InputError(f"{path}: a mesh is bent by a skeleton; expected one without a skin")
    if any(node.get("weights", mesh.get("weights", []))):
        raise InputError(f"{path}: a mesh is morphed; expected no weights of morph targets")
    for part in mesh.get("primitives", []):
        mode = part.get("mode", 4)
        if mode == _FAN:
            raise InputError(f"{path}: fans of triangles; expected triangles or strips of them")
        if mode not in _SURFACES:
            reasons["of points or lines, not of faces"] += 1
            continue
        accessor = page["accessors"][part["attributes"]["POSITION"]]
        packed = "KHR_draco_mesh_compression" in part.get("extensions", {})
        if packed and "bufferView" not in accessor:
            raise InputError(
                f"{path}: packed by KHR_draco_mesh_compression; expected a file without it (save "
                "it without compression)"
            )
        if accessor.get("normalized"):
            raise InputError(
                f"{path}: positions are normalized whole numbers (KHR_mesh_quantization); expected "
                "numbers of 32 bits (save it without quantization)"
            )
        used += 1
    return used


def collada_parts(path: str | Path) -> list[tuple[str, int]]:
    """Count the parts of a COLLADA file that are left out, by reason.

    Raises
    ------
    InputError
        The file has no scene.
    """
    text = re.sub(rb"<!--.*?-->", b"", read_bytes(path), flags=re.DOTALL)
    if not re.search(rb"<instance_visual_scene\b", text):
        raise InputError(f"{path}: expected a scene (instance_visual_scene), got none")
    kinds = (
        ("bent by a skeleton or morphed", rb"<instance_controller\b"),
        ("of points or lines, not of faces", rb"<(?:lines|linestrips)\b"),
        ("of curves or solids, not of faces", rb"<(?:spline|brep|convex_mesh)\b"),
    )
    return [(reason, n) for reason, mark in kinds if (n := len(re.findall(mark, text)))]


@dataclass(frozen=True)
class PlainObj:
    """OBJ file with positive indices.

    Attributes
    ----------
    text
        Contents of the file.
    faces
        Number of faces of three corners or more.
    triangles
        Number of triangles that these faces are cut into.
    left_out
        Reasons, and numbers of elements.
    """

    text: bytes
    faces: int
    triangles: int
    left_out: list[tuple[str, int]]


def plain_obj(path: str | Path) -> PlainObj:
    """Return an OBJ file with positive indices, and count the elements that are left out.

    A negative index counts back from the last vertex before its line; readers that count back from
    the end of the file would join other vertices.
    """
    data = read_bytes(path).replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    lines = len(re.findall(rb"^[ \t]*[lp][ \t]", data, re.MULTILINE))
    curves = len(re.findall(rb"^[ \t]*(?:curv2?|surf)[ \t]", data, re.MULTILINE))
    faces = re.findall(rb"^[ \t]*f[ \t]+(.*)$", data, re.MULTILINE)
    corners = [len(f.split(b"#")[0].split()) for f in faces]
    short = sum(count < 3 for count in corners)
    left_out = [
        ("of points or lines, not of faces", lines),
        ("of free-form curves or surfaces", curves),
        ("of fewer than three corners", short),
    ]
    if re.search(rb"^[ \t]*f[ \t].*-\d", data, re.MULTILINE):
        data = b"\n".join(_with_positive_indices(data))
    return PlainObj(
        data,
        faces=len(faces) - short,
        triangles=sum(max(count - 2, 0) for count in corners),
        left_out=[(reason, count) for reason, count in left_out if count],
    )


def _with_positive_indices(data: bytes) -> list[bytes]:
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    order = (b"v", b"vt", b"vn")
    out = []
    for line in data.splitlines():
        words = line.split()
        if words and words[0] in counts:
            counts[words[0]] += 1
        elif words and words[0] == b"f":
            corners = []
            for corner in line.split(b"#")[0].split()[1:]:
                parts = [
                    b"%d" % (counts[kind] + 1 + int(part)) if part.startswith(b"-") else part
                    for kind, part in zip(order, corner.split(b"/"), strict=False)
                ]
                corners.append(b"/".join(parts))
            line = b"f " + b" ".join(corners)
        out.append(line)
    return out


def binary_stl(path: str | Path) -> Floats | None:
    """Return the triangles (n, 3, 3) of a binary STL file; None for a text file.

    The header of a binary file may begin with "solid", as text does, so the size that follows from
    the stated number of triangles decides. Bytes after the last triangle are ignored.

    Raises
    ------
    InputError
        The file is cut short.
    """
    data = read_bytes(path)
    if len(data) < 84:
        return None
    count = struct.unpack_from("<I", data, 80)[0]
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:2000].lower()
    if len(data) != 84 + 50 * count and is_text:
        return None
    if len(data) < 84 + 50 * count:
        raise InputError(f"{path}: cut short; the file states {count} triangles")
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
    return np.asarray(np.frombuffer(data, kind, count, 84)["corners"], dtype=float)
