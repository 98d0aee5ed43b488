#!/usr/bin/env python3
"""The metrics of libmpc_eval once more, written from their definitions with numpy and without a look
at the C++: reads a JSON object of inputs, prints a JSON object of results."""

import json
import sys

import numpy as np


def similarity(x, y):
    """The best s R x + t for y (both n x 3), by singular values."""
    mean_x, mean_y = x.mean(0), y.mean(0)
    u, d, vt = np.linalg.svd((y - mean_y).T @ (x - mean_x))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u @ sign @ vt
    scale = np.trace(np.diag(d) @ sign) / ((x - mean_x) ** 2).sum()
    return scale * (x - mean_x) @ rotation.T + mean_y


def joint_errors(estimate, truth, left_hip, right_hip):
    """Means in mm of F x J x 3 metres; NaN joints are left out."""
    sums = {"absolute": [], "mpjpe": [], "n_mpjpe": [], "pa_mpjpe": [], "root": []}
    for e, t in zip(estimate, truth):
        seen = np.isfinite(e).all(1) & np.isfinite(t).all(1)
        sums["absolute"] += list(np.linalg.norm(e - t, axis=1)[seen])
        aligned = similarity(e[seen], t[seen])
        sums["pa_mpjpe"] += list(np.linalg.norm(aligned - t[seen], axis=1))
        if not (seen[left_hip] and seen[right_hip]):
            continue
        root_e = (e[left_hip] + e[right_hip]) / 2
        root_t = (t[left_hip] + t[right_hip]) / 2
        sums["root"].append(np.linalg.norm(root_e - root_t))
        e, t = e[seen] - root_e, t[seen] - root_t
        sums["mpjpe"] += list(np.linalg.norm(e - t, axis=1))
        scale = (e * t).sum() / (e * e).sum()
        sums["n_mpjpe"] += list(np.linalg.norm(scale * e - t, axis=1))
    return {name: 1000 * float(np.mean(values)) for name, values in sums.items()}


def second_difference(x):
    """Mean length of x[f - 1] - 2 x[f] + x[f + 1], mm, of F x J x 3."""
    lengths = np.linalg.norm(np.diff(x, n=2, axis=0), axis=2)
    return 1000 * float(np.nanmean(lengths))


def bone_deviation(x, bones):
    deviations = []
    for a, b in bones:
        length = np.linalg.norm(x[:, a] - x[:, b], axis=1)
        deviations.append(1000 * float(np.nanstd(length)))
    return float(np.mean(deviations))


def skate(estimate, truth, feet, fps, up, max_speed, max_height):
    slides = []
    for j in feet:
        floor = np.nanmin(truth[:, j] @ up)
        for f in range(len(truth) - 1):
            step_e = estimate[f + 1, j] - estimate[f, j]
            step_t = truth[f + 1, j] - truth[f, j]
            high = max(truth[f, j] @ up, truth[f + 1, j] @ up) > floor + max_height
            if high or not np.linalg.norm(step_t) * fps <= max_speed:
                continue
            slide = step_e - step_t
            slide = np.linalg.norm(slide - (slide @ up) * up)
            if np.isfinite(slide):
                slides.append(slide)
    return 1000 * float(np.mean(slides))


def iou(a, b):
    return float((a & b).sum() / (a | b).sum())


def outline(mask):
    height, width = mask.shape
    points = []
    for y, x in zip(*np.nonzero(mask)):
        beside = [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
        if any(0 <= v < height and 0 <= u < width and not mask[v, u] for v, u in beside):
            points.append((y, x))
    return np.array(points, float)


def boundary_f(a, b, tolerance):
    a, b = outline(a), outline(b)
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    precision = np.mean(distance.min(1) <= tolerance)
    recall = np.mean(distance.min(0) <= tolerance)
    return float(2 * precision * recall / (precision + recall))


def point_segment(p, a, b):
    along = np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
    return np.linalg.norm(p - a - along * (b - a))


def point_triangle(p, a, b, c):
    """Inside the prism over the triangle the height, else the nearest edge."""
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal)
    edges = ((a, b), (b, c), (c, a))
    if area > 1e-12 and all(np.cross(v - u, p - u) @ normal >= 0 for u, v in edges):
        return abs((p - a) @ normal) / area
    return min(point_segment(p, u, v) for u, v in edges)


def surface_distance(estimate, truth, triangles):
    def mean(points, surface):
        return np.mean([min(point_triangle(p, *surface[t]) for t in triangles) for p in points])

    return 500 * float(mean(estimate, truth) + mean(truth, estimate))


def project(camera, x):
    """Pinhole without distortion, of n x 3."""
    return np.stack([camera["fx"] * x[..., 0] / x[..., 2] + camera["cx"],
                     camera["fy"] * x[..., 1] / x[..., 2] + camera["cy"]], -1)


def main():
    data = json.load(sys.stdin)

    def array(name, dtype=float):
        return np.array(data[name], dtype)

    estimate, truth = array("estimate"), array("truth")
    result = joint_errors(estimate, truth, data["left_hip"], data["right_hip"])
    result["jitter"] = second_difference(estimate)
    result["acceleration"] = second_difference(estimate - truth)
    result["bones"] = bone_deviation(estimate, data["bones"])
    result["skate"] = skate(estimate, truth, data["feet"], data["fps"], array("up"),
                            data["max_speed"], data["max_height"])
    offset = project(data["camera"], estimate + array("before_camera"))
    offset = np.linalg.norm(offset - array("pixels"), axis=2)
    result["reprojection"] = float(np.nanmean(offset))
    mask_a, mask_b = array("mask_a", bool), array("mask_b", bool)
    result["iou"] = iou(mask_a, mask_b)
    result["boundary_f"] = boundary_f(mask_a, mask_b, data["tolerance"])
    vertices_e, vertices_t = array("vertices_estimate"), array("vertices_truth")
    moved = vertices_e + (vertices_t - vertices_e).mean((0, 1))  # one translation for the clip
    result["vertex"] = 1000 * float(np.linalg.norm(moved - vertices_t, axis=2).mean())
    result["surface"] = float(np.mean(
        [surface_distance(e, t, array("triangles", int)) for e, t in zip(moved, vertices_t)]))
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
