#!/usr/bin/env python3
"""Writes src/recording/foxglove/*.bin anew: the published protobuf schemas of Foxglove (MIT) as FileDescriptorSets.

Needed only to follow a new version of them: pip install foxglove-schemas-protobuf
"""
import importlib
from pathlib import Path

from google.protobuf import descriptor_pb2

NAMES = ["CompressedImage", "RawImage", "ImageAnnotations", "SceneUpdate", "FrameTransforms"]
OUT = Path(__file__).resolve().parent.parent / "src/recording/foxglove"


def collect(descriptor, into, seen):
    """Imports before the files that import them, as every reader expects."""
    if descriptor.name in seen:
        return
    seen.add(descriptor.name)
    for imported in descriptor.dependencies:
        collect(imported, into, seen)
    descriptor.CopyToProto(into.file.add())


for name in NAMES:
    module = importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2")
    files = descriptor_pb2.FileDescriptorSet()
    collect(module.DESCRIPTOR, files, set())
    (OUT / f"{name}.bin").write_bytes(files.SerializeToString(deterministic=True))
