# SPDX-License-Identifier: Apache-2.0
"""Runs inside Blender: imports a GLB of sweepfit, plays its clips, poses a
joint, and compares the vertices with linear blend skinning computed here from
the bytes of the file.

  blender -b --factory-startup -noaudio -P blender_check.py -- FILE.glb
"""
import json
import math
import struct
import sys

import numpy as np

np.bool = bool  # Blender 3.4's importer needs the name that numpy 1.24 dropped
import bpy  # noqa: E402
from mathutils import Matrix, Quaternion, Vector  # noqa: E402

TOLERANCE = 1e-3  # metres
COMPONENT = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack("<I", data[12:16])[0]
        self.json = json.loads(data[20:20 + length])
        self.bytes = data[28 + length:]

    def view(self, index, dtype, count, width, offset=0):
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0) + offset
        return np.frombuffer(self.bytes, dtype, count * width, start).reshape(count, width)

    def accessor(self, index):
        a = self.json["accessors"][index]
        dtype, width = COMPONENT[a["componentType"]], WIDTH[a["type"]]
        if "bufferView" in a:
            rows = self.view(a["bufferView"], dtype, a["count"], width).copy()
        else:
            rows = np.zeros((a["count"], width), dtype)
        if "sparse" in a:
            s = a["sparse"]
            at = self.view(s["indices"]["bufferView"], COMPONENT[s["indices"]["componentType"]], s["count"], 1)[:, 0]
            rows[at] = self.view(s["values"]["bufferView"], dtype, s["count"], width)
        return rows

    def skinned(self, local, morph):
        """Vertices for node transforms {node: 4x4} over the rest ones."""
        g = self.json
        skin = g["skins"][0]
        primitive = g["meshes"][0]["primitives"][0]
        x = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
        for target, weight in zip(primitive.get("targets", []), morph):
            x += weight * self.accessor(target["POSITION"])
        parent = {c: n for n, node in enumerate(g["nodes"]) for c in node.get("children", [])}

        def world(n):
            own = local.get(n, np.array(Matrix.Translation(g["nodes"][n].get("translation", (0, 0, 0)))))
            return world(parent[n]) @ own if n in parent else own

        inverse_bind = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        motion = np.array([world(n) @ b for n, b in zip(skin["joints"], inverse_bind)])
        joints = self.accessor(primitive["attributes"]["JOINTS_0"])
        weights = self.accessor(primitive["attributes"]["WEIGHTS_0"]).astype(float)
        blended = np.einsum("vi,vijk->vjk", weights, motion[joints])
        return np.einsum("vjk,vk->vj", blended, np.c_[x, np.ones(len(x))])[:, :3]

    def key(self, animation, key):
        """Node transforms and morph weights at one key of a clip."""
        parts, morph = {}, []
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            values = self.accessor(sampler["output"])
            target = channel["target"]
            if target["path"] == "weights":
                count = len(values) // len(self.accessor(sampler["input"]))
                morph = values[key * count:(key + 1) * count, 0]
            else:
                parts.setdefault(target["node"], {})[target["path"]] = values[key]
        local = {}
        for n, p in parts.items():
            t = p.get("translation", self.json["nodes"][n].get("translation", (0, 0, 0)))
            q = p.get("rotation", (0, 0, 0, 1))
            rotation = Quaternion((q[3], q[0], q[1], q[2])).to_matrix().to_4x4()
            local[n] = np.array(Matrix.Translation([float(v) for v in t]) @ rotation)
        return local, morph


def evaluated(mesh_object):
    """Vertices as Blender shows them, in glTF's axes."""
    bpy.context.view_layer.update()
    shown = mesh_object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    world = shown.matrix_world
    points = np.array([world @ v.co for v in shown.data.vertices])
    return np.c_[points[:, 0], points[:, 2], -points[:, 1]]


def distance(a, b):
    """Largest distance between vertices of the same number; the importer keeps
    their order."""
    return np.linalg.norm(a - b, axis=1).max() if len(a) == len(b) else math.inf


def main():
    path = sys.argv[sys.argv.index("--") + 1]
    glb = Glb(path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 120
    bpy.ops.import_scene.gltf(filepath=path)
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    # The importer makes icospheres as bone shapes; the body is the big mesh.
    body = max((o for o in bpy.data.objects if o.type == "MESH"), key=lambda o: len(o.data.vertices))
    names = [glb.json["nodes"][n]["name"] for n in glb.json["skins"][0]["joints"]]
    bones = {b.name for b in armature.data.bones}
    failures = []

    def check(what, holds):
        print(("ok    " if holds else "FAILED") + " " + what)
        if not holds:
            failures.append(what)

    check(f"{len(bones)} bones: 21 joints and {len(names) - 21} helpers", set(names) == bones)
    check(f"{len(bpy.data.actions)} actions", len(bpy.data.actions) >= len(glb.json.get("animations", [])))

    # Every clip at its first, middle and last key. The importer keeps each in
    # an NLA track; played straight from its action, times stay exact.
    animated = [armature.animation_data]
    if body.data.shape_keys:
        animated.append(body.data.shape_keys.animation_data)
    animated = [data for data in animated if data]
    actions = [{t.name: t.strips[0].action for t in data.nla_tracks} for data in animated]
    for data in animated:
        for track in data.nla_tracks:
            track.mute = True
    for clip in glb.json.get("animations", []):
        for data, by_name in zip(animated, actions):
            data.action = by_name.get(clip["name"])
        times = glb.accessor(clip["samplers"][0]["input"])[:, 0]
        largest = 0
        for key in sorted({0, len(times) // 2, len(times) - 1}):
            frame = float(times[key]) * bpy.context.scene.render.fps
            bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
            largest = max(largest, distance(evaluated(body), glb.skinned(*glb.key(clip, key))))
        check(f"clip {clip['name']}: {1000 * largest:.3f} mm from our skinning", largest < TOLERANCE)
    for data in animated:
        data.action = None

    # Single joints, posed by hand, helpers at rest.
    bpy.context.scene.frame_set(0)
    for bone in armature.pose.bones:
        bone.matrix_basis = Matrix()
    if body.data.shape_keys:
        for block in body.data.shape_keys.key_blocks:
            block.value = 0
    nodes = {node["name"]: n for n, node in enumerate(glb.json["nodes"])}
    joints = [glb.json["nodes"][n]["name"] for n in range(21)]
    for index in (5, 6, 14, 1):  # left shoulder, elbow, knee; spine
        name = joints[index]
        turn = Quaternion(Vector((0.3, 0.8, 0.5)).normalized(), 0.9)
        bone = armature.pose.bones[name]
        # The importer turns bones; the rotation is given in glTF's axes, which
        # are those of the armature turned about x.
        y_up = Matrix.Rotation(math.pi / 2, 4, "X")
        rest = bone.bone.matrix_local.to_3x3().to_4x4()
        wanted = y_up @ turn.to_matrix().to_4x4() @ y_up.inverted()
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = (rest.inverted() @ wanted @ rest).to_quaternion()
        node = nodes[name]
        offset = Matrix.Translation(glb.json["nodes"][node].get("translation", (0, 0, 0)))
        local = {node: np.array(offset @ turn.to_matrix().to_4x4())}
        largest = distance(evaluated(body), glb.skinned(local, []))
        check(f"{name} posed: {1000 * largest:.3f} mm from our skinning", largest < TOLERANCE)
        bone.matrix_basis = Matrix()
    print(f"{len(failures)} checks failed")
    sys.exit(1 if failures else 0)


try:
    main()
except Exception:  # Blender would end with status 0
    import traceback
    traceback.print_exc()
    sys.exit(1)
