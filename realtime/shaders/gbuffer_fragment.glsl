// What each texel of the view shows: the facet's plane, the shading frame, texture coordinates, ids.
in vec3 n;
in vec4 t;
in vec2 st;
in float z;
flat in vec2 id;

uniform mat3 world_from_eye;
uniform vec4 pinhole;  // focal, centre
uniform int sample_index;

layout(location = 0) out vec4 plane;   // 1/Z (Z if telecentric), its slopes along the window, body
layout(location = 1) out vec4 frame;   // octahedral normal, the tangent's direction, material row
#ifdef UV
layout(location = 2) out vec4 coordinates;  // u, v
#ifdef SLOPES
layout(location = 3) out vec4 slopes;  // of u/Z and v/Z (of u and v if telecentric)
#endif
#endif

#ifdef OPACITY
uniform float opacity;
uniform float threshold;
#endif

void main()
{
#ifdef OPACITY
    float share = opacity;
#ifdef OPACITY_MAP
    share = sampled(opacity_map, opacity_map_uv, opacity_map_wrap, st).x;
#endif
    if (threshold > 0.0 ? share < threshold : share <= chance(uvec3(gl_FragCoord.xy, uint(id.x)), sample_index)) discard;
#endif

#ifdef TELECENTRIC
    float q = z;
#else
    float q = gl_FragCoord.w;
#endif
    vec2 slope = vec2(dFdx(q), dFdy(q));
    vec2 d = (gl_FragCoord.xy - pinhole.zw) / pinhole.xy;
    vec3 facing = world_from_eye * facet_normal(q, slope, d, pinhole.xy);
#ifdef TELECENTRIC
    vec3 view = -world_from_eye[2];
#else
    vec3 view = -(world_from_eye * normalize(vec3(d, 1.0)));
#endif

    vec3 normal = normalize(n);
#ifdef NORMAL_MAP
    vec3 m = sampled(normal_map, normal_map_uv, normal_map_wrap, st);
    vec3 along = normalize(t.xyz - normal * dot(t.xyz, normal));
    normal = normalize(along * m.x + cross(normal, along) * (m.y * sign(t.w)) + normal * m.z);
#endif
    if (dot(normal, facing) < 0.0) normal = -normal;
    // an interpolated normal may turn away from the eye at a silhouette, where the surface itself does not
    float cosine = dot(normal, view);
    if (cosine < 1e-3) normal = normalize(normal + (1e-3 - cosine) * view);

    vec2 code = octahedral(normal);
    vec3 b1, b2;
    basis(from_octahedral(code), b1, b2);
    plane = vec4(q, slope, id.x);
    frame = vec4(code, diamond(vec2(dot(t.xyz, b1), dot(t.xyz, b2))), id.y);
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
}
