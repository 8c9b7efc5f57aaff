// A pixel's 2 x 2 samples as one, where they lie on one smooth surface; else the pixel is left to its samples.
uniform sampler2D g_plane;
uniform sampler2D g_frame;
uniform sampler2D bodies;  // by body: material row, group

layout(location = 0) out vec4 plane;
layout(location = 1) out vec4 frame;

const float BENT = 0.02;    // rad between a sample's normal and their mean
const float APART = 1e-3;   // of the depth, between a sample and their common plane

void main()
{
    ivec2 first = 2 * ivec2(gl_FragCoord.xy);
    vec4 p[4], f[4];
    for (int i = 0; i < 4; ++i) {
        p[i] = texelFetch(g_plane, first + ivec2(i & 1, i >> 1), 0);
        f[i] = texelFetch(g_frame, first + ivec2(i & 1, i >> 1), 0);
    }
    if (max(max(p[0].w, p[1].w), max(p[2].w, p[3].w)) < 0.0) discard;
    vec3 q = 0.25 * (p[0].xyz + p[1].xyz + p[2].xyz + p[3].xyz);
    vec3 n = normalize(f[0].xyz + f[1].xyz + f[2].xyz + f[3].xyz);
#ifdef TANGENT
    vec3 t[4], b1, b2;
    for (int i = 0; i < 4; ++i) {
        basis(f[i].xyz, b1, b2);
        vec2 turn = from_diamond(f[i].w);
        t[i] = turn.x * b1 + turn.y * b2;
    }
    vec3 mean = 0.25 * (t[0] + t[1] + t[2] + t[3]);
#endif
    bool smooth_here = true;
    for (int i = 0; i < 4; ++i) {
        vec2 off = vec2(i & 1, i >> 1) - 0.5;
        vec3 bend = f[i].xyz - n;
        smooth_here = smooth_here && p[i].w == p[0].w && dot(bend, bend) < BENT * BENT
            && abs(p[i].x - q.x - dot(q.yz, off)) < APART * abs(q.x);
#ifdef TANGENT
        vec3 swirl = t[i] - mean;
        smooth_here = smooth_here && dot(swirl, swirl) < BENT * BENT;
#endif
    }
    plane = vec4(q.x, 2.0 * q.yz, p[0].w);
#ifdef TANGENT
    basis(n, b1, b2);
    frame = vec4(n, diamond(vec2(dot(mean, b1), dot(mean, b2))));
#else
    frame = vec4(n, 0.0);
#endif
    float group = texelFetch(bodies, ivec2(int(p[0].w) & 4095, int(p[0].w) >> 12), 0).y;
    gl_FragDepth = smooth_here ? (group + 1.0) / 65536.0 : MIXED;
}
