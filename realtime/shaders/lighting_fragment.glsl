// Radiance of the samples of one material group, by the chunk of lamps at hand.
// LIT: instead of radiance, (share of the lamps' points that are seen, points that face the surface).
uniform sampler2D bodies;  // by body: material row, group
#ifdef UV
uniform sampler2D g_coordinates;
#ifdef LENS
uniform sampler2D g_slopes;
#endif
#endif
#ifdef PICK
uniform float group;
uniform int picks;  // 4, each of a pixel's 2 x 2 texels; not a constant, for compilers that would write the loop out
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

vec4 light_of(Sample s)
{
#ifdef BLIND
    s.texel = max(s.texel, ivec2(0));
#endif
    vec4 met, slope;
    surface_at(s.texel, met, slope);
    float q = met.x + dot(slope.xy, s.off);
#ifdef TELECENTRIC
    vec3 ray = vec3(s.d, q), eye_ray = vec3(0.0, 0.0, 1.0);
#else
    vec3 ray = vec3(s.d, 1.0) / q, eye_ray = normalize(vec3(s.d, 1.0));
#endif
    vec3 p = to_world(ray) + eye;
    vec3 view = -to_world(eye_ray);
    vec3 facet = facet_normal(q, by_ray(s, slope.xy), s.d);
    facet = to_world(facet);
    vec3 drawn = from_octahedral(met.yz), tangent, bitangent;
    vec3 normal = dot(drawn, facet) < 0.0 ? -drawn : drawn;
    // an interpolated normal may turn away from the eye at a silhouette, where the surface itself does not
    float cosine = dot(normal, view);
    normal = cosine < 1e-3 ? normalize(normal + (1e-3 - cosine) * view) : normal;
#ifdef ISOTROPIC
    basis(normal, tangent, bitangent);
#else
    basis(drawn, tangent, bitangent);
    vec2 turn = from_diamond(slope.z);
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
    st = (st * met.x + moved) / q;
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
    int body = max(int(met.w), 0);
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
#ifdef BLIND
    if (s.texel.x < 0) return vec4(0.0);
#endif
#ifdef PICK
    return met.w >= 0.0 && place.y == group ? vec4(0.25 * total, 0.25) : vec4(0.0);
#else
    return vec4(total, 1.0);
#endif
}

void main()
{
#ifdef PICK
    radiance = vec4(0.0);
    for (int i = 0; i < picks; ++i) radiance += light_of(located(2 * ivec2(gl_FragCoord.xy) + ivec2(i & 1, i >> 1)));
#else
    radiance = light_of(locate());
#endif
}
