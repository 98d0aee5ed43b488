"""Imports FOLDER/performance.glb and FOLDER/motion.bvh with the importers' defaults, and puts
FOLDER/surface.pc2 on the imported mesh; compares what Blender shows with FOLDER/expected.json (y up,
metres). Prints one line per figure; exits with
1 when a figure is above its limit.

    blender -b -P check_in_blender.py -- FOLDER
"""
import json
import os
import sys

import bpy
import io_anim_bvh.import_bvh
import mathutils
import numpy

# Debian 12's Blender 3.4 is older than its Python and numpy: the glTF importer uses a name that
# numpy 1.24 dropped, the BVH importer a mode of open() that Python 3.11 dropped.
if 'bool' not in vars(numpy):
    numpy.bool = bool
io_anim_bvh.import_bvh.open = lambda path, mode: open(path, mode.replace('U', ''))

LIMIT_M = 1e-4


def from_y_up(x):
    """Blender is z up: the importers turn (x, y, z) to (x, -z, y)."""
    return mathutils.Vector((x[0], -x[2], x[1]))


def start(fps):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = fps


def armature():
    found = [o for o in bpy.context.scene.objects if o.type == 'ARMATURE']
    assert len(found) == 1, 'expected one armature, found %d' % len(found)
    return found[0]


def worst_head(names, heads_of_frames, first_frame=0):
    """Largest distance of a bone's head from its expected place, over all frames."""
    rig = armature()
    worst = (0.0, '')
    for frame, heads in enumerate(heads_of_frames):
        bpy.context.scene.frame_set(first_frame + frame)
        for name, head in zip(names, heads):
            shown = rig.matrix_world @ rig.pose.bones[name].head
            worst = max(worst, ((shown - from_y_up(head)).length, '%s at %d' % (name, frame)))
    return worst


def skinned_mesh():
    meshes = [o for o in bpy.context.scene.objects
              if o.type == 'MESH' and any(m.type == 'ARMATURE' for m in o.modifiers)]
    assert len(meshes) == 1, 'expected one skinned mesh, found %d' % len(meshes)
    return meshes[0]


def worst_vertex(obj, expected):
    """Largest distance of a vertex from its expected place, over the frames given."""
    worst = 0.0
    for frame in expected:
        bpy.context.scene.frame_set(frame['frame'])
        shown = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = shown.to_mesh()
        assert len(mesh.vertices) == len(frame['positions'])
        worst = max(worst, max((shown.matrix_world @ v.co - from_y_up(x)).length
                               for v, x in zip(mesh.vertices, frame['positions'])))
    return worst


def put_cache_on(obj, path):
    """As docs/outputs.md tells: alone in the scene, the cache in place of the armature."""
    obj.parent = None
    obj.matrix_world = mathutils.Matrix.Identity(4)
    obj.modifiers.clear()
    cache = obj.modifiers.new('surface', 'MESH_CACHE')
    cache.cache_format = 'PC2'
    cache.filepath = path
    # The modifier turns the other way round than the importers: this makes (x, y, z) (x, -z, y).
    cache.forward_axis = 'POS_Z'
    cache.up_axis = 'NEG_Y'
    cache.frame_start = 0


def main(folder):
    with open(os.path.join(folder, 'expected.json')) as file:
        expected = json.load(file)
    ok = True

    def report(what, value, limit, place=''):
        nonlocal ok
        ok = ok and value <= limit
        print('CHECK %s %.3g limit %.3g %s %s' %
              (what, value, limit, place, 'ok' if value <= limit else 'TOO LARGE'))

    start(expected['fps'])
    bpy.ops.import_scene.gltf(filepath=os.path.join(folder, 'performance.glb'))
    worst = worst_head(expected['bones'], expected['bone_heads'])
    report('glb_head_m', worst[0], LIMIT_M, worst[1])
    mesh = skinned_mesh()
    report('glb_vertex_m', worst_vertex(mesh, expected['vertices']), LIMIT_M)
    camera = [o for o in bpy.context.scene.objects if o.type == 'CAMERA'][0]
    report('glb_camera_m', (camera.matrix_world.translation -
                            from_y_up(expected['camera'])).length, LIMIT_M)
    report('glb_camera_forward',
           (camera.matrix_world.to_3x3() @ mathutils.Vector((0, 0, -1)) -
            from_y_up(expected['camera_forward'])).length, 1e-5)
    put_cache_on(mesh, os.path.join(folder, 'surface.pc2'))
    report('pc2_vertex_m', worst_vertex(mesh, expected['vertices']), LIMIT_M)

    start(expected['fps'])
    bpy.ops.import_anim.bvh(filepath=os.path.join(folder, 'motion.bvh'))
    worst = worst_head(expected['segments'], expected['segment_heads'], first_frame=1)
    report('bvh_head_m', worst[0], LIMIT_M, worst[1])
    print('CHECK done')
    return ok


try:
    sys.exit(0 if main(sys.argv[sys.argv.index('--') + 1]) else 1)
except Exception as error:  # Blender would exit with 0
    print('CHECK failed: %r' % error)
    sys.exit(1)
