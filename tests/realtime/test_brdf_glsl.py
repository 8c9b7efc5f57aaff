"""The law that holds NumPy and GLSL together, for every model of the catalogue; and a whole image of one."""

import moderngl
import numpy as np
import pytest

from interchange import shader
from interchange.brdf import MODELS
from interchange.brdf.lafortune import Lafortune
from interchange.frames import apply
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from interchange.table import Column

COUNT = 2048
FRAGMENT = """#version 410
uniform sampler2D directions_in, directions_out;
uniform float p[{size}];
out vec4 value;
{prelude}
{function}
void main()
{{
    ivec2 at = ivec2(gl_FragCoord.xy);
    float q[{size}];
    for (int i = 0; i < {size}; ++i) q[i] = p[i];
    value = vec4(model(texelFetch(directions_in, at, 0).xyz, texelFetch(directions_out, at, 0).xyz, q), 1.0);
}}
"""
VERTEX = """#version 410
void main() { gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""


def hemisphere(rng):
    w = rng.normal(size=(COUNT, 3))
    w[:, 2] = np.abs(w[:, 2]) + 0.02
    return (w / np.linalg.norm(w, axis=1, keepdims=True)).astype(np.float32)


def prelude(model):
    samplers = "".join(f"uniform sampler2D table_{k};\n" for k in range(len(model.tables)))
    return shader.GLSL.prelude + shader.ROW + samplers


class Single(Column):
    """A table's channel in single precision."""

    def take(self, index):
        return super().take(index).astype(np.float32)


class Coarse(np.ndarray):
    """Whose sines and cosines are off by up to 2⁻²¹, as those of GPUs are (CUDA C++ Programming Guide, __sinf)."""

    rng = np.random.default_rng(12)

    def __array_ufunc__(self, ufunc, method, *inputs, **kwargs):
        value = getattr(ufunc, method)(*map(np.asarray, inputs), **kwargs)
        if ufunc in (np.sin, np.cos):
            value = value + self.rng.uniform(-(2.0**-21), 2.0**-21, np.shape(value))
        return np.asarray(value).view(Coarse)

    def __array_function__(self, function, types, arguments, options):
        return np.asarray(super().__array_function__(function, types, arguments, options)).view(Coarse)


def coarsely(model, wi, wo):
    """``model.evaluate`` with sines and cosines of a GPU."""
    i, o = (tuple(np.moveaxis(w.astype(np.float64), -1, 0).view(Coarse)) for w in (wi, wo))
    with np.errstate(all="ignore"):
        found = [model.bind(model.flat(), c, [t.channel(c) for t in model.tables]).f(i, o) for c in range(3)]
    return np.stack([np.broadcast_to(np.asarray(x), (COUNT,)) for x in found], axis=-1)


@pytest.mark.parametrize("name", MODELS)
def test_glsl_is_numpy(rasterizer, name):
    """Relative 1e-4, plus what the formula makes of 32 bits: of directions that are off by four roundings, of a GPU's
    sines, and of its own operations (NumPy's error in float32)."""
    rng = np.random.default_rng(11)
    context = rasterizer.context
    with context:
        target = context.framebuffer([context.texture((COUNT, 1), 4, dtype="f4")])
        for trial in range(8):
            model = MODELS[name].drawn(rng, lobes=1 + trial % 3)
            wi, wo = hemisphere(rng), hemisphere(rng)
            half = COUNT // 2  # half of the pairs near the mirror direction, where lobes are
            wo[:half] = wi[:half] * [-1, -1, 1] + rng.normal(size=(half, 3)) * 0.02
            wo[:half, 2] = np.abs(wo[:half, 2]) + 1e-3
            wo = (wo / np.linalg.norm(wo, axis=1, keepdims=True)).astype(np.float32)
            size = max(len(model.flat()), 1)
            program = context.program(
                vertex_shader=VERTEX,
                fragment_shader=FRAGMENT.format(
                    size=size, prelude=prelude(model), function=shader.function(model, shader.GLSL, "model")
                ),
            )
            if "p" in program:
                program["p"].value = model.flat() if size > 1 else model.flat()[0]
            for unit, (label, data) in enumerate((("directions_in", wi), ("directions_out", wo))):
                texture = context.texture((COUNT, 1), 3, data.tobytes(), dtype="f4")
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
                texture.use(unit)
                if label in program:
                    program[label].value = unit
            for k, table in enumerate(model.tables):
                size = (table.pixels.shape[1], table.pixels.shape[0])
                texture = context.texture(size, 3, table.pixels.tobytes(), dtype="f4")
                texture.use(2 + k)
                if f"table_{k}" in program:
                    program[f"table_{k}"].value = 2 + k
            target.use()
            context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
            got = np.frombuffer(target.read(components=3, dtype="f4"), np.float32).reshape(COUNT, 3)
            expected = model.evaluate(wi, wo)
            slack = np.zeros_like(expected)
            for _ in range(6):
                nudge = [w * (1 + rng.uniform(-2.4e-7, 2.4e-7, w.shape)) for w in (wi, wo)]
                slack = np.maximum(slack, np.abs(model.evaluate(*nudge) - expected))
                slack = np.maximum(slack, np.abs(coarsely(model, wi, wo) - expected))
            error = np.abs(got - expected)
            columns = [[Single(t.channel(c).values) for t in model.tables] for c in range(3)]
            i, o = (tuple(np.moveaxis(w, -1, 0)) for w in (wi, wo))
            with np.errstate(all="ignore"):
                numbers = [np.float32(x) for x in model.flat()]
                single = [model.bind(numbers, c, columns[c]).f(i, o) for c in range(3)]
            single = np.stack([np.broadcast_to(s, (COUNT,)) for s in single], axis=-1)
            assert single.dtype == np.float32
            small = np.isfinite(single) & (np.abs(expected) < 1e30)  # what 32 bits can hold
            relative = np.abs(single - expected)[small] / np.maximum(np.abs(expected[small]), 1e-6)
            bound = (1e-4 + 4 * np.quantile(relative, 0.999)) * np.abs(expected) + 8 * slack + 1e-6
            assert small.mean() > 0.5
            assert (error <= bound)[small].all(), (model, float((error / bound)[small].max()))


