"""What a file holds, as plain data: words, numbers, lists and tables, under names that end in their unit.

One function a kind of file; ``composer.commands.info`` prints what they return, or writes it as JSON.
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from composer.aligned import Description
from composer.camera_effects import camera_effects, words
from interchange.camera import Camera, Projection
from interchange.colorimetry import chromaticity, luminous_efficacy, xyz
from interchange.distortion import NAMES
from interchange.formats import exr, images, photometry, radial_profile
from interchange.formats.base import Options
from interchange.formats.document import Document, format_of, open_scene
from interchange.formats.exr_header import read_header, size
from interchange.formats.exr_pixels import read_channels
from interchange.formats.luminous_intensity import Photometry, full_angle
from interchange.image import Quantity
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.measurement import Kind, Measurement
from interchange.parameter import parameters, settings
from interchange.power import emitted_power
from interchange.problems import FileError, Problem, Severity
from interchange.reflectance import ReflectanceSamples
from interchange.scene import Body, Scene
from interchange.spectrum import from_measurement

INTENSITY_UNIT = {LightKind.DISTANT: "W/m²", LightKind.DOME: "W/(m² sr)"}  # all others: W/sr


def describe(path: Path | str, options: Options = Options()) -> Description:  # noqa: B008  # frozen
    """Plain data about a file of any kind. Raises FileError where the file cannot be read at all."""
    path = Path(path)
    kind = format_of(path)
    head: Description = {"file": str(path), "format": kind.name, "size_bytes": path.stat().st_size}
    match kind.holds:
        case "scene":
            return head | _document(open_scene(path, options))
        case "image" if path.suffix.lower() == ".exr" or kind.name == exr.Exr.name:
            return head | _exr(path)
        case "image":
            return head | _picture(images.load(path))
        case "photometry":
            return head | _photometry(photometry.load(path))
        case _:
            found = kind.read(path, options)
            if isinstance(found, Measurement) and radial_profile.is_radial(found):
                return head | _radial(photometry.load(path))
            return head | _measurement(found)


def _document(document: Document) -> Description:
    stage = document.stage
    problems = [*document.problems, *document.scene_problems()]
    found: Description = {
        "metres_per_unit": stage.GetMetadata("metersPerUnit"),
        "up_axis": str(stage.GetMetadata("upAxis")),
    }
    if not any(p.severity is Severity.ERROR for p in problems):
        times = document.times
        found |= {"frames": len(times), "first_time": times[0], "last_time": times[-1]}
        found |= _scene(document.scene(), stage)
    else:
        found["tree"] = _tree(stage, ())
    return found | {"problems": _problems(problems)}


def _scene(scene: Scene, stage: Any) -> Description:
    low, high = np.round(1000 * scene.bounds, 6) + 0.0  # to a nanometre: less is rounding
    materials = {id(b.material): b.material for b in scene.bodies}
    return {
        "size_mm": list(high - low),
        "lowest_corner_mm": list(low),
        "objects": len(scene.object_names),
        "triangles": sum(len(b.mesh.faces) for b in scene.bodies),
        "tree": _tree(stage, scene.bodies),
        "materials": [_material(m) for m in materials.values()],
        "lights": [_light(x) for x in scene.lights],
        "cameras": [_camera(c) for c in scene.cameras],
    }


def _tree(stage: Any, bodies: Iterable[Body]) -> list[Description]:
    """One row a prim: depth, name, type; triangles, extent and materials of the surfaces at it and below."""
    triangles: dict[str, int] = {}
    corners: dict[str, list[np.ndarray]] = {}
    names: dict[str, dict[str, None]] = {}
    for body in bodies:
        points = body.mesh.vertices @ body.world_from_body[:3, :3].T + body.world_from_body[:3, 3]
        box = np.stack([points.min(0), points.max(0)]) if len(points) else np.zeros((0, 3))
        path = body.name.split("[")[0]
        while path:
            triangles[path] = triangles.get(path, 0) + len(body.mesh.faces)
            corners.setdefault(path, []).append(box)
            names.setdefault(path, {})[body.material.name.rsplit("/", 1)[-1]] = None
            path = path.rsplit("/", 1)[0]
    rows: list[Description] = []
    stack = [(prim, 0) for prim in reversed(stage.GetPseudoRoot().GetChildren())]
    while stack:
        prim, depth = stack.pop()
        path, row = (
            str(prim.GetPath()),
            {"depth": depth, "name": prim.GetName(), "type": str(prim.GetTypeName())},
        )
        row["type"] += " (instance)" if prim.IsInstance() else ""
        if path in triangles:
            both = np.concatenate(corners[path])
            materials = list(names[path])
            row["triangles"] = triangles[path]
            row["size_mm"] = list(1000 * np.ptp(both, axis=0)) if len(both) else None
            row["material"] = materials[0] if len(materials) == 1 else f"{len(materials)} materials"
        rows.append(row)
        stack += [(child, depth + 1) for child in reversed(prim.GetChildren())]
    return rows


def _material(material: Material) -> Description:
    brdf = material.brdf
    found: Description = {"name": material.name, "brdf": "GLSL" if material.glsl else type(brdf).__name__}
    for name in parameters(brdf):
        texture = material.maps.get(name)
        value = getattr(brdf, name)
        found[name] = (
            Path(texture.file).name if texture else list(value) if isinstance(value, tuple) else value
        )
    if material.normal_map:
        found["normal_map"] = Path(material.normal_map.file).name
    if material.emission_map or any(material.emission):
        texture = material.emission_map
        found["emission"] = Path(texture.file).name if texture else list(material.emission)
    if material.opacity_map or material.opacity != 1:
        found["opacity"] = Path(material.opacity_map.file).name if material.opacity_map else material.opacity
    return found


def _light(light: Light) -> Description:
    sizes = {
        LightKind.SPHERE: ("radius",),
        LightKind.DISK: ("radius",),
        LightKind.RECT: ("width", "height"),
        LightKind.CYLINDER: ("radius", "length"),
    }.get(light.kind, ())
    shaped = []
    if light.cone_angle < np.pi:
        shaped.append(f"cone ±{np.degrees(light.cone_angle):g}°")
    if light.focus:
        shaped.append(f"focus {light.focus:g}")
    if light.profile:
        shaped.append(f"profile {Path(light.profile.file).name}")
    if light.projector:
        width, height = light.projector.resolution
        shaped.append(f"projects {Path(light.projector.image.file).name}, {width} x {height} px")
    if light.visible:
        shaped.append("seen by the camera")
    if light.texture:
        shaped.append(f"texture {Path(light.texture.file).name}")
    if light.kind is LightKind.DISTANT and light.angle:
        shaped.append(f"angle {np.degrees(light.angle):g}°")
    placed = light.kind not in (LightKind.DISTANT, LightKind.DOME)
    return {
        "name": light.name,
        "kind": light.kind.value,
        "intensity": list(light.intensity),
        "unit": INTENSITY_UNIT.get(light.kind, "W/sr"),
        "power_W": list(emitted_power(light)) if placed else None,
        "extent_mm": {name: 1000 * getattr(light, name) for name in sizes},
        "position_mm": list(np.round(1000 * light.world_from_light[:3, 3], 6) + 0.0) if placed else None,
        "shaping": ", ".join(shaped),
        "strobe": words(light.strobe) if light.strobe.is_there else "",
    }


def _camera(camera: Camera) -> Description:
    (width, height), (px, py) = camera.sensor.resolution, camera.sensor.pixel_pitch
    sides = np.array([width * px, height * py])
    lens = camera.lens
    found: Description = {"name": camera.name, "resolution_px": [width, height]}
    if lens.projection is Projection.PERSPECTIVE:
        found["focal_length_mm"] = 1000 * lens.focal_length
        found["field_of_view_deg"] = list(np.degrees(2 * np.arctan(sides / 2 / lens.focal_length)))
    else:
        found["projection"] = "orthographic"
        found["field_of_view_mm"] = list(1000 * sides)
    found["pixel_pitch_um"] = [1e6 * px, 1e6 * py]
    found["f_number"] = lens.f_stop or "pinhole"
    found["position_mm"] = list(np.round(1000 * camera.world_from_camera[:3, 3], 6) + 0.0)
    found["looks_along"] = list(camera.world_from_camera[:3, 2])
    if lens.distorts:
        found["lens_model"] = lens.model.value
        found["distortion"] = dict(zip(NAMES[lens.model], lens.distortion, strict=False))
    found["bit_depth"] = camera.sensor.bit_depth
    found["exposure_s"] = camera.t_exp
    return found | camera_effects(camera)


def _exr(path: Path) -> Description:
    header = read_header(path)
    found: Description = {
        "resolution_px": list(header.resolution),
        "packing": header.compression,
        "storage": header.storage,
    }
    if header.data_window != header.display_window:
        found["data_window_px"] = list(header.data_window)
        found["data_size_px"] = list(size(header.data_window))
    if len(header.parts) > 1:
        found["parts"] = list(header.parts)
    text = header.attributes.get(exr.ATTRIBUTE)
    if isinstance(text, str):
        try:
            about = json.loads(text)
            quantity = Quantity(about["quantity"])
            found |= {"quantity": quantity.value, "unit": quantity.unit, "made_by": about["made_by"]}
            found["camera"] = about["camera"] and about["camera"]["name"]
            found["objects"] = about["object_names"]
            found["materials"] = about["material_names"]
        except (ValueError, KeyError, TypeError):
            found["note"] = f'the header attribute "{exr.ATTRIBUTE}" is damaged'
    else:
        found["quantity"] = "not stated; taken as radiance"
        found["attributes"] = {k: v for k, v in header.attributes.items() if isinstance(v, str | int | float)}
    try:
        channels = read_channels(path, header)
    except FileError as error:
        found["channels"] = [{"name": c.name, "type": c.kind} for c in header.channels]
        return found | {"problems": _problems(error.problems)}
    found["channels"] = [
        {"name": c.name, "type": c.kind, **_numbers(channels[c.name])} for c in header.channels
    ]
    return found


def _numbers(values: np.ndarray) -> Description:
    """Least, mean and largest of the finite values, and how many are not."""
    whole = values.dtype.kind == "u"
    values = np.where(values == 0xFFFFFFFF, -1, values.astype(np.int64)) if whole else values
    finite = values[np.isfinite(values)].astype(np.float64)
    some = finite.size > 0
    return {
        "min": float(finite.min()) if some else None,
        "mean": float(finite.mean()) if some else None,
        "max": float(finite.max()) if some else None,
        "nan": int(np.isnan(values).sum()),
        "inf": int(np.isinf(values).sum()),
    }


def _picture(picture: images.Picture) -> Description:
    array = picture.array
    height, width, planes = array.shape
    named = len(picture.channels) == planes
    found: Description = {
        "format": picture.format,
        "resolution_px": [width, height],
        "channels": picture.channels,
        "bits": picture.bits,
        "encoding": {True: "sRGB", False: "linear", None: "not stated"}[picture.srgb],
        **picture.about,
    }
    rows = []
    for i in range(planes):
        plane = array[..., i]
        row: Description = {"name": picture.channels[i] if named else str(i), **_numbers(plane)}
        if array.dtype.kind == "u":
            top = np.iinfo(array.dtype).max
            row |= {"at_0": int((plane == 0).sum()), f"at_{top}": int((plane == top).sum())}
            del row["nan"], row["inf"]
        rows.append(row)
    return found | {"values": rows}


def _photometry(lamp: Photometry) -> Description:
    profile = lamp.profile
    flux = profile.power()
    h, v = np.unravel_index(int(np.argmax(profile.candela)), profile.candela.shape)
    widths = {}
    for name, share in (("beam_angle_50_percent_deg", 0.5), ("field_angle_10_percent_deg", 0.1)):
        widths[name] = [full_angle(profile, share, azimuth) for azimuth in (0.0, np.pi / 2)]
    found: Description = {
        "standard": lamp.standard,
        "goniometer": f"type {lamp.goniometer}",
        "symmetry": lamp.symmetry,
        "vertical_angles": f"{len(lamp.vertical)}, {lamp.vertical[0]:g} to {lamp.vertical[-1]:g}°",
        "horizontal_angles": f"{len(lamp.horizontal)}, {lamp.horizontal[0]:g} to {lamp.horizontal[-1]:g}°",
        "peak_cd": float(profile.candela[h, v]),
        "peak_at_deg": [
            float(np.degrees(profile.vertical[v])),
            float(np.degrees(profile.horizontal[h])),
        ],
        "flux_lm": flux,
        "lamps": lamp.lamps,
        "lamp_flux_lm": lamp.lumens if lamp.lumens is not None else "absolute photometry",
        "light_output_ratio": flux / lamp.lumens if lamp.lumens else None,
        "stated_output_ratio": lamp.efficiency,
        "power_W": lamp.watts,
        "efficacy_lm_per_W": flux / lamp.watts if lamp.watts > 0 else None,
        **widths,
        "opening_mm": [1000 * x for x in lamp.size],
        "factor": lamp.factor,
        "keywords": lamp.keywords,
        "problems": _problems(lamp.notes),
    }
    return {k: x for k, x in found.items() if x is not None}


def _radial(lamp: Photometry) -> Description:
    """A data sheet's profile: how wide it is, and W of a lamp with 1 W/sr where it is brightest."""
    found = _photometry(lamp)
    kept = (
        "symmetry",
        "vertical_angles",
        "beam_angle_50_percent_deg",
        "field_angle_10_percent_deg",
        "problems",
    )
    power = float(lamp.profile.power())
    return {"kind": lamp.standard, "W_per_W_sr": power, **{k: found[k] for k in kept}}


