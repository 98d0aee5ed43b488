#!/usr/bin/env python3
"""Turns a clip of a public dataset, from your own copy of it, into a folder with truth.json
(docs/evaluation.md), against which `monoperfcap eval TAKE --truth FOLDER` compares a capture.

  convert_dataset.py h36m-h5 annot.h5 --camera 54138969 -o FOLDER
  convert_dataset.py h36m-npz data_3d_h36m.npz --subject S9 --action "Walking 1" --camera cam.json -o FOLDER
  convert_dataset.py 3dpw sequenceFiles/test/downtown_walking_00.pkl --person 0 -o FOLDER
  convert_dataset.py 3dhp S1/Seq1 --camera 0 -o FOLDER
  convert_dataset.py monoperfcap Pablo_outdoor --fps 30 -o FOLDER

Needs numpy; h36m-h5 also h5py, 3dhp also scipy. `--video` and `--masks` name files to be evaluated
with the clip. Joints that are not ours (such as a mean of toes) are left out, never renamed."""

import argparse
import glob
import json
import os
import pickle
import re
import struct
import sys

import numpy as np

# Our names of joints (OpenPose's), and where each dataset has them.
H36M_32 = {"MidHip": 0, "RHip": 1, "RKnee": 2, "RAnkle": 3, "RBigToe": 5, "LHip": 6, "LKnee": 7,
           "LAnkle": 8, "LBigToe": 10, "Neck": 13, "Head": 15, "LShoulder": 17, "LElbow": 18,
           "LWrist": 19, "RShoulder": 25, "RElbow": 26, "RWrist": 27}
# The 17 that are left when the constant and doubled ones are taken out.
H36M_17 = {"MidHip": 0, "RHip": 1, "RKnee": 2, "RAnkle": 3, "LHip": 4, "LKnee": 5, "LAnkle": 6,
           "Neck": 8, "Head": 10, "LShoulder": 11, "LElbow": 12, "LWrist": 13, "RShoulder": 14,
           "RElbow": 15, "RWrist": 16}
# SMPL: its head is no top of the head, its feet are no toe tips.
SMPL_24 = {"MidHip": 0, "LHip": 1, "RHip": 2, "LKnee": 4, "RKnee": 5, "LAnkle": 7, "RAnkle": 8,
           "Neck": 12, "LShoulder": 16, "RShoulder": 17, "LElbow": 18, "RElbow": 19, "LWrist": 20,
           "RWrist": 21}
COCO_18 = {"Nose": 0, "Neck": 1, "RShoulder": 2, "RElbow": 3, "RWrist": 4, "LShoulder": 5,
           "LElbow": 6, "LWrist": 7, "RHip": 8, "RKnee": 9, "RAnkle": 10, "LHip": 11, "LKnee": 12,
           "LAnkle": 13, "REye": 14, "LEye": 15, "REar": 16, "LEar": 17}
MPI_28 = {"MidHip": 4, "Neck": 5, "Head": 7, "LShoulder": 9, "LElbow": 10, "LWrist": 11,
          "RShoulder": 14, "RElbow": 15, "RWrist": 16, "LHip": 18, "LKnee": 19, "LAnkle": 20,
          "LBigToe": 22, "RHip": 23, "RKnee": 24, "RAnkle": 25, "RBigToe": 27}
# Our own names, for detections.
OWN_NAMES = {"MidHip": "pelvis", "Head": "head_top", "LBigToe": "left_toe", "RBigToe": "right_toe",
             "Neck": "neck", "Nose": "nose"}

MM = 1e-3


class Fault(Exception):
    """One sentence about the user's input."""


def own_name(name):
    if name in OWN_NAMES:
        return OWN_NAMES[name]
    return ("left_" if name[0] == "L" else "right_") + name[1:].lower()


def member(container, key, what):
    try:
        return container[key]
    except (KeyError, IndexError, ValueError):
        raise Fault(f"{what} has no {key}") from None


