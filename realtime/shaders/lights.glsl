// One lamp's sample: its direction, its irradiance on a plane that faces it, and whether it is seen.
// A record of realtime.lamps: STRIDE vec4 a lamp; FACES shadow maps of 8 vec4 each follow from MAPS on.

struct Arrival {
    vec3 direction;  // towards the lamp, world
    vec3 power;      // W/m² on a plane that faces it, before shadow
};

#if defined(HELD) && HELD > 0
// Rows that the vertex shader read for the first HELD lamps; a software rasteriser checks the bounds of a uniform
// block at every number that a pixel reads, which took half of the time.
flat in vec4 held[HELD * ROWS];
const int SLOT[SLOTS] = int[](SLOT_OF_ROW);
#define RECORD(k, i) ((k) < HELD ? held[(k) * ROWS + SLOT[i]] : lights[(k) * STRIDE + (i)])
#else
#define RECORD(k, i) lights[(k) * STRIDE + (i)]
#endif

#if defined(MODE_SPHERE)
// Directions evenly over the solid angle of the sphere: exact at any distance.
Arrival arrival(int k, vec3 p)
{
    vec3 to = RECORD(k, 0).xyz - p;
    float d2 = dot(to, to), radius = RECORD(k, 0).w;
    vec3 axis = to * inversesqrt(d2);
    float sin2 = min(radius * radius / d2, 1.0), cosine = sqrt(1.0 - sin2);
    float gap = sin2 / (1.0 + cosine) * RECORD(k, 2).w;  // 1 - cos of the sample's angle
    vec2 around = RECORD(k, 3).w * vec2(cos(RECORD(k, 4).w), sin(RECORD(k, 4).w));
#if defined(FACES) && FACES == 6
    vec3 a = abs(to);
    vec3 reference = a.x >= a.y && a.x >= a.z ? vec3(sign(to.x), 0.0, 0.0)
        : a.y >= a.z ? vec3(0.0, sign(to.y), 0.0) : vec3(0.0, 0.0, sign(to.z));
#elif defined(FACES)
    vec3 reference = -RECORD(k, 8).xyz;
#else
    vec3 reference = axis;
#endif
    vec3 e1, e2;
    basis(reference, e1, e2);
    vec3 mid = (reference + axis) / (1.0 + max(dot(reference, axis), -0.999));
    e1 -= dot(e1, axis) * mid;
    e2 -= dot(e2, axis) * mid;
    vec3 l = normalize(axis * (1.0 - gap) + sqrt(max(gap * (2.0 - gap), 0.0)) * (e1 * around.x + e2 * around.y));
    return Arrival(l, radius * radius >= d2 ? vec3(0.0) : RECORD(k, 1).xyz * (2.0 / (d2 * (1.0 + cosine))));
}
#elif defined(MODE_POINT)
Arrival arrival(int k, vec3 p)
{
    vec3 to = RECORD(k, 0).xyz - p;
    float d2 = dot(to, to);
    return Arrival(to * inversesqrt(d2), RECORD(k, 1).xyz / d2);
}
#elif defined(MODE_PLANAR)
// A point of a disk or rect: radiance times the cosine at the lamp times its share of the area over distance².
Arrival arrival(int k, vec3 p)
{
    vec3 to = RECORD(k, 0).xyz - p;
    float d2 = dot(to, to);
    vec3 l = to * inversesqrt(d2);
    return Arrival(l, RECORD(k, 1).xyz * (max(dot(l, RECORD(k, 4).xyz), 0.0) / d2));
}
#elif defined(MODE_CYLINDER)
// A point of the arc that faces p, at one spot of the axis; its sine is spread evenly.
Arrival arrival(int k, vec3 p)
{
    vec3 x = RECORD(k, 2).xyz, to_axis = p - RECORD(k, 0).xyz;
    float radius = RECORD(k, 0).w;
    vec3 across = to_axis - x * dot(to_axis, x);
    float rho = length(across), widest = sqrt(max(1.0 - radius * radius / (rho * rho), 0.0));
    vec3 u = across / rho, v = cross(x, u);
    float s = RECORD(k, 2).w * widest, c = sqrt(1.0 - s * s);
    vec3 outward = c * u + s * v;
    vec3 to = RECORD(k, 0).xyz + radius * outward - p;
    float d2 = dot(to, to);
    vec3 l = to * inversesqrt(d2);
    float power = widest * max(-dot(outward, l), 0.0) / (c * d2);
    return Arrival(l, rho > radius ? RECORD(k, 1).xyz * power : vec3(0.0));
}
#elif defined(MODE_DIRECTION)
Arrival arrival(int k, vec3 p)
{
    return Arrival(RECORD(k, 0).xyz, RECORD(k, 1).xyz);
}
#endif

float angle_of(float cosine)
{
    // Abramowitz, Stegun: Handbook of mathematical functions. 4.4.46, to 2e-8.
    float x = min(abs(cosine), 1.0);
    float p = 1.5707963050 + x * (-0.2145988016 + x * (0.0889789874 + x * (-0.0501743046
        + x * (0.0308918810 + x * (-0.0170881256 + x * (0.0066700901 - x * 0.0012624911))))));
    p *= sqrt(1.0 - x);
    return cosine < 0.0 ? 3.14159265359 - p : p;
}