def test_highlight_of_a_sphere(rasterizer, make):
    """Two Lafortune lobes on a ball under a point lamp: every pixel is the model at its own position and normal."""
    brdf = Lafortune(
        0.1, weight=((1.2, 1.0, 0.8), (0.2, 0.3, 0.4)), C=((-0.97, -0.97, 0.98), (0.7, 0.7, 0.6)), n=(40, 6)
    )
    lamp = np.array([0.8, -1.0, 1.5])
    body = Body("/ball", make.ball(160), Material("metal", brdf), np.diag([0.3, 0.3, 0.3, 1]))
    light = Light("/lamp", LightKind.SPHERE, (2.0, 3.0, 4.0), make.at(*lamp), casts_shadows=False)
    camera = make.pinhole((0, -1.2, 0.9), (0, 0, 0), (120, 90), 0.5)
    image = rasterizer.render(Scene((body,), (light,)), camera, ["position", "normal"], samples=1)
    predicted = predict(image, brdf, lamp, light, camera)
    lit = np.isfinite(predicted[..., 0]) & (predicted[..., 0] > 1e-3)
    assert lit.sum() > 2000
    assert predicted[lit].max() > 4 * np.median(predicted[lit])
    assert np.allclose(image.pixels[lit], predicted[lit], rtol=2e-3)  # exponent 40 on float32 passes


def predict(image, brdf, lamp, light, camera):
    p, n = image.passes["position"].astype(float), image.passes["normal"].astype(float)
    to = lamp - p
    d2 = np.sum(to * to, axis=-1, keepdims=True)
    view = camera.world_from_camera[:3, 3] - p
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    helper = np.where(np.abs(n[..., :1]) < 0.9, [1.0, 0, 0], [0, 1.0, 0])
    t = np.cross(helper, n)
    t /= np.linalg.norm(t, axis=-1, keepdims=True)  # the lobes are isotropic: any tangent
    frame = np.stack([t, np.cross(n, t), n], axis=-2)
    wi, wo = ((frame @ w[..., None])[..., 0] for w in (to / np.sqrt(d2), view))
    return brdf.evaluate(wi, wo) * np.asarray(light.intensity) * np.maximum(wi[..., 2:], 0) / d2


def test_anisotropic_lobe_follows_the_tangent(rasterizer, make):
    """On a plane that is turned and scaled unevenly, the tangent is the image of increasing u."""
    brdf = Lafortune(0.0, weight=(1.0,), C=((-1.0, -0.4, 0.9),), n=(12,))
    c, s = np.cos(0.7), np.sin(0.7)
    pose = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]) @ np.diag([0.5, 2.0, 1, 1])
    lamp = np.array([0.3, 0.4, 0.8])
    light = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), make.at(*lamp))
    camera = make.pinhole((-0.4, -0.5, 0.9), (0, 0, 0), (64, 48), 0.5)
    image = rasterizer.render(
        Scene((Body("/p", make.plane(), Material("m", brdf), pose),), (light,)),
        camera,
        ["position"],
        samples=1,
    )
    p = image.passes["position"].astype(float)
    frame = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    to, view = lamp - p, camera.world_from_camera[:3, 3] - p
    d2 = np.sum(to * to, axis=-1, keepdims=True)
    wi, wo = to / np.sqrt(d2) @ frame.T, view / np.linalg.norm(view, axis=-1, keepdims=True) @ frame.T
    predicted = brdf.evaluate(wi, wo) * wi[..., 2:] / d2
    hit = np.isfinite(p[..., 0])
    assert hit.mean() > 0.5
    assert np.allclose(image.pixels[hit], predicted[hit], rtol=1e-3, atol=1e-5)


def test_fragment_of_a_material(rasterizer, make):
    """A material's own GLSL is drawn in place of its model; one that does not compile is an error that says where."""
    glsl = "vec3 brdf(vec3 wi, vec3 wo, vec2 uv) { return vec3(uv, wi.z * wo.z); }"
    light = Light("/sun", LightKind.DISTANT, (1.0, 1.0, 1.0))
    camera = make.telecentric((0, 0, 1), (0, 0, 0), 0.02, (32, 32))
    scene = Scene((Body("/p", make.plane(), Material("m", glsl=glsl)),), (light,))
    image = rasterizer.render(scene, camera, ["position"], samples=1)
    p = apply(np.eye(4), image.passes["position"])
    assert np.allclose(image.pixels[..., :2], p[..., :2] + 0.5, atol=1e-5)
    assert np.allclose(image.pixels[..., 2], 1.0, atol=1e-5)
    broken = Scene((Body("/p", make.plane(), Material("broken", glsl="vec3 brdf(")),), (light,))
    with pytest.raises(Exception, match="broken"):
        rasterizer.render(broken, camera, samples=1)
