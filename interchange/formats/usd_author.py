"""Write meshes, materials, lamps and cameras as USD prims, in the terms of the file contract.

The importers build their stages from these, and ``author_scene`` writes a ``Scene`` made in Python.
Lengths come in metres and are written in the stage's unit, poses in its up axis.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from interchange.brdf import Brdf
from interchange.brdf.sum import Sum
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Camera, Projection
from interchange.distortion import LensModel
from interchange.formats import usd_lamp, usd_sensor
from interchange.formats.usd_preview import preview_of
from interchange.frames import camera_from_gl, z_up_from_y_up
from interchange.light import Light, LightKind
from interchange.material import Material, Texture
from interchange.mesh import Mesh
from interchange.parameter import Kind as ParameterKind
from interchange.parameter import parameters, settings, tables
from interchange.problems import BrightfieldError
from interchange.scene import Scene

TYPES = {
    (ParameterKind.FLOAT, False): Sdf.ValueTypeNames.Float,
    (ParameterKind.COLOR, False): Sdf.ValueTypeNames.Color3f,
    (ParameterKind.VECTOR, False): Sdf.ValueTypeNames.Float3,
    (ParameterKind.FLOAT, True): Sdf.ValueTypeNames.FloatArray,
    (ParameterKind.COLOR, True): Sdf.ValueTypeNames.Color3fArray,
    (ParameterKind.VECTOR, True): Sdf.ValueTypeNames.Float3Array,
}


def new_stage(meters_per_unit: float = 0.001, up_axis: str = "Z") -> Usd.Stage:
    """An empty stage in memory with ``/World`` as its default prim."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    UsdGeom.SetStageUpAxis(stage, up_axis)
    world = UsdGeom.Xform.Define(stage, "/World")
    Usd.ModelAPI(world.GetPrim()).SetKind(Kind.Tokens.component)
    stage.SetDefaultPrim(world.GetPrim())
    return stage


def free_path(stage: Usd.Stage, parent: str, name: str) -> str:
    """A path below ``parent`` that is valid and not taken, as near to ``name`` as USD allows."""
    base = Tf.MakeValidIdentifier(name or "unnamed")
    path, count = f"{parent}/{base}", 1
    while stage.GetPrimAtPath(path):
        count += 1
        path = f"{parent}/{base}_{count}"
    return path


def stage_from_world(stage: Usd.Stage) -> np.ndarray:
    """(4, 4): from the program's metres and z up to the stage's unit and up axis."""
    scale = np.diag([1 / UsdGeom.GetStageMetersPerUnit(stage)] * 3 + [1.0])
    return scale if UsdGeom.GetStageUpAxis(stage) == "Z" else scale @ z_up_from_y_up.T


def set_matrix(prim: Any, matrix: np.ndarray, time: float | None = None) -> None:
    """Set a prim's one transform op. ``matrix`` (4, 4): parent_from_prim on columns, translation in metres,
    in the stage's own axes (no turn for the up axis)."""
    xform = UsdGeom.Xformable(prim)
    unit = UsdGeom.GetStageMetersPerUnit(xform.GetPrim().GetStage())
    m = np.array(matrix, np.float64)
    m[:3, 3] /= unit
    ops = [op for op in xform.GetOrderedXformOps() if op.GetOpType() == UsdGeom.XformOp.TypeTransform]
    op = ops[0] if ops else xform.AddTransformOp()
    op.Set(Gf.Matrix4d(m.T.tolist()), Usd.TimeCode.Default() if time is None else Usd.TimeCode(time))


def world_matrix(stage: Usd.Stage, world_from_prim: np.ndarray) -> np.ndarray:
    """What ``set_matrix`` needs for a prim that stands at the top of the stage: turned to its up axis."""
    turned = world_from_prim if UsdGeom.GetStageUpAxis(stage) == "Z" else z_up_from_y_up.T @ world_from_prim
    return np.asarray(turned)


def author_mesh(stage: Usd.Stage, path: str, mesh: Mesh) -> UsdGeom.Mesh:
    """A polygon mesh with per-vertex normals and ``primvars:st``. Vertices that only split for normals stay split."""
    prim = UsdGeom.Mesh.Define(stage, path)
    points = mesh.vertices / UsdGeom.GetStageMetersPerUnit(stage)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32)))
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(
        Vt.IntArray.FromNumpy(np.ascontiguousarray(mesh.faces.ravel(), np.int32))
    )
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.normals, np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if len(points):
        extent = np.stack([points.min(0), points.max(0)]).astype(np.float32)
        prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(extent))
    if mesh.uv is not None:
        st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(mesh.uv, np.float32)))
    return prim


