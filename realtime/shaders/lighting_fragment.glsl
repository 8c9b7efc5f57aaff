// Radiance of the samples of one material group, by the chunk of lamps at hand.
// LIT: instead of radiance, (share of the lamps' points that are seen, points that face the surface).
uniform sampler2D g_plane;
uniform sampler2D g_frame;
uniform sampler2D bodies;  // by body: material row, group
#ifdef UV
uniform sampler2D g_coordinates;
#ifdef LENS
uniform sampler2D g_slopes;
#endif
#endif
uniform mat4 world_from_eye;
#ifdef PICK
uniform float group;
#endif
uniform float emitting;  // 1 in the draw that adds what surfaces emit

layout(location = 0) out vec4 radiance;

struct Surface {
    vec3 p, normal, tangent, bitangent, facet;  // world; the facet's normal faces the eye
    vec3 wo;                                    // shading frame
    vec2 st;
};

#ifdef LIT
vec3 lamp(int k, Surface x, float values[PARAMETERS])
{
    vec3 l = arrival(k, x.p).direction;
    float faces = dot(l, x.normal) > 0.0 && dot(l, x.facet) > 0.0 ? 1.0 : 0.0;
#ifdef FACES
    return faces * vec3(seen(k, x.p, x.facet), 1.0, 0.0);
#else
    return faces * vec3(1.0, 1.0, 0.0);
#endif
}
#elif LIGHTS > 0
vec3 lamp(int k, Surface x, float values[PARAMETERS])
{
    Arrival a = arrival(k, x.p);
    vec3 l = a.direction, wi = vec3(dot(l, x.tangent), dot(l, x.bitangent), dot(l, x.normal));
    bool reached = wi.z > 0.0 && x.wo.z > 0.0 && dot(l, x.facet) > 0.0;
    vec3 power = a.power * wi.z;
#ifdef SHAPED
    power *= shaping(k, l);
#endif
#ifdef FACES
    power *= seen(k, x.p, x.facet);
#endif
#ifdef FRAGMENT
    return reached ? power * brdf(wi, x.wo, x.st) : vec3(0.0);
#else
    return reached ? power * model(wi, x.wo, values) : vec3(0.0);
#endif
}
#endif

void main()
{
    Sample s = locate();
    vec4 plane = texelFetch(g_plane, s.texel, 0), frame = texelFetch(g_frame, s.texel, 0);
    float q = plane.x + dot(plane.yz, s.off);
#ifdef TELECENTRIC
    vec3 ray = vec3(s.d, q), eye_ray = vec3(0.0, 0.0, 1.0);
#else
    vec3 ray = vec3(s.d, 1.0) / q, eye_ray = normalize(vec3(s.d, 1.0));
#endif
    vec3 p = (world_from_eye * vec4(ray, 1.0)).xyz;
    vec3 view = -(mat3(world_from_eye) * eye_ray);
    vec3 facet = mat3(world_from_eye) * facet_normal(q, plane.yz, s.d, pinhole.xy);
    vec3 normal = dot(frame.xyz, facet) < 0.0 ? -frame.xyz : frame.xyz, tangent, bitangent;
    // an interpolated normal may turn away from the eye at a silhouette, where the surface itself does not
    float cosine = dot(normal, view);
    normal = cosine < 1e-3 ? normalize(normal + (1e-3 - cosine) * view) : normal;
#ifdef ISOTROPIC
    basis(normal, tangent, bitangent);
#else
    basis(frame.xyz, tangent, bitangent);
    vec2 turn = from_diamond(frame.w);
    tangent = turn.x * tangent + turn.y * bitangent;
    tangent = normalize(tangent - dot(tangent, normal) * normal);
    bitangent = cross(normal, tangent);
#endif
#ifdef UV
    vec2 st = texelFetch(g_coordinates, s.texel, 0).xy;
#ifdef LENS
    vec4 slopes = texelFetch(g_slopes, s.texel, 0);
    vec2 moved = slopes.xy * s.off.x + slopes.zw * s.off.y;
#ifdef TELECENTRIC
    st += moved;
#else
    st = (st * plane.x + moved) / q;
#endif
#endif
#else
    const vec2 st = vec2(0.0);
#endif

    float values[PARAMETERS];
    vec3 total = vec3(0.0);
    Surface x = Surface(p, normal, tangent, bitangent, facet,
        vec3(dot(view, tangent), dot(view, bitangent), dot(view, normal)), st);
#ifndef LIT
    vec3 emission;
#if defined(PICK) || !defined(ALONE)
    int body = max(int(plane.w), 0);
    vec2 place = texelFetch(bodies, ivec2(body & 4095, body >> 12), 0).xy;
    int row = int(place.x);
#else
    const int row = 0;
#endif
    material(row, st, values, emission);
    total = emitting * emission;
#endif
    // one call a lamp, written out: a loop would index samplers and records at run time
    ALL_LAMPS
#ifdef PICK
    radiance = plane.w >= 0.0 && place.y == group ? vec4(0.25 * total, 1.0) : vec4(0.0);
#else
    radiance = vec4(total, 1.0);
#endif
}
