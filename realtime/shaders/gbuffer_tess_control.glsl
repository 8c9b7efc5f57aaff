// Into how many pieces each edge of a face is split (realtime.through); the same for both faces that share it.
layout(vertices = 3) out;

in vec3 world[];
in vec3 n[];
#ifdef TANGENT
in vec4 t[];
#endif
#ifdef ST
in vec2 st[];
#endif
in float corner_body[];

out vec3 corner[];
out vec3 corner_n[];
#ifdef TANGENT
out vec4 corner_t[];
#endif
#ifdef ST
out vec2 corner_st[];
#endif
out float of_body[];

uniform mat4 eye_from_world;
uniform mat4 wide_from_world;  // clip matrix of what the lens sees
uniform float reach[RINGS + 1];
uniform float widest;
uniform float shortest;        // an edge that stays whole, m
uniform float nearest;         // that the surface may be, m

float angle_of(vec3 p)
{
#ifdef TELECENTRIC
    return length(p.xy);
#else
    return atan(length(p.xy), p.z);
#endif
}

// Of the edge between two corners in the eye's frame.
float pieces(vec3 p, vec3 q)
{
    // in one order, so that both faces of the edge round alike
    bool turned = p.x < q.x || (p.x == q.x && (p.y < q.y || (p.y == q.y && p.z < q.z)));
    vec3 a = turned ? q : p, b = turned ? p : q, along = b - a;
    float size = length(along);
    // no point between is at a greater angle, as cones are convex
    float angle = max(angle_of(a), angle_of(b));
    int ring = int(ceil(clamp(angle / widest, 0.0, 1.0) * float(RINGS)));
#ifdef TELECENTRIC
    float steps = length(along.xy) / reach[ring];
#else
    // a + t (b - a) turns by |a x b| / distance² a step of t, and the inside of a face of this size is little nearer
    float away = max(nearest, 0.98 * length(a + clamp(-dot(a, along) / (size * size), 0.0, 1.0) * along));
    float steps = length(cross(a, b)) / (away * away * reach[ring]);
#endif
    return size <= 1.0001 * shortest ? 1.0 : clamp(ceil(steps), 1.0, LEVELS);
}

void main()
{
    corner[gl_InvocationID] = world[gl_InvocationID];
    corner_n[gl_InvocationID] = n[gl_InvocationID];
#ifdef TANGENT
    corner_t[gl_InvocationID] = t[gl_InvocationID];
#endif
#ifdef ST
    corner_st[gl_InvocationID] = st[gl_InvocationID];
#endif
    of_body[gl_InvocationID] = corner_body[gl_InvocationID];
    if (gl_InvocationID != 0) return;
    vec4 a = wide_from_world * vec4(world[0], 1.0);
    vec4 b = wide_from_world * vec4(world[1], 1.0);
    vec4 c = wide_from_world * vec4(world[2], 1.0);
    vec3 low = max(max(a.xyz + vec3(a.ww, 0.0), b.xyz + vec3(b.ww, 0.0)), c.xyz + vec3(c.ww, 0.0));
    vec3 high = min(min(a.xyz - a.w, b.xyz - b.w), c.xyz - c.w);
    bool outside = any(lessThan(low, vec3(0.0))) || any(greaterThan(high, vec3(0.0)));
    vec3 eye[3];
    for (int i = 0; i < 3; ++i) eye[i] = (eye_from_world * vec4(world[i], 1.0)).xyz;
    gl_TessLevelOuter[0] = outside ? 0.0 : pieces(eye[1], eye[2]);
    gl_TessLevelOuter[1] = outside ? 0.0 : pieces(eye[2], eye[0]);
    gl_TessLevelOuter[2] = outside ? 0.0 : pieces(eye[0], eye[1]);
    gl_TessLevelInner[0] = max(gl_TessLevelOuter[0], max(gl_TessLevelOuter[1], gl_TessLevelOuter[2]));
}