#ifdef SHAPED
// interchange.light.Light.shaping; l points to the lamp.
vec3 shaping(int k, vec3 l)
{
    vec3 d = -vec3(dot(RECORD(k, 2).xyz, l), dot(RECORD(k, 3).xyz, l), dot(RECORD(k, 4).xyz, l));
    float theta = angle_of(-d.z);
#if defined(FACES) && FACES == 1 && !defined(FOCUSED) && !defined(PROFILED)
    float start = RECORD(k, 1).w, end = RECORD(k, MAPS + 5).w;  // a copy, where rows are read in any case
#else
    float start = RECORD(k, 5).x, end = RECORD(k, 5).y;
#endif
    float t = clamp((theta - start) / max(end - start, 1e-12), 0.0, 1.0);
    float cone = end > start ? 1.0 - t * t * (3.0 - 2.0 * t) : (theta <= end ? 1.0 : 0.0);
    vec3 factor = vec3(cone);
#ifdef FOCUSED
    float share = pow(abs(d.z), RECORD(k, 5).z);
    factor *= share + (1.0 - share) * RECORD(k, 6).xyz;
#endif
#if defined(PROJECTED)
    factor *= projected(k, d);
#elif defined(PROFILED)
    float scale = RECORD(k, 5).w;
    float angle = scale > 0.0 ? theta / scale : scale < 0.0 ? (theta - 3.14159265359) / -scale + 3.14159265359 : theta;
    factor *= candela(k, angle, atan(d.y, d.x));
#endif
    return factor;
}
#endif

#if defined(FACES) && FACES == 1
#define MAP_RECORD(k, i) RECORD(k, i)
// first column * 4096 + first row of the part of the map that is kept
#if defined(MODE_SPHERE) || defined(MODE_CYLINDER)
#define CROP(k) RECORD(k, MAPS + 6).w
#else
#define CROP(k) RECORD(k, 0).w
#endif
#elif defined(FACES)
#define MAP_RECORD(k, i) lights[(k) * STRIDE + (i)]  // which is found at run time
#endif

#ifdef FACES
// The share of the four nearest texels that see p: each compares with the receiver's own plane at its centre,
// so that a facet never shades itself and no depth offset parts a shadow from what casts it.
// A map's rows: clip x, y, depth, w; right and up, scaled to a texel's slope, the first with the near plane's
// distance; the lamp's place, or light's direction.
float seen(int k, vec3 p, vec3 facet)
{
    // texels a side, the inverse of those kept, world size of a texel (at unit depth), least offset of depth; or,
    // below 0, how far points stand off
    vec4 setting = RECORD(k, 7);
    p += max(-setting.w, 0.0) * facet;
    float least = max(setting.w, 0.0);
#if FACES == 6
    vec3 to = p - RECORD(k, 0).xyz, a = abs(to);
    int face = a.x >= a.y && a.x >= a.z ? (to.x > 0.0 ? 0 : 1) : a.y >= a.z ? (to.y > 0.0 ? 2 : 3) : (to.z > 0.0 ? 4 : 5);
    vec2 tile = vec2(float(face % 3), float(face / 3));
#else
    const int face = 0;
    const vec2 tile = vec2(0.0);
#endif
    int m = MAPS + 8 * face;
    vec4 q = vec4(p, 1.0);
    vec2 c = vec2(dot(MAP_RECORD(k, m), q), dot(MAP_RECORD(k, m + 1), q));
    vec2 slope = vec2(dot(MAP_RECORD(k, m + 4).xyz, facet), dot(MAP_RECORD(k, m + 5).xyz, facet));
#ifdef MODE_DIRECTION
    float height = -dot(MAP_RECORD(k, m + 6).xyz, facet);
    float depth = dot(MAP_RECORD(k, m + 2), q) + (0.2 * setting.z + least) * MAP_RECORD(k, m + 6).w / height;
    slope /= height;
    bool outside = false;
#else
    float w = dot(MAP_RECORD(k, m + 3), q);
#if defined(MODE_POINT) || defined(MODE_PLANAR)
    vec3 place = RECORD(k, 0).xyz;
#else
    vec3 place = MAP_RECORD(k, m + 6).xyz;
#endif
    float height = dot(place - p, facet);
    float near = MAP_RECORD(k, m + 4).w / max(height - 0.2 * setting.z * w - least, 0.1 * height);
    float depth = near * height / w;
    slope *= near;
    c /= w;
    bool outside = w <= 0.0;
#endif
    vec2 at = (c * 0.5 + 0.5) * setting.x - 0.5, base = floor(at), f = at - base;
    float here = depth + dot(slope, f);
    vec4 receiver = vec4(here - slope.y, here - slope.x - slope.y, here - slope.x, here);
#if FACES == 6
    outside = outside || min(base.x, base.y) < 0.0 || max(base.x, base.y) + 1.0 >= setting.x;
    vec2 uv = (base + 1.0 + tile * setting.x) * setting.y * vec2(1.0 / 3.0, 0.5);
#else
    float column = floor(CROP(k) / 4096.0), row = CROP(k) - 4096.0 * column;
    vec2 uv = (base + 1.0 - vec2(column, row)) * setting.y, off = abs(uv - 0.5);
    outside = outside || max(off.x, off.y) > 0.5 - 0.5 * setting.y;
#endif
    vec4 caster = textureGather(shadow_map[k], uv);
    vec4 open = vec4(lessThanEqual(caster, receiver));
    return outside ? 1.0 : mix(mix(open.w, open.z, f.x), mix(open.x, open.y, f.x), f.y);
}
#endif
