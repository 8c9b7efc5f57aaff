// What a vertex hands on to the tessellator.
out vec3 world;
out vec3 n;
#ifdef TANGENT
out vec4 t;
#endif
#ifdef ST
out vec2 st;
#endif
out float corner_body;
