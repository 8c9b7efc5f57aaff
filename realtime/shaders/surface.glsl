// What a view shows at a texel: 1/Z (Z if telecentric), shading normal (octahedral), body (-1: none); and the slopes of
// the first along the window.
// COMPACT: the slopes in 2 x 8 bits, the body in 12, and the turn in 4: what bears another turn's number is left over
// from an earlier image, since clearing costs as much as a tenth of all drawing.
#ifdef COMPACT
uniform usampler2D g_surface;
uniform vec2 focal;  // of the view, texels
uniform uint turn;   // 1 to 15

vec4 surface_of(uvec4 texel)
{
    return vec4(uintBitsToFloat(texel.xyz), (texel.w & 15u) == turn ? float(texel.w >> 20u) : -1.0);
}

vec2 slopes_of(uint rest, float q)
{
    vec2 u = clamp((vec2((rest >> 4u) & 255u, (rest >> 12u) & 255u) - 128.0) / 127.0, -0.99, 0.99);
#ifdef TELECENTRIC
    q = 1.0;
#endif
    return u / (1.0 - abs(u)) * q / focal;
}

void surface_at(ivec2 texel, out vec4 met, out vec4 slope)
{
    uvec4 found = texelFetch(g_surface, texel, 0);
    met = surface_of(found);
    slope = vec4(slopes_of(found.w, met.x), 0.0, 0.0);
}
#else
uniform sampler2D g_surface;
uniform sampler2D g_facet;

void surface_at(ivec2 texel, out vec4 met, out vec4 slope)
{
    met = texelFetch(g_surface, texel, 0);
    slope = texelFetch(g_facet, texel, 0);
}
#endif