def _measurement(found: Measurement) -> Description:
    axes = [
        {"name": a.name, "unit": a.unit, "distinct": len(np.unique(a.values)), **_range(a.values)}
        for a in found.axes
    ]
    values = [
        {"name": c.name, "unit": c.unit, **_range(c.values), "negative": int((c.values < 0).sum())}
        for c in found.values
    ]
    words = [
        {"name": name, "distinct": len(set(cells)), "first": cells[0] if cells else ""}
        for name, cells in found.labels.items()
    ]
    return {
        "kind": found.kind.value,
        "readings": found.rows,
        **_reflectance(found),
        **_spectra(found),
        "comments": list(found.comments),
        "axes": axes,
        "values": values,
        "words": words,
        "problems": _problems(found.notes),
    }


def _reflectance(found: Measurement) -> Description:
    """What a BRDF has beside its columns: how much of it is usable, sigma, and the model it tabulates."""
    if found.kind is not Kind.BRDF:
        return {}
    samples = ReflectanceSamples.from_measurement(found)
    about: Description = {"usable": int(samples.usable.sum())}
    if samples.sigma is not None:
        ratio = samples.sigma / np.maximum(np.abs(samples.f), 1e-12)
        about["median_sigma_percent"] = float(100 * np.nanmedian(ratio))
    if found.model is not None:
        shape = " x ".join(str(getattr(found.model, name)) for name in settings(found.model))
        about["model"] = f"{type(found.model).__name__} ({shape})"
    return about


