// A tile of 32 x 32 pixels as one point; those that show nothing of what is drawn fall outside.
uniform float screen_depth;
uniform usampler2D tiles;
uniform uvec2 wanted;

void main()
{
    ivec2 count = textureSize(tiles, 0), tile = ivec2(gl_VertexID % count.x, gl_VertexID / count.x);
    bool there = any(notEqual(texelFetch(tiles, tile, 0).xy & wanted, uvec2(0u)));
    gl_Position = there ? vec4((vec2(tile) + 0.5) * 2.0 / vec2(count) - 1.0, screen_depth, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 32.0;
#ifdef HOLDS
    hold();
#endif
}
