#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits captures pose by pose and checks what comes out; see accuracy.sh."""
import argparse
import json
import os
import re
import struct
import subprocess
import sys

import numpy as np
import yaml

# Bars: the most (or least) that a fit may show.
MAX_SECONDS = 20
MAX_MEGABYTES = 3072
MAX_MPJPE = 32  # mm, all joints
MAX_LIMBS = 25  # mm
MAX_SURFACE = 5  # mm, both ways
MIN_HOLDOUT_IOU = 0.955
MIN_FIT_IOU_WITHOUT_TRUTH = 0.80  # captures that only have silhouettes

COLUMNS = [
    ("capture", "%-14s"), ("pose", "%-6s"), ("seconds", "%.1f"), ("MB", "%.0f"),
    ("MPJPE", "%.1f"), ("limbs", "%.1f"), ("to truth", "%.1f"),
    ("from truth", "%.1f"), ("IoU fit", "%.3f"), ("IoU hold", "%.3f"),
    ("px fit", "%.2f"), ("px hold", "%.2f"), ("gltf", "%s"), ("closed", "%s"),
    ("missed", "%s")]

VALIDATE = """
const fs = require('fs');
require(process.argv[1] + '/node_modules/gltf-validator')
  .validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))
  .then(r => console.log(r.issues.numErrors + '/' + r.issues.numWarnings))
  .catch(e => { console.log('invalid'); });
"""


def run_fit(sweepfit, capture, pose, result):
    """Exit status, seconds, megabytes and what was said."""
    command = ["/usr/bin/time", "-v", sweepfit, "fit", capture, "--poses", pose,
               "--out", result]
    done = subprocess.run(command, capture_output=True, text=True)
    said = done.stderr
    wall = re.search(r"Elapsed .*: (?:(\d+):)?(\d+):([\d.]+)\n", said)
    hours, minutes, seconds = (float(x or 0) for x in wall.groups())
    kilobytes = float(re.search(r"Maximum resident.*: (\d+)", said).group(1))
    return (done.returncode, 3600 * hours + 60 * minutes + seconds,
            kilobytes / 1024, said)


def own_scores(sweepfit, capture, pose, result):
    """Scores by `sweepfit evaluate`, in mm and pixels."""
    out = os.path.join(result, "..", os.path.basename(result) + ".json")
    command = [sweepfit, "evaluate", result, "--capture", capture, "--json", out]
    if os.path.isdir(os.path.join(capture, "truth", pose)):
        command.append("--truth")
    subprocess.run(command, check=True, capture_output=True)
    with open(out) as file:
        doc = json.load(file)["poses"][pose]
    row = {}
    if "joints" in doc:
        row["MPJPE"] = 1000 * doc["joints"]["mpjpe"]
        row["limbs"] = 1000 * doc["joints"]["limb_mpjpe"]
    if "surface" in doc:
        row["to truth"] = 1000 * doc["surface"]["fit_to_truth"]["mean"]
        row["from truth"] = 1000 * doc["surface"]["truth_to_fit"]["mean"]
    for group, name in (("fit", "fit"), ("holdout", "hold")):
        if group in doc["silhouette"]:
            row["IoU " + name] = doc["silhouette"][group]["iou"]
            row["px " + name] = doc["silhouette"][group]["boundary_mean"]
    return row


def independent_scores(capture, pose, result):
    """The same by eval/score.py beside the captures; None where it is not."""
    folder = os.path.dirname(os.path.abspath(capture))
    while folder != "/" and os.path.basename(folder) != "captures":
        folder = os.path.dirname(folder)
    program = os.path.join(os.path.dirname(folder), "eval", "score.py")
    if folder == "/" or not os.path.exists(program):
        return None
    done = subprocess.run([sys.executable, program, capture, result, "--pose",
                           pose, "--json"], check=True, capture_output=True)
    doc = json.loads(done.stdout)["poses"][pose]
    row = {}
    if "joints" in doc:
        row["MPJPE"] = doc["joints"]["mpjpe"]
        row["limbs"] = doc["joints"]["limb_mpjpe"]
    if "surface" in doc:
        row["to truth"] = doc["surface"]["fit_to_truth"]["mean"]
        row["from truth"] = doc["surface"]["truth_to_fit"]["mean"]
    for group, name in (("fit", "fit"), ("holdout", "hold")):
        if group in doc["silhouette"]:
            row["IoU " + name] = doc["silhouette"][group]["iou"]
            row["px " + name] = doc["silhouette"][group]["boundary_mean"]
    return row


def validate_gltf(validator, path):
    """Errors and warnings of the Khronos validator as "0/0"."""
    done = subprocess.run(
        ["node", "-e", VALIDATE, os.path.abspath(validator), path],
        capture_output=True, text=True)
    return done.stdout.strip() or "failed"


