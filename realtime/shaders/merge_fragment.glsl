// A pixel's 2 x 2 samples as one, where they lie on one smooth surface; else the pixel is left to its samples.
uniform sampler2D g_surface;
uniform sampler2D g_facet;
uniform sampler2D bodies;  // by body: material row, group

layout(location = 0) out vec4 surface;
layout(location = 1) out vec4 facet;

const float BENT = 0.02;    // rad between a sample's normal and their mean
const float APART = 1e-3;   // of the depth, between a sample and the first one's facet, moved to their mean

void main()
{
    ivec2 first = 2 * ivec2(gl_FragCoord.xy);
    vec4 s[4];
    for (int i = 0; i < 4; ++i) s[i] = texelFetch(g_surface, first + ivec2(i & 1, i >> 1), 0);
    float body = max(max(s[0].w, s[1].w), max(s[2].w, s[3].w));
    if (body < 0.0) discard;
    facet = texelFetch(g_facet, first, 0);
    vec4 mean = 0.25 * (s[0] + s[1] + s[2] + s[3]);
    // bent is measured in the octahedron: a step de of the code turns the normal by |dv| / |v| at most
    vec2 across = vec2(mean.y >= 0.0 ? 1.0 : -1.0, mean.z >= 0.0 ? 1.0 : -1.0);
    vec3 v = vec3(mean.yz, 1.0 - dot(across, mean.yz));
    v.xy += min(v.z, 0.0) * across;
    float least = BENT * BENT * dot(v, v);
#ifdef TANGENT
    vec3 t[4], b1, b2;
    for (int i = 0; i < 4; ++i) {
        basis(from_octahedral(s[i].yz), b1, b2);
        vec2 turn = from_diamond(texelFetch(g_facet, first + ivec2(i & 1, i >> 1), 0).z);
        t[i] = turn.x * b1 + turn.y * b2;
    }
    vec3 tangent = 0.25 * (t[0] + t[1] + t[2] + t[3]);
#endif
    bool smooth_here = true, alike = true;
    for (int i = 0; i < 4; ++i) {
        vec2 off = vec2(i & 1, i >> 1) - 0.5, de = s[i].yz - mean.yz;
        float dz = dot(across, de);
        smooth_here = smooth_here && s[i].w == body && dot(de, de) + dz * dz < least
            && abs(s[i].x - mean.x - dot(facet.xy, off)) < APART * abs(mean.x);
        alike = alike && (s[i].w == body || s[i].w < 0.0);
#ifdef TANGENT
        vec3 swirl = t[i] - tangent;
        smooth_here = smooth_here && dot(swirl, swirl) < BENT * BENT;
#endif
    }
    surface = vec4(mean.xyz, body);
    facet.xy *= 2.0;
#ifdef TANGENT
    basis(from_octahedral(mean.yz), b1, b2);
    facet.z = diamond(vec2(dot(tangent, b1), dot(tangent, b2)));
#endif
    float group = texelFetch(bodies, ivec2(int(body) & 4095, int(body) >> 12), 0).y;
    gl_FragDepth = smooth_here ? (group + 1.0) / 65536.0 : alike ? ALIKE + (group + 1.0) / 65536.0 : AMONG;
}