def _spectra(found: Measurement) -> Description:
    """Of each spectrum of a file its mean wavelength, and what people see of it: colour and efficacy."""
    if found.kind is not Kind.SPECTRUM:
        return {}
    rows = []
    for column in found.values:
        spectrum = from_measurement(found, column.name)
        row: Description = {"name": column.name, "integral": spectrum.integral()}
        if row["integral"] > 0:
            at = spectrum.wavelength_nm[int(np.argmax(spectrum.values))]
            row |= {"peak_nm": float(at), "mean_nm": spectrum.mean_wavelength()}
        visible = np.ptp(np.clip(spectrum.wavelength_nm, 360, 830)) > 0
        if visible and row["integral"] > 0 and xyz(spectrum).sum() > 0:
            row |= {"xy": list(chromaticity(spectrum)), "efficacy_lm_per_W": luminous_efficacy(spectrum)}
        rows.append(row)
    return {"spectra": rows}


def _range(values: np.ndarray) -> Description:
    finite = values[np.isfinite(values)]
    return {
        "min": float(finite.min()) if finite.size else None,
        "mean": float(finite.mean()) if finite.size else None,
        "max": float(finite.max()) if finite.size else None,
        "missing": int(len(values) - finite.size),
    }


def _problems(problems: Iterable[Problem]) -> list[Description]:
    return [{"severity": p.severity.value, "problem": str(p)} for p in problems]
