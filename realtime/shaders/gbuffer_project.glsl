// What a vertex hands on to gbuffer_fragment.glsl, and where it lies in the window.
#ifdef THROUGH
uniform mat4 eye_from_world;
#else
uniform mat4 clip_from_world;
#ifdef TELECENTRIC
uniform vec4 eye_z;  // row of eye_from_world that gives the depth
#endif
#endif
#ifdef TELECENTRIC
out float z;
#endif
out vec3 n;
#ifdef TANGENT
out vec4 t;
#endif
#ifdef ST
out vec2 st;
#endif
flat out float body;

void project(vec4 w)
{
#ifdef THROUGH
    vec3 p = (eye_from_world * w).xyz;
#ifdef TELECENTRIC
    z = p.z;
#endif
    gl_Position = to_clip(p);
#else
#ifdef TELECENTRIC
    z = dot(eye_z, w);
#endif
    gl_Position = clip_from_world * w;
#endif
}
