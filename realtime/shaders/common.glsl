// Codes and frames that more than one shader needs.

// A direction of the plane as one number in [-2, 2], without an angle's trigonometry.
float diamond(vec2 v)
{
    float p = v.x / (abs(v.x) + abs(v.y));
    return v.y < 0.0 ? p - 1.0 : 1.0 - p;
}

vec2 from_diamond(float p)
{
    float s = p < 0.0 ? -1.0 : 1.0;
    vec2 v = vec2(p < 0.0 ? p + 1.0 : 1.0 - p, 0.0);
    v.y = s * (1.0 - abs(v.x));
    return normalize(v);
}

void basis(vec3 n, out vec3 b1, out vec3 b2)
{
    // Duff et al.: Building an orthonormal basis, revisited. 2017.
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z), b = n.x * n.y * a;
    b1 = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    b2 = vec3(b, s + n.y * n.y * a, -n.y);
}

// A direction as two numbers, the octahedral map: Meyer et al., On floating-point normal vectors. EGSR 2010.
vec2 octahedral(vec3 n)
{
    vec2 e = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    return n.z >= 0.0 ? e : (1.0 - abs(e.yx)) * vec2(e.x >= 0.0 ? 1.0 : -1.0, e.y >= 0.0 ? 1.0 : -1.0);
}

vec3 from_octahedral(vec2 e)
{
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    float fold = max(-n.z, 0.0);
    n.xy -= fold * vec2(e.x >= 0.0 ? 1.0 : -1.0, e.y >= 0.0 ? 1.0 : -1.0);
    return normalize(n);
}

// The facet's normal in the eye's frame, towards the eye, from the slopes g of 1/Z (of Z if telecentric) by the ray d.
vec3 facet_normal(float q, vec2 g, vec2 d)
{
#ifdef TELECENTRIC
    return normalize(vec3(g, -1.0));
#else
    return -normalize(vec3(g, q - dot(g, d)));
#endif
}

// Evenly spread over the samples of one texel, and different from texel to texel.
float chance(uvec3 place, int index)
{
    // Jarzynski, Olano: Hash functions for GPU rendering. 2020 (pcg3d).
    uvec3 v = place * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return fract(float(v.x >> 8u) / 16777216.0 + float(index) * 0.6180339887);
}

#ifdef OPACITY
// A number of its own for either side of a body, so that each lets its own share through; the same for all facets of
// one side, over whose edges shares would be spread less evenly.
uint layer(float body)
{
    return 2u * uint(body) + uint(gl_FrontFacing);
}
#endif

int modulo(int i, int n)
{
    int r = i - n * int(floor(float(i) / float(n)));  // % is undefined below zero
    return r < 0 ? r + n : r >= n ? r - n : r;
}

int wrapped(int i, int n, int mode)
{
    if (mode == 2) return modulo(i, n);  // repeat
    if (mode == 3) { int m = modulo(i, 2 * n); return m < n ? m : 2 * n - 1 - m; }  // mirror
    return clamp(i, 0, n - 1);                                                    // clamp; black is masked
}

// interchange.material.evaluate_texture, text by text.
vec3 sampled(sampler2D map, mat3 uv_from_st, ivec2 mode, vec2 st)
{
    ivec2 size = textureSize(map, 0);
    vec2 uv = (uv_from_st * vec3(st, 1.0)).xy;
    vec2 p = vec2(uv.x * float(size.x), (1.0 - uv.y) * float(size.y)) - 0.5;
    vec2 base = floor(p), f = p - base;
    vec3 total = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        ivec2 i = ivec2(base) + ivec2(k & 1, k >> 1);
        float w = ((k & 1) == 1 ? f.x : 1.0 - f.x) * ((k >> 1) == 1 ? f.y : 1.0 - f.y);
        bool outside = (mode.x == 0 && (i.x < 0 || i.x >= size.x)) || (mode.y == 0 && (i.y < 0 || i.y >= size.y));
        vec4 value = texelFetch(map, ivec2(wrapped(i.x, size.x, mode.x), wrapped(i.y, size.y, mode.y)), 0);
        total += outside ? vec3(0.0) : w * value.rgb;
    }
    return total;
}
