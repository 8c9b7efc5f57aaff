// What each texel of the view shows: the facet's plane, the shading frame, texture coordinates, body. Small triangles
// run this several times a texel, so all that can wait is left to the lighting.
in vec3 n;
#ifdef TANGENT
in vec4 t;
#endif
#ifdef ST
in vec2 st;
#endif
#ifdef TELECENTRIC
in float z;
#endif
flat in float body;

#ifdef COMPACT
layout(location = 0) out uvec4 surface;  // as surface.glsl reads it
uniform vec2 focal;
uniform uint turn;
#else
layout(location = 0) out vec4 surface;  // 1/Z (Z if telecentric), shading normal on either side, body
layout(location = 1) out vec4 facet;    // slopes of 1/Z along the window; the tangent's direction
#endif
#ifdef UV
layout(location = 2) out vec4 coordinates;  // u, v
#ifdef SLOPES
layout(location = 3) out vec4 slopes;  // of u/Z and v/Z (of u and v if telecentric)
#endif
#endif

#ifdef OPACITY
uniform int sample_index;
uniform float opacity;
uniform float threshold;
#endif

void main()
{
#ifdef TELECENTRIC
    float q = z;
#else
    float q = gl_FragCoord.w;
#endif
    vec3 normal = n;  // of any length, where its direction alone is kept
#if defined(NORMAL_MAP) || defined(TANGENT)
    normal = normalize(n);
#endif
#ifdef NORMAL_MAP
    vec3 m = sampled(normal_map, normal_map_uv, normal_map_wrap, st);
    vec3 along = normalize(t.xyz - normal * dot(t.xyz, normal));
    normal = normalize(along * m.x + cross(normal, along) * (m.y * sign(t.w)) + normal * m.z);
#endif
#ifdef COMPACT
    vec2 s = vec2(dFdx(q), dFdy(q)) * focal;
#ifndef TELECENTRIC
    s /= q;
#endif
    uvec2 k = uvec2(round(s / (1.0 + abs(s)) * 127.0) + 128.0);
    surface = uvec4(floatBitsToUint(vec3(q, octahedral(normal))), turn | k.x << 4u | k.y << 12u | uint(body) << 20u);
#else
    surface = vec4(q, octahedral(normal), body);
#ifdef TANGENT
    vec3 b1, b2;
    basis(normal, b1, b2);
    facet = vec4(dFdx(q), dFdy(q), diamond(vec2(dot(t.xyz, b1), dot(t.xyz, b2))), 0.0);
#else
    facet = vec4(dFdx(q), dFdy(q), 0.0, 0.0);
#endif
#endif
#ifdef UV
    coordinates = vec4(st, 0.0, 0.0);
#ifdef SLOPES
#ifdef TELECENTRIC
    vec2 s = st;
#else
    vec2 s = st * q;
#endif
    slopes = vec4(dFdx(s), dFdy(s));
#endif
#endif
#ifdef OPACITY
    // last: slopes next to a discarded texel are undefined after it (GLSL 4.10, 8.12), and wrong on GPUs
    float share = opacity;
#ifdef OPACITY_MAP
    share = sampled(opacity_map, opacity_map_uv, opacity_map_wrap, st).x;
#endif
    if (threshold > 0.0 ? share < threshold : share <= chance(uvec3(gl_FragCoord.xy, layer(body)), sample_index)) discard;
#endif
}
