// A vertex of a face that was split. Points of an edge come out alike from both its faces: no gap opens.
layout(triangles, equal_spacing, ccw) in;

in vec3 corner[];
in vec3 corner_n[];
#ifdef TANGENT
in vec4 corner_t[];
#endif
#ifdef ST
in vec2 corner_st[];
#endif
in float of_body[];

#define BETWEEN(v) (gl_TessCoord.x * v[0] + gl_TessCoord.y * v[1] + gl_TessCoord.z * v[2])

void main()
{
    precise vec3 w = BETWEEN(corner);
    n = BETWEEN(corner_n);
#ifdef TANGENT
    t = BETWEEN(corner_t);
#endif
#ifdef ST
    st = BETWEEN(corner_st);
#endif
    body = of_body[0];
    project(vec4(w, 1.0));
}
