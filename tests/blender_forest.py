"""Imports a forest as a user does and prints what is there: blender -b -P tests/blender_forest.py -- FILE."""

import json
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[sys.argv.index("--") + 1], import_shading="SMOOTH")
shown = [o for o in bpy.data.objects if o.type == "MESH"]
print(
    "FOREST "
    + json.dumps(
        {
            "objects": sorted(o.name for o in shown),
            "meshes": len(bpy.data.meshes),
            "materials": sorted(m.name for m in bpy.data.materials),
            "triangles": sum(len(m.polygons) for m in bpy.data.meshes),
            "heights": [o.location[2] for o in shown if o.name != "ground"],
            "actions": len(bpy.data.actions),
            "shape_keys": max((len(m.shape_keys.key_blocks) for m in bpy.data.meshes if m.shape_keys), default=0),
        }
    )
)
