// Blends colours by hue, saturation and value.
#include <rtsg/core/color_blend.h>

#include <algorithm>
#include <cmath>

namespace rtsg {

namespace {

struct Hsv {
    float h, s, v;  // hue in turns
};

Hsv toHsv(const Color& c) {
    const float high = std::max({c.r, c.g, c.b}), low = std::min({c.r, c.g, c.b}), range = high - low;
    if (!(range > 0)) return {0, 0, high};
    float h = high == c.r ? (c.g - c.b) / range : high == c.g ? 2 + (c.b - c.r) / range : 4 + (c.r - c.g) / range;
    h /= 6;
    return {h < 0 ? h + 1 : h, range / high, high};
}

Color fromHsv(const Hsv& c) {
    const float h = (c.h - std::floor(c.h)) * 6;
    const int sector = std::min(5, static_cast<int>(h));
    const float f = h - static_cast<float>(sector);
    const float p = c.v * (1 - c.s), q = c.v * (1 - c.s * f), t = c.v * (1 - c.s * (1 - f));
    switch (sector) {
        case 0:
            return {c.v, t, p};
        case 1:
            return {q, c.v, p};
        case 2:
            return {p, c.v, t};
        case 3:
            return {p, q, c.v};
        case 4:
            return {t, p, c.v};
        default:
            return {c.v, p, q};
    }
}

}  // namespace

Color blend(const Color& a, const Color& b, float w) {
    if (w == 0) return a;
    if (w == 1) return b;
    Hsv from = toHsv(a), to = toHsv(b);
    if (from.s == 0) from.h = to.h;
    if (to.s == 0) to.h = from.h;
    if (to.h - from.h > .5f) from.h += 1;
    if (from.h - to.h > .5f) to.h += 1;
    return fromHsv({from.h + (to.h - from.h) * w, from.s + (to.s - from.s) * w, from.v + (to.v - from.v) * w});
}

}  // namespace rtsg
