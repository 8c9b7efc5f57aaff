// Bodies into a shadow map.
in vec3 position;
in vec4 world_x, world_y, world_z;
uniform mat4 clip_from_world;
#ifdef OPACITY
in vec2 uv;
in float number;
out vec2 st;
flat out float body;
#endif

void main()
{
    vec4 p = vec4(position, 1.0);
    gl_Position = clip_from_world * vec4(dot(world_x, p), dot(world_y, p), dot(world_z, p), 1.0);
#ifdef OPACITY
    st = uv;
    body = number;
#endif
}
