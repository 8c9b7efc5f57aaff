// Radiance of every sample of a pixel whose surface has this program's material, by the chunk of lamps at hand.
// LIT: instead of radiance, (share of the lamps' samples that are seen, samples that face the surface).
uniform sampler2D g_plane;
uniform sampler2D g_frame;
#ifdef UV
uniform sampler2D g_coordinates;
#endif
#ifdef LENS
uniform sampler2D lens;
#ifdef UV
uniform sampler2D g_slopes;
#endif
#endif

uniform mat4 world_from_eye;
uniform vec4 pinhole;    // focal, centre
uniform int grid;        // samples a pixel along one side
uniform vec2 jitter;     // px
uniform ivec2 rows;      // the material rows that this draw is for: first, behind the last
uniform float weight;    // of one sample in the pixel's mean
uniform float emitting;  // 1 in the draw that adds what surfaces emit

layout(location = 0) out vec4 radiance;

void main()
{
    vec3 total = vec3(0.0);
    for (int index = 0; index < grid * grid; ++index) {
        ivec2 sub = ivec2(index % grid, index / grid);
#ifdef LENS
        vec2 at = gl_FragCoord.xy - 0.5 + (vec2(sub) + 0.5) / float(grid) + jitter;
        ivec2 corner = ivec2(clamp(floor(at), vec2(0.0), vec2(textureSize(lens, 0)) - 2.0));
        vec2 f = at - vec2(corner);
        vec2 d = mix(
            mix(texelFetch(lens, corner, 0).xy, texelFetch(lens, corner + ivec2(1, 0), 0).xy, f.x),
            mix(texelFetch(lens, corner + ivec2(0, 1), 0).xy, texelFetch(lens, corner + ivec2(1, 1), 0).xy, f.x), f.y);
        bool blind = !(dot(d, d) < 1e12);
        vec2 window = blind ? vec2(0.0) : (d - aperture) * pinhole.xy + pinhole.zw;
        ivec2 texel = ivec2(floor(window));
        d = (window - pinhole.zw) / pinhole.xy;
#else
        ivec2 texel = ivec2(gl_FragCoord.xy) * grid + sub;
        vec2 d = (vec2(texel) + 0.5 - pinhole.zw) / pinhole.xy;
#endif
        vec4 plane = texelFetch(g_plane, texel, 0), frame = texelFetch(g_frame, texel, 0);
        int row = int(frame.w);
        bool mine = plane.w >= 0.0 && row >= rows.x && row < rows.y;
#ifdef LENS
        mine = mine && !blind;
        vec2 off = window - (vec2(texel) + 0.5);
        plane.x += dot(plane.yz, off);
#endif
        for (int once = mine ? 0 : 1; once < 1; ++once) {  // a loop is skipped where no lane takes part
#ifdef TELECENTRIC
            float z = plane.x;
            vec3 ray = vec3(d, z), eye_ray = vec3(0.0, 0.0, 1.0);
#else
            float z = 1.0 / plane.x;
            vec3 ray = vec3(d, 1.0) * z, eye_ray = normalize(vec3(d, 1.0));
#endif
            vec3 p = (world_from_eye * vec4(ray, 1.0)).xyz;
            vec3 view = -(mat3(world_from_eye) * eye_ray);
            vec3 facet = mat3(world_from_eye) * facet_normal(plane.x, plane.yz, d, pinhole.xy);
            vec3 normal = from_octahedral(frame.xy), b1, b2;
            basis(normal, b1, b2);
            vec3 tangent = cos(frame.z) * b1 + sin(frame.z) * b2, bitangent = cross(normal, tangent);
#ifdef UV
            vec2 st = texelFetch(g_coordinates, texel, 0).xy;
#ifdef LENS
            vec4 slopes = texelFetch(g_slopes, texel, 0);
            vec2 moved = slopes.xy * off.x + slopes.zw * off.y;
#ifdef TELECENTRIC
            st += moved;
#else
            st = (st * (plane.x - dot(plane.yz, off)) + moved) / plane.x;
#endif
#endif
#endif
#ifdef LIT
            vec2 count = vec2(0.0);
            for (int k = 0; k < LIGHTS; ++k) {
                vec3 l = arrival(k, p).direction;
                float faces = dot(l, normal) > 0.0 && dot(l, facet) > 0.0 ? 1.0 : 0.0;
#ifdef FACES
                count += faces * vec2(seen(k, p, facet), 1.0);
#else
                count += vec2(faces);
#endif
            }
            total += vec3(count, 0.0);
#else
            vec3 wo = vec3(dot(view, tangent), dot(view, bitangent), dot(view, normal));
            vec3 emission;
            float values[PARAMETERS];
            material(row, UV_OR_ZERO, values, emission);
            total += emitting * emission;
#if LIGHTS > 0
            for (int k = 0; k < LIGHTS; ++k) {
                Arrival a = arrival(k, p);
                vec3 l = a.direction, wi = vec3(dot(l, tangent), dot(l, bitangent), dot(l, normal));
                bool reached = wi.z > 0.0 && wo.z > 0.0 && dot(l, facet) > 0.0;
                vec3 power = a.power * max(wi.z, 0.0);
#ifdef SHAPED
                power *= shaping(k, l);
#endif
#ifdef FACES
                power *= seen(k, p, facet);
#endif
#ifdef FRAGMENT
                vec3 f = brdf(wi, wo, UV_OR_ZERO);
#else
                vec3 f = model(wi, wo, values);
#endif
                total += reached ? power * f : vec3(0.0);
            }
#endif
#endif
        }
    }
    radiance = vec4(total * weight, 1.0);
}