def bind(prim: Any, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def author_material(stage: Usd.Stage, path: str, material: Material) -> UsdShade.Material:
    """A material with a BRDF shader, and a UsdPreviewSurface that shows other software something near."""
    usd = UsdShade.Material.Define(stage, path)
    preview = UsdShade.Shader.Define(stage, f"{path}/Preview")
    preview.CreateIdAttr("UsdPreviewSurface")
    own = isinstance(material.brdf, UsdPreviewSurface)
    stand_in = material.brdf if own else preview_of(material.brdf)
    _author_inputs(preview, stand_in, material.maps if own else {})
    if any(material.emission):
        preview.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*material.emission))
    if material.opacity != 1.0:
        preview.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(material.opacity)
    if material.opacity_threshold:
        preview.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(material.opacity_threshold)
    for name, texture in (
        ("normal", material.normal_map),
        ("emissiveColor", material.emission_map),
        ("opacity", material.opacity_map),
    ):
        if texture is not None:
            author_texture(preview, name, texture)
    usd.CreateSurfaceOutput().ConnectToSource(preview.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    if material.glsl or not own:
        shader = UsdShade.Shader.Define(stage, f"{path}/Brdf")
        if material.glsl:
            shader.SetSourceCode(material.glsl, "glsl")
        else:
            author_brdf(stage, shader, material.brdf, material.maps)
        usd.CreateSurfaceOutput("brdf").ConnectToSource(
            shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        )
    return usd


def material_stage(material: Material) -> Usd.Stage:
    """A stage that holds one material, its default prim: ``references = @material.usda@`` brings it elsewhere."""
    stage = new_stage()
    UsdGeom.Scope.Define(stage, "/World/Materials")
    usd = author_material(stage, free_path(stage, "/World/Materials", material.name), material)
    stage.SetDefaultPrim(usd.GetPrim())
    return stage


def author_brdf(stage: Usd.Stage, shader: UsdShade.Shader, brdf: Brdf, maps: Mapping[str, Texture]) -> None:
    """A BRDF's name and numbers on ``shader``; the parts of a sum become shaders below it, connected to its inputs."""
    shader.CreateIdAttr(type(brdf).__name__)
    if not isinstance(brdf, Sum):
        _author_inputs(shader, brdf, maps)
        return
    for k, (weight, part) in enumerate(zip(brdf.weight, brdf.parts, strict=True)):
        if f"weight{k}" in maps:
            author_texture(shader, f"weight{k}", maps[f"weight{k}"])
        else:
            shader.CreateInput(f"weight{k}", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*weight))
        inner = UsdShade.Shader.Define(stage, shader.GetPath().AppendChild(f"Part{k}"))
        head = f"part{k}_"
        own = {name.removeprefix(head): t for name, t in maps.items() if name.startswith(head)}
        author_brdf(stage, inner, part, own)
        source = inner.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        shader.CreateInput(f"part{k}", Sdf.ValueTypeNames.Token).ConnectToSource(source)


def _author_inputs(shader: UsdShade.Shader, brdf: Brdf, maps: Mapping[str, Texture]) -> None:
    defaults = type(brdf)()
    for name, about in parameters(brdf).items():
        value = getattr(brdf, name)
        if name in maps:
            author_texture(shader, name, maps[name])
            continue
        if isinstance(brdf, UsdPreviewSurface) and value == getattr(defaults, name):
            continue
        kind = TYPES[about.kind, about.per_lobe]
        if name == "useSpecularWorkflow":
            kind, value = Sdf.ValueTypeNames.Int, int(value)
        shader.CreateInput(name, kind).Set(usd_value(value, about.kind, about.per_lobe))
    for name in settings(brdf):
        shader.CreateInput(name, Sdf.ValueTypeNames.Int).Set(getattr(brdf, name))
    for name in tables(brdf):
        rows = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(getattr(brdf, name).values))
        shader.CreateInput(name, Sdf.ValueTypeNames.Color3fArray).Set(rows)


def usd_value(value: Any, kind: ParameterKind, per_lobe: bool) -> Any:
    """A parameter's value as the Python type that USD takes."""
    if kind is ParameterKind.FLOAT:
        return list(value) if per_lobe else value
    return [Gf.Vec3f(*v) for v in value] if per_lobe else Gf.Vec3f(*value)


