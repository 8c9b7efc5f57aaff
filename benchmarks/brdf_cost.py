"""What an evaluation of each reflectance model costs in GLSL: CPU ns, and as a multiple of Lambert's.

Every pixel of a 512 x 512 image evaluates the model for 16 pairs of directions of its own; the time of the same shader
without the model is taken off. CPU time of all threads of a software renderer; the least of seven runs, in turn over
the models, counts.

    python benchmarks/brdf_cost.py
"""

import time

import moderngl
import numpy as np

from interchange import shader
from interchange.brdf import MODELS, Brdf
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from realtime.context import headless_context

SIZE, PAIRS, RUNS = 512, 16, 7
VERTEX = """#version 410
void main() { gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }
"""
FRAGMENT = """#version 410
uniform float numbers[SIZE];
out vec4 value;
PRELUDE
FUNCTION
vec3 direction(vec2 seed)
{
    float phi = 6.2831853 * fract(seed.x * 0.7548777), z = 0.05 + 0.95 * fract(seed.y * 0.5698403);
    float s = sqrt(1.0 - z * z);
    return vec3(s * cos(phi), s * sin(phi), z);
}
void main()
{
    float p[SIZE];
    for (int i = 0; i < SIZE; ++i) p[i] = numbers[i];
    vec3 sum = vec3(0.0);
    for (int k = 0; k < PAIRS; ++k) {
        vec3 wi = direction(gl_FragCoord.xy + float(k)), wo = direction(gl_FragCoord.yx + 31.0 * float(k));
        sum += model(wi, wo, p) + 1e-6 * wi * wo;
    }
    value = vec4(sum, 1.0);
}
"""
NOTHING = "vec3 model(vec3 wi, vec3 wo, float p[SIZE]) { return vec3(p[0]); }"


class Timed:
    def __init__(self, context: moderngl.Context, brdf: Brdf | None) -> None:
        numbers = brdf.flat() if brdf else [1.0]
        size = max(len(numbers), 1)
        tables = brdf.tables if brdf else []
        prelude = shader.GLSL.prelude + (shader.ROW if tables else "")
        prelude += "".join(f"uniform sampler2D table_{k};\n" for k in range(len(tables)))
        text = FRAGMENT.replace("PRELUDE", prelude)
        text = text.replace("FUNCTION", shader.function(brdf, shader.GLSL, "model") if brdf else NOTHING)
        text = text.replace("SIZE", str(size)).replace("PAIRS", str(PAIRS))
        self.context = context
        self.program = context.program(vertex_shader=VERTEX, fragment_shader=text)
        if "numbers" in self.program:
            self.program["numbers"].write(np.array(numbers, np.float32).tobytes())
        self.textures = []
        for k, table in enumerate(tables):
            shape = (table.pixels.shape[1], table.pixels.shape[0])
            self.textures.append(context.texture(shape, 3, table.pixels.tobytes(), dtype="f4"))
            if f"table_{k}" in self.program:
                self.program[f"table_{k}"].value = k
        self.array = context.vertex_array(self.program, [])

    def seconds(self) -> float:
        for k, texture in enumerate(self.textures):
            texture.use(k)
        self.context.finish()
        start = time.process_time()
        self.array.render(moderngl.TRIANGLES, vertices=3)
        self.context.finish()
        return time.process_time() - start


def main() -> None:
    context = headless_context()
    models: dict[str, Brdf] = {m.__name__: m(**m.example) for m in MODELS.values()}
    merl = TabulatedIsotropic(n_theta_h=90, n_theta_d=90, n_phi_d=180, values=np.full(90 * 90 * 180, 0.1))
    models["TabulatedIsotropic, 90 x 90 x 180 as MERL"] = merl
    with context:
        target = context.framebuffer([context.texture((SIZE, SIZE), 4, dtype="f4")])
        target.use()
        timed = {"": Timed(context, None)} | {name: Timed(context, brdf) for name, brdf in models.items()}
        times: dict[str, list[float]] = {name: [] for name in timed}
        for _ in range(RUNS + 1):
            for name, one in timed.items():
                times[name].append(one.seconds())
    best = {name: min(runs[1:]) for name, runs in times.items()}
    each = {n: (t - best[""]) / SIZE**2 / PAIRS * 1e9 for n, t in best.items() if n}
    print(f"{context.info['GL_RENDERER']}\n")
    print("| model | ns an evaluation | as Lambert |\n|---|---|---|")
    for name, ns in sorted(each.items(), key=lambda item: item[1]):
        print(f"| {name} | {ns:.2f} | {ns / each['Lambert']:.1f} |")


if __name__ == "__main__":
    main()
