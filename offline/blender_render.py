"""One pass of Cycles over the stage, and what it wrote."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from offline.raw_files import read_exr
from offline.settings import CyclesSettings

LAYER = "ViewLayer"
MOST_SAMPLES = 2**20


def prepare(settings: CyclesSettings) -> None:
    """The settings of Blender's scene that stay for all passes of a frame."""
    scene = bpy.context.scene
    bounces = settings.max_bounces + 1  # the shader itself stops after max_bounces
    _set(scene.render, engine="CYCLES", use_persistent_data=True, film_transparent=True)
    _set(
        scene.cycles, device="CPU", shading_system=True, pixel_filter_type="BOX", filter_width=1.0,
        sample_clamp_direct=0.0, sample_clamp_indirect=0.0, blur_glossy=0.0, light_sampling_threshold=0.0,
        caustics_reflective=True, caustics_refractive=True, use_fast_gi=False, transparent_max_bounces=128,
        max_bounces=bounces, diffuse_bounces=bounces, glossy_bounces=bounces, transmission_bounces=bounces,
        seed=settings.seed, use_auto_tile=True, tile_size=settings.tile, denoiser="OPENIMAGEDENOISE",
    )  # fmt: skip
    preferences = bpy.context.preferences  # which hide the pattern that needs no tables
    _set(preferences.experimental, use_cycles_debug=True)
    _set(preferences.view, show_developer_ui=True)
    _set(scene.cycles, sampling_pattern="SOBOL_BURLEY")
    _set(scene.render, threads_mode="FIXED" if settings.threads else "AUTO")
    if settings.threads:
        _set(scene.render, threads=settings.threads)
    _set(scene.view_settings, view_transform="Raw")
    _set(scene.render.image_settings, media_type="MULTI_LAYER_IMAGE")
    _set(scene.render.image_settings, file_format="OPEN_EXR_MULTILAYER", color_depth="32", exr_codec="NONE")
    # in parts, headers disagree on sides of pixels that differ, and Blender 5.0 saves nothing
    _set(scene.render.image_settings, use_exr_interleave=True)
    _set(scene.view_layers[0], name=LAYER, use_pass_position=True, use_pass_emit=True)


def _set(owner: Any, **values: Any) -> None:
    """Assign what differs: Blender takes many an assignment for a change, and compiles all shaders anew.

    Of Cycles' own settings it takes none for a change, so it is told.
    """
    for name, value in values.items():
        if getattr(owner, name) != value:
            setattr(owner, name, value)
            bpy.context.scene.update_tag()


def trace(path: Path, samples: int, noise: float = 0.0, denoise: bool = False) -> dict[str, np.ndarray]:
    """``Combined``, ``Emission`` and ``Position``, (H, W, 3) each, and ``Alpha`` (H, W, 1), what is not background."""
    scene = bpy.context.scene
    # the random pattern depends on the number of samples, and on earlier ones: so take the first of always as many
    _set(
        scene.cycles,
        samples=MOST_SAMPLES,
        use_sample_subset=True,
        sample_offset=0,
        sample_subset_length=samples,
    )
    _set(scene.cycles, use_adaptive_sampling=noise > 0, use_denoising=denoise)
    if noise > 0:
        _set(scene.cycles, adaptive_threshold=noise)
    _set(scene.render, filepath=str(path))
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    path.unlink()
    found = {}
    for name, letters in (("Combined", "RGB"), ("Emission", "RGB"), ("Position", "XYZ")):
        found[name] = np.stack([channels[f"{LAYER}.{name}.{c}"] for c in letters], axis=-1)
    found["Alpha"] = channels[f"{LAYER}.Combined.A"][..., None]
    return found
