// The view and the lamps' rows for the fragment shader: the same for every vertex.
uniform mat4 world_from_eye;
uniform vec4 pinhole;
flat out vec4 view_rows[4];

#if defined(HELD) && HELD > 0
layout(std140) uniform Lights { vec4 lights[LIGHTS * STRIDE]; };
flat out vec4 held[HELD * ROWS];
const int ROW[ROWS] = int[](ROW_OF_SLOT);
#endif

void hold()
{
    for (int i = 0; i < 3; ++i) view_rows[i] = transpose(world_from_eye)[i];
    view_rows[3] = pinhole;
#if defined(HELD) && HELD > 0
    for (int k = 0; k < HELD; ++k)
        for (int i = 0; i < ROWS; ++i) held[k * ROWS + i] = lights[k * STRIDE + ROW[i]];
#endif
}
