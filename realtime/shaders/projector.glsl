// interchange.projector.Projector.evaluate. The texture holds the projector's numbers in its first row, four a texel,
// and the image below.
#define NUMBERS(k, i) texelFetch(profile[k], ivec2(i, 0), 0)

vec2 lens_image(int k, vec2 p)
{
    float r2 = dot(p, p);
    vec4 a = NUMBERS(k, 1), b = NUMBERS(k, 2), c = NUMBERS(k, 3);
    if (NUMBERS(k, 6).y > 0.5) {
        float r = sqrt(r2), t = atan(r), t2 = t * t;
        return r > 1e-9 ? p * (t / r * (1.0 + t2 * (a.x + t2 * (a.y + t2 * (a.z + t2 * a.w))))) : p;
    }
    float q = (1.0 + r2 * (a.x + r2 * (a.y + r2 * b.x))) / (1.0 + r2 * (b.y + r2 * (b.z + r2 * b.w)));
    vec2 s = p * q + 2.0 * a.zw * p.x * p.y + a.wz * (r2 + 2.0 * p * p) + r2 * (c.xz + r2 * c.yw);
    vec3 h0 = NUMBERS(k, 4).xyz, h1 = vec3(NUMBERS(k, 4).w, NUMBERS(k, 5).xy);
    vec3 h2 = vec3(NUMBERS(k, 5).zw, NUMBERS(k, 6).x), v = vec3(s, 1.0);
    return vec2(dot(h0, v), dot(h1, v)) / dot(h2, v);
}

vec3 projected(int k, vec3 d)
{
    vec4 camera = NUMBERS(k, 0);
    vec2 size = NUMBERS(k, 6).zw;
    vec2 p = camera.xy * lens_image(k, vec2(d.x, -d.y) / max(-d.z, 1e-9)) + camera.zw, base = floor(p), f = p - base;
    vec3 total = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 at = base + vec2(float(i & 1), float(i >> 1));
        float w = ((i & 1) == 1 ? f.x : 1.0 - f.x) * ((i >> 1) == 1 ? f.y : 1.0 - f.y);
        bool inside = all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, size));
        if (inside) total += w * texelFetch(profile[k], ivec2(at) + ivec2(0, 1), 0).rgb;
    }
    return d.z < 0.0 ? total : vec3(0.0);
}
