// The mean over a pixel's samples.
uniform sampler2D samples;
uniform float weight;  // of the sum
layout(location = 0) out vec4 mean;

void main()
{
    ivec2 first = ivec2(gl_FragCoord.xy) * GRID;
    vec3 total = vec3(0.0);
    for (int i = 0; i < GRID * GRID; ++i) total += texelFetch(samples, first + ivec2(i % GRID, i / GRID), 0).rgb;
    mean = vec4(total * weight, 1.0);
}
