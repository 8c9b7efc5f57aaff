// A lamp that the camera sees itself: its radiance where a ray meets it before any surface.
uniform sampler2D g_surface;
uniform sampler2D g_facet;
uniform mat4 world_from_eye;
uniform vec3 lamp_radiance;
uniform vec4 extent;  // radius, width, height, length (m); distant light: cosine of its half-angle first

layout(location = 0) out vec4 radiance;

float distance_to(vec3 o, vec3 v)
{
    // in the lamp's frame; negative where the ray misses
#if defined(KIND_SPHERE)
    float b = dot(o, v), c = dot(o, o) - extent.x * extent.x, h = b * b - c;
    return c < 0.0 || h < 0.0 ? -1.0 : -b - sqrt(h);
#elif defined(KIND_DISK) || defined(KIND_RECT)
    float t = v.z > 0.0 ? -o.z / v.z : -1.0;  // it shines along -z
    vec2 at = o.xy + t * v.xy;
#ifdef KIND_DISK
    return dot(at, at) <= extent.x * extent.x ? t : -1.0;
#else
    return all(lessThanEqual(abs(at), extent.yz / 2.0)) ? t : -1.0;
#endif
#elif defined(KIND_CYLINDER)
    float a = dot(v.yz, v.yz), b = dot(o.yz, v.yz), c = dot(o.yz, o.yz) - extent.x * extent.x, h = b * b - a * c;
    float t = c < 0.0 || h < 0.0 ? -1.0 : (-b - sqrt(h)) / a;
    return abs(o.x + t * v.x) <= extent.w / 2.0 ? t : -1.0;
#else
    return 1e30;
#endif
}

void main()
{
    Sample s = locate();
    if (s.texel.x < 0) discard;
    vec4 met = texelFetch(g_surface, s.texel, 0);
    float q = met.x + dot(texelFetch(g_facet, s.texel, 0).xy, s.off);
#ifdef TELECENTRIC
    vec3 o = vec3(s.d, 0.0), v = vec3(0.0, 0.0, 1.0);
    float surface = q;
#else
    vec3 o = vec3(0.0), v = normalize(vec3(s.d, 1.0));
    float surface = 1.0 / (q * v.z);
#endif
    o = (world_from_eye * vec4(o, 1.0)).xyz - RECORD(0, 0).xyz;
    v = mat3(world_from_eye) * v;
    mat3 world_from_lamp = mat3(RECORD(0, 2).xyz, RECORD(0, 3).xyz, RECORD(0, 4).xyz);
    o = o * world_from_lamp;
    vec3 towards = v * world_from_lamp;
    float t = distance_to(o, towards);
    if (t <= 0.0 || (met.w >= 0.0 && t >= surface)) discard;
#ifdef KIND_DISTANT
    if (towards.z < extent.x) discard;
#endif
    vec3 light = lamp_radiance;
#ifdef KIND_RECT_MAP
    vec3 at = o + t * towards;
    light *= GREY(sampled(lamp_map, lamp_map_uv, lamp_map_wrap, vec2(0.5 - at.x / extent.y, 0.5 + at.y / extent.z)));
#endif
#ifdef KIND_DOME_MAP
    vec2 uv = vec2(fract(atan(towards.z, towards.x) / 6.28318530718 + 0.25), 1.0 - angle_of(towards.y) / 3.14159265359);
    light *= GREY(sampled(lamp_map, lamp_map_uv, lamp_map_wrap, uv));
#endif
#ifdef SHAPED
    light *= shaping(0, v);
#endif
    radiance = vec4(light, 0.0);
    gl_FragDepth = 0.0;  // no surface is lit here
}
