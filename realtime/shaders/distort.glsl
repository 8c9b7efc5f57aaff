// interchange.distortion.distort, and clip coordinates of a point in the eye's frame.
uniform vec4 window;    // clip = window.xy * image + window.zw
uniform vec2 depth;     // clip depth = depth.x * Z + depth.y
uniform vec2 aperture;  // the eye's shift over the distance in focus
uniform vec4 radial;       // k1 k2 p1 p2, or a fisheye's k1 to k4
uniform vec4 radial_high;  // k3 to k6
uniform vec4 prism;
uniform mat3 tilt;
uniform vec2 field;     // radius up to which the model is followed; slope by which it is continued

vec2 distorted(vec2 d)
{
#ifdef FISHEYE
    float r = length(d), t = atan(r), t2 = t * t;
    vec4 k = radial;
    return r > 1e-6 ? d * (t * (1.0 + t2 * (k.x + t2 * (k.y + t2 * (k.z + t2 * k.w)))) / r) : d;
#else
    vec4 k = radial, m = radial_high;
    float r2 = dot(d, d), xy = d.x * d.y;
    vec2 square = d * d;
    float q = (1.0 + r2 * (k.x + r2 * (k.y + r2 * m.x))) / (1.0 + r2 * (m.y + r2 * (m.z + r2 * m.w)));
    vec2 e = d * q + 2.0 * k.zw * xy + k.wz * (r2 + 2.0 * square);
#ifdef PRISM
    e += r2 * (prism.xz + r2 * prism.yw);
#endif
#ifdef TILTED
    vec3 h = tilt * vec3(e, 1.0);
    e = h.xy / h.z;
#endif
    return e;
#endif
}

vec4 to_clip(vec3 p)
{
#ifdef TELECENTRIC
    float w = 1.0;
    vec2 d = p.xy;
#else
    float w = p.z;
    vec2 d = p.xy + aperture * w;
#endif
    // beyond the field, also behind the eye, a point moves straight outwards, so that none folds back into the image
    float rho = length(d);
    bool inside = rho <= field.x * w;
    vec2 at = inside ? d / w : d * (field.x / max(rho, 1e-30));
    vec2 image = distorted(at) * w + (inside ? vec2(0.0) : field.y * (d - at * w));
    return vec4(window.xy * image + window.zw * w, depth.x * p.z + depth.y, w);
}