def is_closed(vertices, triangles):
    """One component, every edge run once each way, Euler characteristic 2."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    directed = np.sort(edges[:, 0] * len(vertices) + edges[:, 1])
    reverse = np.sort(edges[:, 1] * len(vertices) + edges[:, 0])
    if (np.diff(directed) == 0).any() or not np.array_equal(directed, reverse):
        return False
    used = len(np.unique(triangles))
    label = np.arange(len(vertices))
    while True:  # components: spread the smallest label
        least = label[triangles].min(1)
        new = label.copy()
        for k in range(3):
            np.minimum.at(new, triangles[:, k], least)
        if np.array_equal(new, label):
            break
        label = new
    one = len(np.unique(label[np.unique(triangles)])) == 1
    return one and used - len(edges) // 2 + len(triangles) == 2


def read_ply(path):
    """Vertices and triangles of a binary PLY as sweepfit writes it."""
    with open(path, "rb") as file:
        raw = file.read()
    start = raw.index(b"end_header\n") + len(b"end_header\n")
    header = raw[:start].decode()
    num_vertices = int(re.search(r"element vertex (\d+)", header).group(1))
    num_faces = int(re.search(r"element face (\d+)", header).group(1))
    properties = header.split("element face")[0].count("property float")
    vertices = np.frombuffer(raw, "<f4", num_vertices * properties, start)
    vertices = vertices.reshape(-1, properties)[:, :3]
    faces = np.frombuffer(raw, [("n", "u1"), ("v", "<i4", 3)], num_faces,
                          start + 4 * num_vertices * properties)
    return vertices, faces["v"].astype(int)


def read_glb(path):
    """Vertices, welded where positions are equal, and triangles of a GLB."""
    with open(path, "rb") as file:
        raw = file.read()
    length = struct.unpack_from("<I", raw, 12)[0]
    doc = json.loads(raw[20:20 + length])
    blob = raw[20 + length + 8:]

    def accessor(index):
        a = doc["accessors"][index]
        view = doc["bufferViews"][a["bufferView"]]
        kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[a["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[a["type"]]
        at = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        stride = view.get("byteStride", np.dtype(kind).itemsize * width)
        return np.ndarray((a["count"], width), kind, blob, at,
                          (stride, np.dtype(kind).itemsize))
    vertices, triangles = [], []
    for mesh in doc["meshes"]:
        for primitive in mesh["primitives"]:
            offset = sum(map(len, vertices))
            vertices.append(accessor(primitive["attributes"]["POSITION"]))
            triangles.append(
                accessor(primitive["indices"]).reshape(-1, 3).astype(int) + offset)
    welded, label = np.unique(np.vstack(vertices), axis=0, return_inverse=True)
    return welded, label.reshape(-1)[np.vstack(triangles)]


def missed_bars(row):
    """Names of the bars that this row misses."""
    def above(key, bar):
        return [key] if row.get(key, 0) > bar else []
    missed = above("seconds", MAX_SECONDS) + above("MB", MAX_MEGABYTES)
    missed += above("MPJPE", MAX_MPJPE) + above("limbs", MAX_LIMBS)
    missed += above("to truth", MAX_SURFACE) + above("from truth", MAX_SURFACE)
    if row.get("IoU hold", 1) < MIN_HOLDOUT_IOU:
        missed.append("IoU hold")
    if "MPJPE" not in row and row.get("IoU fit", 0) < MIN_FIT_IOU_WITHOUT_TRUTH:
        missed.append("IoU fit")
    if row["gltf"] != "0/0":
        missed.append("gltf")
    if row["closed"] != "yes":
        missed.append("closed")
    return missed


def show(row):
    cells = []
    for name, form in COLUMNS:
        value = row.get(name)
        text = "-" if value is None else form % value
        cells.append(text.ljust(max(len(name), 6)))
    print("  ".join(cells).rstrip(), flush=True)


def fit_row(arguments, capture, pose):
    """Everything about one fit; None and a line on stderr if it failed."""
    name = os.path.basename(capture)
    result = os.path.join(arguments.out, "%s_%s" % (name, pose))
    status, seconds, megabytes, said = run_fit(
        arguments.sweepfit, capture, pose, result)
    row = {"capture": name, "pose": pose, "seconds": seconds, "MB": megabytes,
           "gltf": "-", "closed": "-"}
    if status != 0:
        row["missed"] = "exit status %d" % status
        error = [s for s in said.splitlines() if s.startswith("sweepfit: error")]
        print("\n".join(error) or said, file=sys.stderr)
        return row, None
    own = own_scores(arguments.sweepfit, capture, pose, result)
    row.update(own)
    row["gltf"] = validate_gltf(arguments.validator,
                                os.path.join(result, "model.glb"))
    closed = (is_closed(*read_ply(os.path.join(result, "mesh_%s.ply" % pose))) and
              is_closed(*read_glb(os.path.join(result, "model.glb"))))
    row["closed"] = "yes" if closed else "no"
    missed = missed_bars(row)
    other = independent_scores(capture, pose, result)
    if other is not None:
        missed += [m + " (independent)" for m in missed_bars({**row, **other})
                   if m not in missed]
    row["missed"] = ", ".join(missed)
    return row, other


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sweepfit", required=True)
    parser.add_argument("--validator", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("captures", nargs="+")
    arguments = parser.parse_args()
    os.makedirs(arguments.out, exist_ok=True)
    print("  ".join(name.ljust(max(len(name), 6)) for name, _ in COLUMNS))
    failed = 0
    for capture in arguments.captures:
        with open(os.path.join(capture, "capture.yaml")) as file:
            poses = [str(p["name"]) for p in yaml.safe_load(file)["poses"]]
        for pose in poses:
            row, other = fit_row(arguments, capture, pose)
            show(row)
            if other is not None:
                show({"capture": "  independent", **other})
            # How long a fit takes depends on the machine: it is shown, but a
            # busy machine does not make a fit wrong.
            failed += row["missed"] not in ("", "seconds")
    print("\nErrors in mm, boundaries (px) in pixels, gltf errors/warnings.")
    print("%d fits miss a bar." % failed if failed else "All bars are met.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
