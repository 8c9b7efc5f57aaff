// The texel of the view that a sample's ray meets, and the ray.
// LENS: a wide view without distortion is looked up; THROUGH: the view is drawn through the lens.
struct Sample {
    ivec2 texel;  // x < 0: the lens sees nothing
    vec2 d;       // the ray's X / Z and Y / Z (X and Y if telecentric)
    vec2 off;     // of the ray from the texel's centre, texels
    vec4 step;    // of the ray, from one texel to the next: to the right, down; but for THROUGH (1 / focal, 0, 0, 1 / focal)
};

#ifdef HOLDS
flat in vec4 view_rows[4];  // of world_from_eye; focal, centre
#define pinhole view_rows[3]
#define to_world(v) vec3(dot(view_rows[0].xyz, v), dot(view_rows[1].xyz, v), dot(view_rows[2].xyz, v))
#define eye vec3(view_rows[0].w, view_rows[1].w, view_rows[2].w)
#else
uniform vec4 pinhole;  // focal, centre
#endif
#if defined(LENS) || defined(THROUGH)
uniform sampler2D lens;
uniform vec2 jitter;    // px
uniform vec2 aperture;  // the eye's shift over the distance in focus
uniform float grid;     // samples a pixel along one side

// The ray through a place of the image, px from its corner, and its change over a pixel.
void ray(vec2 at, out vec2 d, out vec4 change)
{
    vec2 size = vec2(textureSize(lens, 0)), corner = clamp(floor(at), vec2(0.0), size - 2.0), f = at - corner;
    vec2 between = (corner + 1.0) / size;
    vec4 x = textureGather(lens, between, 0), y = textureGather(lens, between, 1);  // below left, right, above right, left
    vec2 a = vec2(x.w, y.w), b = vec2(x.z, y.z), c = vec2(x.x, y.x), e = vec2(x.y, y.y);
    vec2 low = mix(a, b, f.x), high = mix(c, e, f.x);
    d = mix(low, high, f.y);
    change = vec4(mix(b - a, e - c, f.y), high - low);
}
#endif

Sample located(ivec2 texel)
{
#ifdef THROUGH
    Sample s = Sample(texel, vec2(0.0), vec2(0.0), vec4(0.0));
    ray((vec2(texel) + 0.5) / grid + jitter, s.d, s.step);
    if (!(dot(s.d, s.d) < 1e12)) return Sample(ivec2(-1), vec2(0.0), vec2(0.0), vec4(1.0, 0.0, 0.0, 1.0));
    s.d -= aperture;
    s.step /= grid;
    return s;
#else
    return Sample(texel, (vec2(texel) + 0.5 - pinhole.zw) / pinhole.xy, vec2(0.0), vec4(1.0 / pinhole.x, 0.0, 0.0, 1.0 / pinhole.y));
#endif
}

Sample locate()
{
#ifdef LENS
    vec2 d;
    vec4 change;
    ray(gl_FragCoord.xy / grid + jitter, d, change);
    vec4 step = vec4(1.0 / pinhole.x, 0.0, 0.0, 1.0 / pinhole.y);
    if (!(dot(d, d) < 1e12)) return Sample(ivec2(-1), vec2(0.0), vec2(0.0), step);
    vec2 window = (d - aperture) * pinhole.xy + pinhole.zw;
    ivec2 texel = ivec2(floor(window));
    return Sample(texel, (window - pinhole.zw) / pinhole.xy, window - (vec2(texel) + 0.5), step);
#else
    return located(ivec2(gl_FragCoord.xy));
#endif
}

// The slopes of what changes by ``slope`` from texel to texel, by the ray.
vec2 by_ray(Sample s, vec2 slope)
{
#ifdef THROUGH
    vec4 t = s.step;
    return vec2(t.w * slope.x - t.y * slope.y, t.x * slope.y - t.z * slope.x) / (t.x * t.w - t.y * t.z);
#else
    return slope * pinhole.xy;
#endif
}
