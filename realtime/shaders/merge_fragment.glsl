// A pixel's 2 x 2 samples as one, where they lie on one smooth surface; else the pixel is left to its samples.
uniform sampler2D bodies;  // by body: material row, group

layout(location = 0) out vec4 surface;
layout(location = 1) out vec4 facet;

const float BENT = 0.02;    // rad between a sample's normal and their mean
const float APART = 1e-3;   // of the depth, between a sample and the first one's facet, moved to their mean

ivec2 first;
precise vec4 mean;
vec2 across;
float body, least;
#ifdef TANGENT
vec3 tangent;

vec3 tangent_of(vec4 s, ivec2 step)
{
    vec3 b1, b2;
    basis(from_octahedral(s.yz), b1, b2);
    vec2 turn = from_diamond(texelFetch(g_facet, first + step, 0).z);
    return turn.x * b1 + turn.y * b2;
}
#endif

// Whether a sample lies on the surface that the mean stands for.
bool agrees(vec4 s, ivec2 step)
{
    vec2 de = s.yz - mean.yz;
    float dz = dot(across, de);
    bool found = s.w == body && dot(de, de) + dz * dz < least
        && abs(s.x - mean.x - dot(facet.xy, vec2(step) - 0.5)) < APART * abs(mean.x);
#ifdef TANGENT
    vec3 swirl = tangent_of(s, step) - tangent;
    found = found && dot(swirl, swirl) < BENT * BENT;
#endif
    return found;
}

// Written out: a loop would index the samples at run time, which costs a software rasteriser more than all the rest.
void main()
{
    first = 2 * ivec2(gl_FragCoord.xy);
    const ivec2 RIGHT = ivec2(1, 0), UP = ivec2(0, 1);
#ifdef COMPACT
    uvec4 corner = texelFetch(g_surface, first, 0);
    vec4 a = surface_of(corner), b = surface_of(texelFetch(g_surface, first + RIGHT, 0));
    vec4 c = surface_of(texelFetch(g_surface, first + UP, 0)), d = surface_of(texelFetch(g_surface, first + 1, 0));
#else
    vec4 a = texelFetch(g_surface, first, 0), b = texelFetch(g_surface, first + RIGHT, 0);
    vec4 c = texelFetch(g_surface, first + UP, 0), d = texelFetch(g_surface, first + 1, 0);
#endif
    body = max(max(a.w, b.w), max(c.w, d.w));
    if (body < 0.0) discard;
#ifdef COMPACT
    facet = vec4(slopes_of(corner.w, a.x), 0.0, 0.0);
#else
    facet = texelFetch(g_facet, first, 0);
#endif
    mean = 0.25 * (a + b + c + d);
    // bent is measured in the octahedron: a step de of the code turns the normal by |dv| / |v| at most
    across = vec2(mean.y >= 0.0 ? 1.0 : -1.0, mean.z >= 0.0 ? 1.0 : -1.0);
    vec3 v = vec3(mean.yz, 1.0 - dot(across, mean.yz));
    v.xy += min(v.z, 0.0) * across;
    least = BENT * BENT * dot(v, v);
#ifdef TANGENT
    tangent = 0.25 * (tangent_of(a, ivec2(0)) + tangent_of(b, RIGHT) + tangent_of(c, UP) + tangent_of(d, ivec2(1)));
#endif
    bool smooth_here = agrees(a, ivec2(0)) && agrees(b, RIGHT) && agrees(c, UP) && agrees(d, ivec2(1));
    vec4 of = vec4(a.w, b.w, c.w, d.w);
    bool alike = all(lessThan(min(abs(of - body), of + 1.0), vec4(0.5)));  // each is the body or nothing
    surface = vec4(mean.xyz, body);
#ifdef COMPACT
    facet.xy = vec2(b.x - a.x + d.x - c.x, c.x - a.x + d.x - b.x);
#else
    facet.xy *= 2.0;
#endif
#ifdef TANGENT
    vec3 b1, b2;
    basis(from_octahedral(mean.yz), b1, b2);
    facet.z = diamond(vec2(dot(tangent, b1), dot(tangent, b2)));
#endif
    float group = texelFetch(bodies, ivec2(int(body) & 4095, int(body) >> 12), 0).y;
    gl_FragDepth = smooth_here ? (group + 1.0) / 65536.0 : alike ? ALIKE + (group + 1.0) / 65536.0 : AMONG;
}