def author_texture(shader: UsdShade.Shader, name: str, texture: Texture) -> None:
    stage, material = shader.GetPrim().GetStage(), shader.GetPath().GetParentPath()
    reader = UsdShade.Shader.Define(stage, material.AppendChild("StReader"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    if not np.allclose(texture.uv_from_st, np.eye(3)):
        place = UsdShade.Shader.Define(stage, material.AppendChild(f"Place_{name}"))
        place.CreateIdAttr("UsdTransform2d")
        m = texture.uv_from_st
        place.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
        angle = float(np.degrees(np.arctan2(m[1, 0], m[0, 0])))
        scale = (
            float(np.hypot(m[0, 0], m[1, 0])),
            float(np.linalg.det(m[:2, :2]) / np.hypot(m[0, 0], m[1, 0])),
        )
        place.CreateInput("rotation", Sdf.ValueTypeNames.Float).Set(angle)
        place.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(*scale))
        place.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(
            Gf.Vec2f(float(m[0, 2]), float(m[1, 2]))
        )
        st = place.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    image = UsdShade.Shader.Define(stage, material.AppendChild(f"Texture_{name}"))
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(texture.file)
    image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
    for axis, wrap in zip("ST", texture.wrap, strict=True):
        image.CreateInput(f"wrap{axis}", Sdf.ValueTypeNames.Token).Set(wrap.value)
    if name == "normal":
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("raw")
        image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
        image.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
    color = texture.pixels.shape[2] == 3
    output = image.CreateOutput(
        "rgb" if color else "r", Sdf.ValueTypeNames.Float3 if color else Sdf.ValueTypeNames.Float
    )
    kind = {"normal": Sdf.ValueTypeNames.Normal3f}.get(
        name, Sdf.ValueTypeNames.Color3f if color else Sdf.ValueTypeNames.Float
    )
    shader.CreateInput(name, kind).ConnectToSource(output)


LUX = {
    LightKind.SPHERE: UsdLux.SphereLight,
    LightKind.DISK: UsdLux.DiskLight,
    LightKind.RECT: UsdLux.RectLight,
    LightKind.CYLINDER: UsdLux.CylinderLight,
    LightKind.DISTANT: UsdLux.DistantLight,
    LightKind.DOME: UsdLux.DomeLight,
}


def author_light(stage: Usd.Stage, path: str, light: Light) -> Any:
    """A UsdLux light with ``normalize``, so that its number does not depend on its size. Sets the pose too."""
    prim = LUX[light.kind].Define(stage, path)
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    peak = max(light.intensity)
    # normalised UsdLux intensity is radiance x area: a sphere's is 4 I, a cylinder's pi I, a flat lamp's I
    factor = {LightKind.SPHERE: 4.0, LightKind.CYLINDER: np.pi}.get(light.kind, 1.0)
    prim.CreateIntensityAttr(float(peak * factor))
    if peak > 0 and min(light.intensity) != peak:
        prim.CreateColorAttr(Gf.Vec3f(*(x / peak for x in light.intensity)))
    if light.kind is not LightKind.DOME:
        prim.CreateNormalizeAttr(True)
    if light.kind in (LightKind.SPHERE, LightKind.DISK, LightKind.CYLINDER):
        prim.CreateRadiusAttr(light.radius / unit)
    if light.kind is LightKind.CYLINDER:
        prim.CreateLengthAttr(light.length / unit)
    if light.kind is LightKind.RECT:
        prim.CreateWidthAttr(light.width / unit)
        prim.CreateHeightAttr(light.height / unit)
    if light.kind is LightKind.DISTANT:
        prim.CreateAngleAttr(float(np.degrees(light.angle)))
    for name, part in (("texture", light.texture), ("profile", light.profile)):
        if part is not None and not part.file:
            raise BrightfieldError(f"A lamp's {name} must be in a file to be written as USD. ({light.name})")
    if light.texture is not None:
        prim.CreateTextureFileAttr(light.texture.file)
    if light.cone_angle < np.pi or light.cone_softness or light.focus or light.profile is not None:
        shaping = UsdLux.ShapingAPI.Apply(prim.GetPrim())
        shaping.CreateShapingConeAngleAttr(float(np.degrees(light.cone_angle)))
        shaping.CreateShapingConeSoftnessAttr(light.cone_softness)
        shaping.CreateShapingFocusAttr(light.focus)
        shaping.CreateShapingFocusTintAttr(Gf.Vec3f(*light.focus_tint))
        if light.profile is not None:
            shaping.CreateShapingIesFileAttr(light.profile.file)
            shaping.CreateShapingIesAngleScaleAttr(light.profile_angle_scale)
    if light.projector is not None:
        usd_lamp.author_projector(prim, light.projector, light.name)
    if light.strobe.is_there:
        usd_lamp.author_strobe(prim, light.strobe)
    if light.visible:
        prim.GetPrim().CreateAttribute("lamp:visible", Sdf.ValueTypeNames.Bool, custom=True).Set(True)
    if not light.casts_shadows:
        UsdLux.ShadowAPI.Apply(prim.GetPrim()).CreateShadowEnableAttr(False)
    set_matrix(prim, world_matrix(stage, light.world_from_light))
    return prim


def author_camera(stage: Usd.Stage, path: str, camera: Camera) -> UsdGeom.Camera:
    """A UsdGeomCamera with the contract's ``sensor:*`` and ``lens:*`` attributes. Sets the pose too."""
    usd = UsdGeom.Camera.Define(stage, path)
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    tenth = 0.1 * unit  # m: the unit of focal length and apertures
    (width, height), (px, py) = camera.sensor.resolution, camera.sensor.pixel_pitch
    usd.CreateFocalLengthAttr(camera.lens.focal_length / tenth)
    usd.CreateHorizontalApertureAttr(width * px / tenth)
    usd.CreateVerticalApertureAttr(height * py / tenth)
    if camera.principal_point is not None:
        cx, cy = camera.principal_point
        usd.CreateHorizontalApertureOffsetAttr(((width - 1) / 2 - cx) * px / tenth)
        usd.CreateVerticalApertureOffsetAttr((cy - (height - 1) / 2) * py / tenth)
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        usd.CreateProjectionAttr(UsdGeom.Tokens.orthographic)
    usd.CreateClippingRangeAttr(Gf.Vec2f(*(c / unit for c in camera.clip)))
    if camera.lens.f_stop:
        usd.CreateFStopAttr(camera.lens.f_stop)
        usd.CreateFocusDistanceAttr(camera.lens.focus_distance / unit)
    prim = usd.GetPrim()
    names = Sdf.ValueTypeNames
    prim.CreateAttribute("sensor:resolution", names.Int2, custom=True).Set(Gf.Vec2i(width, height))
    usd_sensor.author(prim, camera)
    if camera.t_exp != 1.0:
        usd.CreateExposureTimeAttr(camera.t_exp)
    if any(camera.lens.distortion):
        prim.CreateAttribute("lens:distortion", names.FloatArray, custom=True).Set(
            list(camera.lens.distortion)
        )
    if camera.lens.model is not LensModel.OPENCV:
        prim.CreateAttribute("lens:model", names.Token, custom=True).Set(camera.lens.model.value)
    set_matrix(usd, world_matrix(stage, camera.world_from_camera @ camera_from_gl))
    return usd


def author_scene(scene: Scene, meters_per_unit: float = 0.001, frames: Sequence[Scene] = ()) -> Usd.Stage:
    """A stage of a scene made in Python. ``frames`` are later moments of it, one time code each after the first:
    poses and lamp intensities that differ become time samples."""
    stage = new_stage(meters_per_unit)
    UsdGeom.Scope.Define(stage, "/World/Materials")
    materials: dict[int, UsdShade.Material] = {}
    prims: list[list[Any]] = [[], [], []]
    for body in scene.bodies:
        material = body.material
        if id(material) not in materials:
            path = free_path(stage, "/World/Materials", material.name.rsplit("/", 1)[-1] or "material")
            materials[id(material)] = author_material(stage, path, material)
        prim = author_mesh(stage, free_path(stage, "/World", body.name.rsplit("/", 1)[-1]), body.mesh)
        bind(prim, materials[id(material)])
        prims[0].append(prim)
    for light in scene.lights:
        path = free_path(stage, "/World", light.name.rsplit("/", 1)[-1])
        prims[1].append(author_light(stage, path, usd_lamp.by_stage_time(light, scene.seconds)))
    for camera in scene.cameras:
        prims[2].append(
            author_camera(stage, free_path(stage, "/World", camera.name.rsplit("/", 1)[-1]), camera)
        )
    _author_frames(stage, [scene, *frames], prims)
    return stage


def _author_frames(stage: Usd.Stage, scenes: list[Scene], prims: list[list[Any]]) -> None:
    if len(scenes) > 1:
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(len(scenes) - 1)
        stage.SetTimeCodesPerSecond(usd_lamp.frame_rate(scenes))
    for i, prim in enumerate(prims[0]):
        poses = [s.bodies[i].world_from_body for s in scenes]
        _author_poses(stage, prim, poses)
    for i, prim in enumerate(prims[1]):
        lights = [s.lights[i] for s in scenes]
        _author_poses(stage, prim, [x.world_from_light for x in lights])
        peaks = [max(x.intensity) for x in lights]
        if len(set(peaks)) > 1:
            factor = {LightKind.SPHERE: 4.0, LightKind.CYLINDER: np.pi}.get(lights[0].kind, 1.0)
            brightest = lights[int(np.argmax(peaks))]
            prim.CreateColorAttr(Gf.Vec3f(*(x / max(peaks) for x in brightest.intensity)))
            for time, peak in enumerate(peaks):
                prim.GetIntensityAttr().Set(float(peak * factor), time)
    for i, prim in enumerate(prims[2]):
        _author_poses(stage, prim, [s.cameras[i].world_from_camera @ camera_from_gl for s in scenes])


def _author_poses(stage: Usd.Stage, prim: Any, poses: list[np.ndarray]) -> None:
    set_matrix(prim, world_matrix(stage, poses[0]))
    if any(not np.array_equal(p, poses[0]) for p in poses):
        for time, pose in enumerate(poses):
            set_matrix(prim, world_matrix(stage, pose), time)