def require_shape(array, shape, what):
    """shape: sizes, None where any will do."""
    if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape)):
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        raise Fault(f"{what} is {' x '.join(map(str, array.shape))}, expected {wanted}")


class Clip:
    """Joints F x J x 3 in the world, NaN where unknown; camera as in cameras.json."""

    def __init__(self, names, joints, fps, camera, motion=None):
        self.names, self.joints, self.fps = names, joints, fps
        self.camera, self.motion = camera, motion
        self.names_2d, self.detections = [], None  # F x J x 3: pixels and confidence
        self.vertices, self.masks = None, None  # F x V x 3 in the world; a folder

    def write(self, folder, video, masks):
        if not len(self.joints):
            raise Fault("the clip has no frames")
        os.makedirs(folder, exist_ok=True)

        def dump(name, content):
            with open(os.path.join(folder, name), "w") as file:
                json.dump(content, file)
            return name

        frames = [[[round(float(v), 6) for v in p] if np.isfinite(p).all() else [None] * 3
                   for p in frame] for frame in self.joints]
        camera = dict(self.camera)
        if self.motion is not None:
            camera["R"], camera["t"] = self.motion[0]["R"], self.motion[0]["t"]
            camera["frames"] = self.motion
        truth = {
            "format": "mpc-truth", "version": 1, "fps": self.fps, "frames": len(self.joints),
            "width": camera["width"], "height": camera["height"], "floor": False,
            "camera": dump("camera.json", {"cameras": [camera]}),
            "joints": dump("joints.json",
                           {"fps": self.fps, "names": list(self.names), "joints": frames})}
        if self.detections is not None:
            truth["detections2d"] = dump("detections2d.json", {
                "format": "mpc-detections", "version": 1, "dimensions": 2,
                "width": camera["width"], "height": camera["height"],
                "joints": [own_name(n) for n in self.names_2d],
                "frames": [[[float(x), float(y), float(np.clip(c, 0, 1))] if c > 0 else None
                            for x, y, c in frame] for frame in self.detections]})
        if self.vertices is not None:
            truth["vertices"] = "vertices.pc2"
            write_pc2(os.path.join(folder, "vertices.pc2"), self.vertices)
        for key, path in (("video", video), ("masks", masks or self.masks)):
            if path:
                if not os.path.exists(path):
                    raise Fault(f"{path} does not exist")
                truth[key] = os.path.relpath(path, folder)
        dump("truth.json", truth)


def write_pc2(path, vertices):
    with open(path, "wb") as file:
        file.write(b"POINTCACHE2\0" + struct.pack("<iiffi", 1, vertices.shape[1], 0, 1,
                                                  len(vertices)))
        file.write(vertices.astype("<f4").tobytes())


def pick(table, array):
    return list(table), array[:, list(table.values())].astype(float)


def pinhole(name, fx, fy, cx, cy, width, height):
    return {"name": name, "width": int(width), "height": int(height), "fx": float(fx),
            "fy": float(fy), "cx": float(cx), "cy": float(cy),
            "R": np.eye(3).tolist(), "t": [0, 0, 0]}


