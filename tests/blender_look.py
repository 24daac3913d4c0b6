"""Renders the crown of a model as a user sees it first: blender -b -P tests/blender_look.py -- FILE [PICTURE].

Prints the mean colour (linear, 1 is white) of the leaves that are seen from the front and from the back by day, and the
share of the picture that they cover. Only what the file says is used: no material is touched.
"""

import json
import math
import os
import sys
import tempfile

import bpy
import numpy
from mathutils import Vector

SIDE_PX = 160
SAMPLES = 16

arguments = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
# Debian's Blender 3.4 asks for a name that its numpy no longer has, where it reads normals.
if not hasattr(numpy, "bool"):
    numpy.bool = bool
bpy.ops.import_scene.gltf(filepath=arguments[0])
leaves = [o for o in bpy.data.objects if o.type == "MESH" and o.name.startswith("leaves")]
# Wood casts its shadow and is not looked at, nor is what the importer adds to show bones.
for other in (o for o in bpy.data.objects if o.type == "MESH" and o not in leaves):
    other.visible_camera = False
    other.hide_render = other.find_armature() is None

# Leaves are taken at rest, as the file has them.
for armature in (o for o in bpy.data.objects if o.type == "ARMATURE"):
    armature.data.pose_position = "REST"
bpy.context.view_layer.update()
corners = [o.matrix_world @ Vector(c) for o in leaves for c in o.bound_box]
low, high = (Vector(f(c[k] for c in corners) for k in range(3)) for f in (min, max))
middle, size = (low + high) / 2, max(high - low)

scene.world = bpy.data.worlds.new("sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy = 2.0
scene.collection.objects.link(sun)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.type = "ORTHO"
camera.data.ortho_scale = 1.05 * size
camera.data.clip_end = 10 * size
scene.collection.objects.link(camera)
scene.camera = camera

scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.samples = SAMPLES
scene.cycles.use_denoising = False
scene.render.film_transparent = True
scene.render.resolution_x = scene.render.resolution_y = SIDE_PX
scene.render.image_settings.file_format = "OPEN_EXR"


def mean_colour(turn, picture):
    """Mean colour of what is seen from `turn` about the upright axis; the sun stands behind the viewer's left shoulder."""
    camera.location = middle + Vector((math.sin(turn), -math.cos(turn), 0)) * 3 * size
    camera.rotation_euler = (math.pi / 2, 0, turn)
    sun.rotation_euler = (math.radians(50), 0, turn - math.radians(35))
    scene.render.filepath = picture
    bpy.ops.render.render(write_still=True)
    pixels = list(bpy.data.images.load(picture).pixels)
    cover = sum(pixels[3::4])
    red, green, blue = (sum(pixels[k::4]) / max(cover, 1e-9) for k in range(3))
    return {"red": red, "green": green, "blue": blue, "cover": cover / SIDE_PX**2}


with tempfile.TemporaryDirectory() as folder:
    looks = {
        name: mean_colour(turn, os.path.join(folder, name + ".exr")) for name, turn in (("front", 0.0), ("back", math.pi))
    }
    print("LOOKS " + json.dumps(looks))
if len(arguments) > 1:
    scene.render.image_settings.file_format = "PNG"
    scene.render.resolution_x = scene.render.resolution_y = 600
    camera.location = middle + Vector((0, -1, 0)) * 3 * size
    camera.rotation_euler = (math.pi / 2, 0, 0)
    sun.rotation_euler = (math.radians(50), 0, -math.radians(35))
    scene.render.filepath = arguments[1]
    bpy.ops.render.render(write_still=True)
