// Which material group each sample belongs to, as a depth, so that a group's program runs on its own samples only.
uniform sampler2D g_surface;
uniform sampler2D bodies;  // by body: material row, group

layout(location = 0) out vec4 radiance;

void main()
{
    Sample s = locate();
    if (s.texel.x < 0) discard;
    float body = texelFetch(g_surface, s.texel, 0).w;
    if (body < 0.0) discard;
    radiance = vec4(0.0);
    gl_FragDepth = (texelFetch(bodies, ivec2(int(body) & 4095, int(body) >> 12), 0).y + 1.0) / 65536.0;
}
