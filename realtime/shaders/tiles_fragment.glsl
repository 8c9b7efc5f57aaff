// Which depths a tile of 32 x 32 pixels holds, bit by bit: of pixels lit once, and of those lit sample by sample.
uniform sampler2D sorted_by;
layout(location = 0) out uvec2 found;

void main()
{
    ivec2 first = 32 * ivec2(gl_FragCoord.xy);
    vec2 texel = 1.0 / vec2(textureSize(sorted_by, 0));
    found = uvec2(0u);
    for (int j = 1; j < 32; j += 2)
        for (int i = 1; i < 32; i += 2) {
            uvec4 number = uvec4(textureGather(sorted_by, vec2(first + ivec2(i, j)) * texel) * 65536.0 + 0.5);
            uvec4 bit = uvec4(1u) << (number & 31u);
            uvec4 once = bit * uvec4(lessThan(number - 1u, uvec4(16383u)));
            uvec4 each = bit * uvec4(greaterThanEqual(number, uvec4(16384u)));
            found |= uvec2(once.x | once.y | once.z | once.w, each.x | each.y | each.z | each.w);
        }
}
