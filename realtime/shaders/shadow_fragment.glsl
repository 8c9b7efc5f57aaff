// Depth alone; surfaces that let light through leave holes at random.
#ifdef OPACITY
in vec2 st;
flat in float body;
uniform float opacity;
uniform float threshold;
uniform int sample_index;
uniform vec2 first;  // texel of the whole map, of which this is a part
#endif

void main()
{
#ifdef OPACITY
    float share = opacity;
#ifdef OPACITY_MAP
    share = sampled(opacity_map, opacity_map_uv, opacity_map_wrap, st).x;
#endif
    if (threshold > 0.0 ? share < threshold : share <= chance(uvec3(gl_FragCoord.xy + first, ~layer(body)), sample_index)) discard;
#endif
}