def h36m_h5(args):
    """annot.h5 of h36m-fetch: camera coordinates in mm, pixels, intrinsics [fx, cx, fy, cy]."""
    import h5py

    with h5py.File(args.input, "r") as file:
        rows = np.flatnonzero(np.array(member(file, "camera", args.input)) == int(args.camera))
        if not len(rows):
            raise Fault(f"{args.input} has no frame of camera {args.camera}")
        pose = "pose/3d" if "pose/3d" in file else "pose/3d-univ"
        joints = np.array(member(file, pose, args.input))[rows]
        pixels = np.array(member(file, "pose/2d", args.input))[rows]
        frame = np.array(member(file, "frame", args.input))[rows]
        intrinsics = np.array(member(file, f"intrinsics/{args.camera}", args.input)).ravel()
        if "subaction" in file:
            sub = np.array(file["subaction"])[rows]
            keep = sub == (sub[0] if args.subaction is None else args.subaction)
            if not keep.any():
                raise Fault(f"{args.input} has no subaction {args.subaction}")
            joints, pixels, frame = joints[keep], pixels[keep], frame[keep]
    require_shape(joints, (None, 32, 3), pose)
    require_shape(pixels, (None, 32, 2), "pose/2d")
    steps = np.unique(np.diff(frame)) if len(frame) > 1 else np.array([1])
    if len(steps) != 1 or steps[0] < 1:
        raise Fault(f"the frames of {args.input} are not evenly spaced, so they are no video")
    fx, cx, fy, cy = intrinsics[:4]
    names, joints = pick(H36M_32, joints * MM)
    camera = pinhole(args.camera, fx, fy, cx, cy, *(args.size or (1000, 1000)))
    clip = Clip(names, joints, 50 / int(steps[0]), camera)
    clip.names_2d, pixels = pick(H36M_32, pixels)
    clip.detections = np.concatenate([pixels, np.ones(pixels.shape[:2] + (1,))], 2)
    return clip


def h36m_npz(args):
    """data_3d_h36m.npz of VideoPose3D: metres in the world (z up); a camera file of ours."""
    positions = member(load_npz(args.input), "positions_3d", args.input)
    poses = member(member(positions, args.subject, args.input), args.action,
                   f"{args.subject} of {args.input}")
    joints = np.asarray(poses, float)
    require_shape(joints, (None, None, 3), args.action)
    table = {32: H36M_32, 17: H36M_17}.get(joints.shape[1])
    if table is None:
        raise Fault(f"{args.action} has {joints.shape[1]} joints, expected 32 or 17")
    path, _, name = args.camera.partition(".json:")
    with open(path + ".json" if name else path) as file:
        cameras = [c for c in member(json.load(file), "cameras", path)
                   if not name or c.get("name") == name]
    if len(cameras) != 1 or "R" not in cameras[0]:
        raise Fault(f"{args.camera} does not name one camera with R and t")
    names, joints = pick(table, joints)
    return Clip(names, joints, args.fps or 50, cameras[0])


class NumpyUnpickler(pickle.Unpickler):
    """Pickles can run programs when they are read; these may only hold arrays."""

    ALLOWED = {("numpy", "ndarray"), ("numpy", "dtype"), ("_codecs", "encode")}

    def find_class(self, module, name):
        module = module.replace("numpy._core", "numpy.core")
        is_numpy = module == "numpy.core.multiarray" and name in ("_reconstruct", "scalar")
        if not is_numpy and (module, name) not in self.ALLOWED:
            raise Fault(f"the pickle wants {module}.{name}, which is no array: it is not read")
        return super().find_class(module, name)


def load_npz(path):
    """The dictionaries of an .npz, through NumpyUnpickler where they are pickled."""
    import zipfile

    result = {}
    with zipfile.ZipFile(path) as archive:
        for entry in archive.namelist():
            with archive.open(entry) as file:
                version = np.lib.format.read_magic(file)
                read_header = (np.lib.format.read_array_header_1_0 if version == (1, 0) else
                               np.lib.format.read_array_header_2_0)
                shape, _, dtype = read_header(file)
                if dtype.hasobject:
                    content = NumpyUnpickler(file, encoding="latin1").load()
                    content = content.item() if shape == () else content
                else:
                    content = np.frombuffer(file.read(), dtype).reshape(shape)
            result[entry.removesuffix(".npy")] = content
    return result


