// Bodies into the view: positions by the body's transform, normals by its inverse transpose.
// SPLIT: the faces' corners for the tessellator, which projects what it makes of them.
in vec3 position;
in vec3 normal;
#ifdef TANGENT
in vec4 tangent;  // w: handedness of the texture
#endif
#ifdef ST
in vec2 uv;
#endif
in vec4 world_x, world_y, world_z;     // rows of world_from_body
in vec3 normal_x, normal_y, normal_z;  // rows of its inverse transpose
in float number;                       // of the body

void main()
{
    vec4 p = vec4(position, 1.0);
    vec4 w = vec4(dot(world_x, p), dot(world_y, p), dot(world_z, p), 1.0);
    n = vec3(dot(normal_x, normal), dot(normal_y, normal), dot(normal_z, normal));
#ifdef TANGENT
    t = vec4(dot(world_x.xyz, tangent.xyz), dot(world_y.xyz, tangent.xyz), dot(world_z.xyz, tangent.xyz), tangent.w);
#endif
#ifdef ST
    st = uv;
#endif
#ifdef SPLIT
    world = w.xyz;
    corner_body = number;
#else
    body = number;
    project(w);
#endif
}
