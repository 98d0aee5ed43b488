#!/usr/bin/env python3
"""scripts/convert_dataset.py on tiny files with the layouts of the datasets, made here.

  convert_dataset_test.py CONVERT_DATASET.PY [MONOPERFCAP]

With the command, what was converted is also read by it."""

import json
import os
import pickle
import subprocess
import sys
import tempfile
import unittest

import numpy as np

CONVERT, COMMAND = sys.argv[1], (sys.argv[2:] or [None])[0]
FRAMES = 4


def convert(*arguments):
    return subprocess.run([sys.executable, CONVERT, *map(str, arguments)], capture_output=True,
                          text=True)


class ConvertTest(unittest.TestCase):
    def setUp(self):
        self.rng = np.random.default_rng(1)
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.out = self.path("out")

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def points(self, joints):
        return self.rng.normal(size=(FRAMES, joints, 3)) + [0, 0, 4]

    def converted(self, *arguments, joints=True):
        run = convert(*arguments, "-o", self.out)
        self.assertEqual(run.returncode, 0, run.stderr)
        with open(os.path.join(self.out, "truth.json")) as file:
            truth = json.load(file)
        self.assertEqual(truth["frames"], FRAMES)
        self.assertFalse(truth["floor"])
        content = {}
        for key in ("camera", "joints", "detections2d"):
            if key in truth:
                with open(os.path.join(self.out, truth[key])) as file:
                    content[key] = json.load(file)
        if COMMAND:
            # The command reads it, and finds it equal to itself.
            track = os.path.join(self.out, truth["joints"])
            run = subprocess.run([COMMAND, "eval", track, "--truth", self.out, "--json"],
                                 capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(json.loads(run.stdout)["absolute"]["mean_mm"], 0 if joints else None)
        return truth, content

    def joint(self, content, name):
        index = content["joints"]["names"].index(name)
        return np.array([frame[index] for frame in content["joints"]["joints"]], float)

    def refused(self, part, *arguments):
        run = convert(*arguments, "-o", self.out)
        self.assertEqual(run.returncode, 1, run.stderr)
        self.assertEqual(run.stderr.count("\n"), 1, run.stderr)
        self.assertIn(part, run.stderr)
        self.assertFalse(os.path.exists(os.path.join(self.out, "truth.json")))

    def test_h36m_h5(self):
        import h5py

        joints, pixels = 1000 * self.points(32), self.rng.uniform(0, 1000, (FRAMES, 32, 2))
        with h5py.File(self.path("annot.h5"), "w") as file:
            other = np.zeros_like(joints)
            file["pose/3d"] = np.concatenate([other, joints])
            file["pose/2d"] = np.concatenate([np.zeros_like(pixels), pixels])
            file["camera"] = [54138969] * FRAMES + [60457274] * FRAMES
            file["frame"] = list(range(1, 5 * FRAMES, 5)) * 2
            file["intrinsics/60457274"] = [1145.0, 512.5, 1143.8, 515.4]
        truth, content = self.converted("h36m-h5", self.path("annot.h5"), "--camera", "60457274")
        self.assertEqual(truth["fps"], 10)
        np.testing.assert_allclose(self.joint(content, "RWrist"), joints[:, 27] / 1000, atol=1e-6)
        np.testing.assert_allclose(self.joint(content, "LBigToe"), joints[:, 10] / 1000, atol=1e-6)
        camera = content["camera"]["cameras"][0]
        self.assertEqual((camera["fx"], camera["cx"], camera["fy"], camera["cy"]),
                         (1145.0, 512.5, 1143.8, 515.4))
        detections = content["detections2d"]
        self.assertIn("right_toe", detections["joints"])
        knee = detections["joints"].index("left_knee")
        np.testing.assert_allclose(detections["frames"][2][knee], [*pixels[2, 7], 1])
        self.assertEqual(truth["width"], 1000)

        os.remove(os.path.join(self.out, "truth.json"))
        self.refused("no frame of camera 7", "h36m-h5", self.path("annot.h5"), "--camera", "7")

    def test_h36m_npz(self):
        joints = self.points(32)
        positions = {"S9": {"Walking 1": joints, "Odd": joints[:, :5]}}
        np.savez(self.path("data.npz"), positions_3d=np.array(positions, object))
        camera = {"name": "c", "width": 1000, "height": 1002, "fx": 1145, "fy": 1143, "cx": 512,
                  "cy": 515, "R": [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], "t": [0.1, 0.2, 5]}
        with open(self.path("cam.json"), "w") as file:
            json.dump({"cameras": [camera, dict(camera, name="d")]}, file)
        arguments = ("h36m-npz", self.path("data.npz"), "--camera", self.path("cam.json:c"),
                     "--subject", "S9", "--action")
        truth, content = self.converted(*arguments, "Walking 1")
        self.assertEqual(truth["fps"], 50)
        self.assertEqual(content["camera"]["cameras"], [camera])
        np.testing.assert_allclose(self.joint(content, "RShoulder"), joints[:, 25], atol=1e-6)
        os.remove(os.path.join(self.out, "truth.json"))
        self.refused("no Sitting", *arguments, "Sitting")
        self.refused("5 joints", *arguments, "Odd")

    def dpw(self, **changes):
        def rigid(f):
            c, s = np.cos(0.1 * f), np.sin(0.1 * f)
            return np.array([[c, 0, s, 0.1], [0, 1, 0, 0.2], [-s, 0, c, f], [0, 0, 0, 1]])

        data = {
            "sequence": "downtown", "jointPositions": [self.points(24).reshape(FRAMES, 72)] * 2,
            "cam_poses": np.array([rigid(f) for f in range(FRAMES)]),
            "cam_intrinsics": np.array([[1969.2, 0, 540], [0, 1961.9, 960], [0, 0, 1]]),
            "campose_valid": [np.ones(FRAMES, bool), np.array([1, 1, 0, 1])],
            "poses2d": [self.rng.uniform(0.5, 900, (FRAMES, 3, 18))] * 2}
        data["poses2d"][0][1, 2, :] = 0
        data.update(changes)
        with open(self.path("a.pkl"), "wb") as file:
            pickle.dump(data, file, protocol=2)
        return data

    def test_3dpw(self):
        data = self.dpw()
        truth, content = self.converted("3dpw", self.path("a.pkl"), "--person", 1)
        self.assertEqual((truth["fps"], truth["width"], truth["height"]), (30, 1080, 1920))
        wrist = data["jointPositions"][1].reshape(FRAMES, 24, 3)[:, 20]
        found = self.joint(content, "LWrist")
        np.testing.assert_allclose(found[[0, 1, 3]], wrist[[0, 1, 3]], atol=1e-6)
        self.assertTrue(np.isnan(found[2]).all())
        frames = content["camera"]["cameras"][0]["frames"]
        np.testing.assert_allclose(frames[3]["t"], [0.1, 0.2, 3])
        np.testing.assert_allclose(frames[3]["R"], data["cam_poses"][3][:3, :3], atol=1e-12)
        detections = content["detections2d"]
        hip = detections["joints"].index("right_hip")
        np.testing.assert_allclose(detections["frames"][0][hip][:2],
                                   data["poses2d"][1][0, :2, 8])
        self.assertTrue(all(joint is None for joint in detections["frames"][1]))
        self.assertNotIn("Head", content["joints"]["names"])

    def test_3dpw_refuses(self):
        self.dpw()
        self.refused("2 persons", "3dpw", self.path("a.pkl"), "--person", 2)
        self.dpw(cam_poses=np.zeros((FRAMES - 1, 4, 4)))
        self.refused("cam_poses is 3 x 4 x 4", "3dpw", self.path("a.pkl"))
        with open(self.path("a.pkl"), "wb") as file:
            pickle.dump(os.system, file)
        self.refused("which is no array", "3dpw", self.path("a.pkl"))
        with open(self.path("a.pkl"), "wb") as file:
            file.write(b"\x80\x02}")
        self.refused("a.pkl", "3dpw", self.path("a.pkl"))
        self.refused("No such file", "3dpw", self.path("none.pkl"))

    def test_3dhp(self):
        import scipy.io

        def cells(columns):
            content = np.empty((2, 1), object)
            for camera in range(2):
                content[camera, 0] = self.rng.normal(size=(FRAMES, columns)) * 100 + 1000
            return content

        data = {"annot2": cells(56), "annot3": cells(84), "univ_annot3": cells(84)}
        scipy.io.savemat(self.path("annot.mat"), data)
        block = ("name          {}\n  sensor      10 10\n  size        2048 2047\n"
                 "  intrinsic   {} 0 1024.7 0 0 1497.1 1051.4 0 0 0 1 0 0 0 0 1\n"
                 "  extrinsic   1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n  radial      0\n")
        with open(self.path("camera.calibration"), "w") as file:
            file.write("Skeletool Camera Calibration File V1.0\n" + block.format(0, 1) +
                       block.format(1, 1497.7))
        for key, more in (("annot3", ()), ("univ_annot3", ("--universal",))):
            truth, content = self.converted("3dhp", self.folder.name, "--camera", 1, *more)
            expected = data[key][1, 0].reshape(FRAMES, 28, 3) / 1000
            np.testing.assert_allclose(self.joint(content, "Head"), expected[:, 7], atol=1e-6)
            np.testing.assert_allclose(self.joint(content, "RBigToe"), expected[:, 27], atol=1e-6)
        camera = content["camera"]["cameras"][0]
        self.assertEqual((camera["fx"], camera["cy"], camera["height"]), (1497.7, 1051.4, 2047))
        self.assertEqual(truth["fps"], 25)
        pixels = data["annot2"][1, 0].reshape(FRAMES, 28, 2)
        elbow = content["detections2d"]["joints"].index("left_elbow")
        np.testing.assert_allclose(content["detections2d"]["frames"][3][elbow][:2], pixels[3, 10])
        os.remove(os.path.join(self.out, "truth.json"))
        self.refused("camera 5", "3dhp", self.folder.name, "--camera", 5)

    def monoperfcap(self, meshes, calib=None):
        truth = self.path("ground_truth")
        os.makedirs(truth, exist_ok=True)
        for name in os.listdir(truth):
            os.remove(os.path.join(truth, name))
        for f, vertices in enumerate(meshes):
            with open(os.path.join(truth, f"mesh_{f:04d}.off"), "w") as file:
                file.write(f"OFF\n{len(vertices)} 1 0\n")
                file.writelines("%.9g %.9g %.9g\n" % tuple(v) for v in vertices)
                file.write("3 0 1 2\n")
        with open(self.path("calib.txt"), "w") as file:
            file.write(calib or
                       "Calibration\ncamera 0\n"
                       "intrinsic 1500.5 0 970 0 0 1499 530 0 0 0 1 0 0 0 0 1\n"
                       "extrinsic 1 0 0 100 0 0 -1 200 0 1 0 3000 0 0 0 1\n")

    def test_monoperfcap(self):
        meshes = self.rng.uniform(-900, 900, (FRAMES, 30, 3))  # mm
        meshes[0, :2] = [[0, 0, -900], [0, 0, 900]]
        self.monoperfcap(meshes)
        truth, content = self.converted("monoperfcap", self.folder.name, "--size", "1920x1080",
                                        "--fps", 25, joints=False)
        camera = content["camera"]["cameras"][0]
        self.assertEqual((camera["fx"], camera["fy"], camera["cx"], camera["cy"]),
                         (1500.5, 1499, 970, 530))
        np.testing.assert_allclose(camera["t"], [0.1, 0.2, 3])
        np.testing.assert_allclose(camera["R"], [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        self.assertEqual((truth["fps"], truth["width"], truth["height"]), (25, 1920, 1080))
        with open(os.path.join(self.out, truth["vertices"]), "rb") as file:
            data = file.read()
        self.assertEqual(data[:12], b"POINTCACHE2\0")
        self.assertEqual(np.frombuffer(data[12:32], "<i4")[[0, 1, 4]].tolist(), [1, 30, FRAMES])
        np.testing.assert_allclose(np.frombuffer(data[32:], "<f4").reshape(FRAMES, 30, 3),
                                   meshes / 1000, atol=1e-6)

        # Masks alone.
        self.monoperfcap([])
        for f in range(FRAMES):
            open(self.path(f"ground_truth/{f:04d}.png"), "wb").close()
        truth, _ = self.converted("monoperfcap", self.folder.name, joints=False)
        self.assertNotIn("vertices", truth)
        self.assertEqual(os.path.normpath(os.path.join(self.out, truth["masks"])),
                         self.path("ground_truth"))
        self.assertEqual((truth["fps"], truth["width"], truth["height"]), (30, 1940, 1060))

    def test_monoperfcap_refuses(self):
        arguments = ("monoperfcap", self.folder.name)
        self.monoperfcap([])
        self.refused("no ground_truth/*.off", *arguments)
        person = np.array([[0, 0, 0], [0, 1.8, 0], [0.3, 1, 0]])
        self.monoperfcap([person, person[:2]])
        self.refused("mesh_0001.off is 2 x 3, expected 3 x 3", *arguments)
        self.monoperfcap([person * 1e6])
        self.refused("no person", *arguments)
        self.monoperfcap([person], "intrinsic 1 2 3\n")
        self.refused("no two lines", *arguments)
        self.monoperfcap([person], 2 * "m -1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n")
        self.refused("mirror image", *arguments)
        self.monoperfcap([person * np.nan])
        self.refused("not finite", *arguments)
        with open(self.path("ground_truth/mesh_0000.off"), "w") as file:
            file.write("OFF\n5 0 0\n1 2 3\n")
        self.refused("ends before its 5 vertices", *arguments)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