def three_dpw(args):
    """sequenceFiles/*.pkl: SMPL joints in the world, a moving camera."""
    with open(args.input, "rb") as file:
        data = NumpyUnpickler(file, encoding="latin1").load()
    if not isinstance(data, dict):
        raise Fault(f"{args.input} is no 3DPW sequence")
    persons = member(data, "jointPositions", args.input)
    if args.person >= len(persons):
        raise Fault(f"{args.input} has {len(persons)} persons, there is none with number {args.person}")
    joints = np.asarray(persons[args.person], float)
    require_shape(joints, (None, 72), "jointPositions")
    joints = joints.reshape(-1, 24, 3)
    poses = np.asarray(member(data, "cam_poses", args.input), float)
    require_shape(poses, (len(joints), 4, 4), "cam_poses")
    k = np.asarray(member(data, "cam_intrinsics", args.input), float)
    require_shape(k, (3, 3), "cam_intrinsics")
    names, joints = pick(SMPL_24, joints)
    if "campose_valid" in data:
        joints[~np.asarray(data["campose_valid"][args.person], bool)] = np.nan
    width, height = args.size or (round(2 * k[0, 2]), round(2 * k[1, 2]))
    camera = pinhole("3dpw", k[0, 0], k[1, 1], k[0, 2], k[1, 2], width, height)
    motion = [{"R": orthonormal(m[:3, :3]).tolist(), "t": m[:3, 3].tolist()} for m in poses]
    clip = Clip(names, joints, args.fps or 30, camera, motion)
    for key in ("poses2d", "poses2D"):
        if key in data:
            seen = np.asarray(data[key][args.person], float)
            require_shape(seen, (len(joints), 3, 18), key)
            clip.names_2d, clip.detections = pick(COCO_18, seen.transpose(0, 2, 1))
    return clip


def orthonormal(rotation):
    u, _, vt = np.linalg.svd(rotation)
    return u @ vt


def three_dhp(args):
    """A Seq folder with annot.mat (camera coordinates in mm) and camera.calibration."""
    import scipy.io

    annotations = scipy.io.loadmat(os.path.join(args.input, "annot.mat"))
    camera = int(args.camera)
    key = "univ_annot3" if args.universal else "annot3"

    def cell(name, columns):
        cells = member(annotations, name, "annot.mat").ravel()
        content = np.asarray(member(cells, camera, f"{name} of annot.mat"), float)
        require_shape(content, (None, columns), name)
        return content.reshape(len(content), 28, -1)

    fx, fy, cx, cy, width, height = read_calibration(
        os.path.join(args.input, "camera.calibration"), camera)
    names, joints = pick(MPI_28, cell(key, 84) * MM)
    clip = Clip(names, joints, args.fps or 25,
                pinhole(f"camera{camera}", fx, fy, cx, cy, width, height))
    if "annot2" in annotations:
        clip.names_2d, pixels = pick(MPI_28, cell("annot2", 56))
        clip.detections = np.concatenate([pixels, np.ones(pixels.shape[:2] + (1,))], 2)
    return clip


def read_calibration(path, camera):
    """Blocks of "name N", "size W H", "intrinsic" with 16 numbers, and more."""
    name = None
    found = {}
    with open(path) as file:
        for line in file:
            words = line.split()
            if words[:1] == ["name"] and len(words) > 1:
                name = words[1]
            elif words and name == str(camera) and words[0] in ("size", "intrinsic"):
                found[words[0]] = [float(w) for w in words[1:]]
    if len(found.get("size", [])) < 2 or len(found.get("intrinsic", [])) < 16:
        raise Fault(f"{path} has no size and intrinsics of camera {camera}")
    k = found["intrinsic"]
    return (k[0], k[5], k[2], k[6], *found["size"][:2])


