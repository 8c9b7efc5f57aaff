// The texel of the view that a sample's ray meets, and the ray.
struct Sample {
    ivec2 texel;  // x < 0: the lens sees nothing
    vec2 d;       // the ray's X / Z and Y / Z (X and Y if telecentric)
    vec2 off;     // of the ray from the texel's centre, texels
};

#ifdef HOLDS
flat in vec4 view_rows[4];  // of world_from_eye; focal, centre
#define pinhole view_rows[3]
#define to_world(v) vec3(dot(view_rows[0].xyz, v), dot(view_rows[1].xyz, v), dot(view_rows[2].xyz, v))
#define eye vec3(view_rows[0].w, view_rows[1].w, view_rows[2].w)
#else
uniform vec4 pinhole;  // focal, centre
#endif
#ifdef LENS
uniform sampler2D lens;
uniform vec2 jitter;    // px
uniform vec2 aperture;  // the eye's shift over the distance in focus
uniform float grid;     // samples a pixel along one side
#endif

Sample located(ivec2 texel)
{
    return Sample(texel, (vec2(texel) + 0.5 - pinhole.zw) / pinhole.xy, vec2(0.0));
}

Sample locate()
{
#ifdef LENS
    vec2 at = gl_FragCoord.xy / grid + jitter;
    ivec2 corner = ivec2(clamp(floor(at), vec2(0.0), vec2(textureSize(lens, 0)) - 2.0));
    vec2 f = at - vec2(corner);
    vec2 d = mix(
        mix(texelFetch(lens, corner, 0).xy, texelFetch(lens, corner + ivec2(1, 0), 0).xy, f.x),
        mix(texelFetch(lens, corner + ivec2(0, 1), 0).xy, texelFetch(lens, corner + ivec2(1, 1), 0).xy, f.x), f.y);
    if (!(dot(d, d) < 1e12)) return Sample(ivec2(-1), vec2(0.0), vec2(0.0));
    vec2 window = (d - aperture) * pinhole.xy + pinhole.zw;
    ivec2 texel = ivec2(floor(window));
    return Sample(texel, (window - pinhole.zw) / pinhole.xy, window - (vec2(texel) + 0.5));
#else
    return located(ivec2(gl_FragCoord.xy));
#endif
}
