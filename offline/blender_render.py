"""One pass of Cycles over the stage, and what it wrote."""

from pathlib import Path

import bpy
import numpy as np

from offline.raw_files import read_exr
from offline.settings import CyclesSettings

LAYER = "ViewLayer"


def prepare(settings: CyclesSettings) -> None:
    """The settings of Blender's scene that stay for all passes of a frame."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.shading_system = True
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.light_sampling_threshold = 0
    cycles.use_fast_gi = False
    bounces = settings.max_bounces + 1  # the shader itself stops after max_bounces
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = (
        bounces
    )
    cycles.transparent_max_bounces = 128
    cycles.seed = settings.seed
    cycles.use_auto_tile, cycles.tile_size = True, settings.tile
    cycles.denoiser = "OPENIMAGEDENOISE"
    scene.render.use_persistent_data = True
    scene.render.threads_mode = "FIXED" if settings.threads else "AUTO"
    if settings.threads:
        scene.render.threads = settings.threads
    scene.view_settings.view_transform = "Raw"
    image = scene.render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    layer = scene.view_layers[0]
    assert layer.name == LAYER
    layer.use_pass_position = layer.use_pass_emit = True


def trace(path: Path, samples: int, noise: float = 0.0, denoise: bool = False) -> dict[str, np.ndarray]:
    """``Combined``, ``Emission`` and ``Position``, (H, W, 3) each."""
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = noise > 0
    scene.cycles.adaptive_threshold = noise
    scene.cycles.use_denoising = denoise
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    path.unlink()
    found = {}
    for name, letters in (("Combined", "RGB"), ("Emission", "RGB"), ("Position", "XYZ")):
        found[name] = np.stack([channels[f"{LAYER}.{name}.{c}"] for c in letters], axis=-1)
    return found