def monoperfcap(args):
    """A sequence of MonoPerfCap: calib.txt, and ground_truth with a mesh (.off) or mask per frame."""
    found = lambda kind: sorted(glob.glob(os.path.join(args.input, "ground_truth", "*." + kind)))
    meshes, masks = found("off"), found("png")
    if not meshes and not masks:
        raise Fault("there is no ground_truth/*.off and no ground_truth/*.png")
    if meshes and masks and len(meshes) != len(masks):
        raise Fault(f"ground_truth has {len(meshes)} meshes and {len(masks)} masks")
    k, m = read_labelled_matrices(os.path.join(args.input, "calib.txt"))
    rotation = orthonormal(m[:3, :3])
    if np.linalg.det(rotation) < 0:
        raise Fault("the second matrix of calib.txt is a mirror image")
    vertices, unit = None, MM
    if meshes:
        frames = [read_off(path) for path in meshes]
        for path, frame in zip(meshes, frames):
            require_shape(frame, frames[0].shape, path)
        vertices = np.array(frames)
        tall = np.ptp(vertices[0], axis=0).max()
        units = [u for u in (1, 1e-2, MM) if 0.5 <= tall * u <= 3]
        if not units:
            raise Fault(f"a mesh of {tall:.4g} units is no person in metres, centimetres or millimetres")
        unit = units[0]
        vertices = vertices * unit
    width, height = args.size or (round(2 * k[0, 2]), round(2 * k[1, 2]))
    camera = pinhole("monoperfcap", k[0, 0], k[1, 1], k[0, 2], k[1, 2], width, height)
    camera["R"], camera["t"] = rotation.tolist(), (m[:3, 3] * unit).tolist()
    names = [name for name in H36M_32 if name not in ("MidHip", "Neck", "Head")]
    clip = Clip(names, np.full((len(meshes or masks), len(names), 3), np.nan), args.fps or 30, camera)
    clip.vertices, clip.masks = vertices, os.path.dirname(masks[0]) if masks else None
    return clip


def read_labelled_matrices(path):
    """Of lines of a word and 16 numbers, the first two: intrinsics, and camera from world."""
    matrices = []
    with open(path) as file:
        for line in file:
            words = line.split()
            if len(words) == 17:
                matrices.append(np.array(words[1:], float).reshape(4, 4))
    if len(matrices) < 2:
        raise Fault(f"{path} has no two lines of a word and 16 numbers: intrinsics and extrinsics")
    return matrices[:2]


def read_off(path):
    """The vertices of an OFF file, V x 3."""
    with open(path) as file:
        words = [w for line in file for w in line.split("#")[0].split()]
    if words[:1] != ["OFF"] or len(words) < 4:
        raise Fault(f"{path} is no OFF file")
    count = int(words[1])
    if count < 1 or len(words) < 4 + 3 * count:
        raise Fault(f"{path} ends before its {count} vertices")
    vertices = np.array(words[4:4 + 3 * count], float).reshape(-1, 3)
    if not np.isfinite(vertices).all():
        raise Fault(f"{path} has a vertex that is not finite")
    return vertices


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="layout", required=True)
    for layout, convert in (("h36m-h5", h36m_h5), ("h36m-npz", h36m_npz), ("3dpw", three_dpw),
                            ("3dhp", three_dhp), ("monoperfcap", monoperfcap)):
        command = commands.add_parser(layout, help=convert.__doc__)
        command.set_defaults(convert=convert)
        command.add_argument("input")
        command.add_argument("-o", "--output", required=True)
        command.add_argument("--video", help="the clip, for pictures of the worst frames")
        command.add_argument("--masks", help="true masks, one picture per frame")
        command.add_argument("--fps", type=float, help="where the files do not say it")
        command.add_argument("--size", type=lambda s: tuple(map(int, re.split("x", s))),
                             help="WxH of the video, where the files do not say it")
        if layout not in ("3dpw", "monoperfcap"):
            command.add_argument("--camera", required=True)
        if layout == "h36m-npz":
            command.add_argument("--subject", required=True)
            command.add_argument("--action", required=True)
        if layout == "h36m-h5":
            command.add_argument("--subaction", type=int, help="default: the first")
        if layout == "3dpw":
            command.add_argument("--person", type=int, default=0)
        if layout == "3dhp":
            command.add_argument("--universal", action="store_true", help="univ_annot3")
    args = parser.parse_args()
    try:
        args.convert(args).write(args.output, args.video, args.masks)
    except (Fault, OSError, ImportError, EOFError, ValueError, pickle.UnpicklingError) as fault:
        sys.exit(f"convert_dataset.py: {args.input}: {' '.join(str(fault).split())}")


if __name__ == "__main__":
    main()
