// One triangle that covers the window.
uniform float screen_depth;

void main()
{
    gl_Position = vec4(float(gl_VertexID & 1) * 4.0 - 1.0, float(gl_VertexID >> 1) * 4.0 - 1.0, screen_depth, 1.0);
#ifdef HOLDS
    hold();
#endif
}
