// interchange.light.Profile.evaluate. The texture holds the vertical angles in its first row, the horizontal ones in
// its first column, the candela in the rest.
#define TABLE(k, i, j) texelFetch(profile[k], ivec2(i, j), 0).x

float candela(int k, float theta, float phi)
{
    ivec2 size = textureSize(profile[k], 0) - 1;
    if (theta < TABLE(k, 1, 0) || theta > TABLE(k, size.x, 0)) return 0.0;
    if (size.x == 1) return TABLE(k, 1, 1);
    int low = 1, high = size.x;
    for (int step = 0; step < 12 && high - low > 1; ++step) {
        int middle = (low + high) / 2;
        if (TABLE(k, middle, 0) <= theta) low = middle; else high = middle;
    }
    float t = (theta - TABLE(k, low, 0)) / (TABLE(k, low + 1, 0) - TABLE(k, low, 0));
    if (size.y == 1) return mix(TABLE(k, low, 1), TABLE(k, low + 1, 1), t);
    phi = phi < 0.0 ? phi + 6.28318530718 : phi;
    int first = 1, last = size.y;
    for (int step = 0; step < 12 && last - first > 1; ++step) {
        int middle = (first + last) / 2;
        if (TABLE(k, 0, middle) <= phi) first = middle; else last = middle;
    }
    float w = (phi - TABLE(k, 0, first)) / (TABLE(k, 0, first + 1) - TABLE(k, 0, first));
    return mix(
        mix(TABLE(k, low, first), TABLE(k, low + 1, first), t),
        mix(TABLE(k, low, first + 1), TABLE(k, low + 1, first + 1), t), w);
}
