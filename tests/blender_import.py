"""Imports a model as a user does and prints what is there: blender -b -P tests/blender_import.py -- FILE."""

import json
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.fps = 30
# Debian's Blender 3.4 falls over its numpy where it is to guess from the normals which faces are flat (np.bool).
bpy.ops.import_scene.gltf(filepath=sys.argv[sys.argv.index("--") + 1], import_shading="SMOOTH")
armatures = [o for o in bpy.data.objects if o.type == "ARMATURE"]
meshes = [o for o in bpy.data.objects if o.type == "MESH" and o.find_armature() is not None]
print(
    "IMPORTED "
    + json.dumps(
        {
            "armatures": sorted(a.name for a in armatures),
            "actions": sorted(a.name for a in bpy.data.actions),
            "empties": sorted(o.name for o in bpy.data.objects if o.type == "EMPTY"),
            "bones": sorted(b.name for a in armatures for b in a.data.bones),
            "meshes": sorted(o.name for o in meshes),
            "triangles": sum(len(o.data.loop_triangles) or len(o.data.polygons) for o in meshes),
            "shape_keys": sum(len(o.data.shape_keys.key_blocks) for o in meshes if o.data.shape_keys),
            "end_s": max((a.frame_range[1] for a in bpy.data.actions), default=0.0) / 30,
            "materials": sorted(m.name for m in bpy.data.materials),
        }
    )
)
