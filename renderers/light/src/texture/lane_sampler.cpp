// Looks a texture up at eight places at once: each lane gets what Texture::sample() gives it, by the same sums.
#include <bit>
#include <cmath>
#include <limits>

#include <rtsg/renderers/texture.h>

#include "mesh/simd8.h"
#include "texture_pixels.h"

namespace rtsg {

using namespace simd;

namespace {

F8 floats(I8 v) {
    return __builtin_convertvector(v, F8);
}
I8 integers(F8 v) {
    return __builtin_convertvector(v, I8);
}
I8 choose(I8 mask, I8 a, I8 b) {
    return mask ? a : b;
}

/// Does what Texture does for a single number.
F8 reduced(F8 s, TextureWrap wrap) {
    s = select(absolute(s) <= std::numeric_limits<float>::max(), s, all(0));
    if (wrap == TextureWrap::clamp) return select(s < 0.0f, all(0), select(s > 1.0f, all(1), s));
    const float period = wrap == TextureWrap::mirror ? 2.0f : 1.0f;
    return s - period * floorOf(s / period);
}

/// Wraps pixel numbers that are beyond an edge by one at most; if mirrored, beyond the edge of twice as many pixels.
I8 wrapped(I8 i, I8 size, TextureWrap wrap) {
    switch (wrap) {
        case TextureWrap::repeat:
            return choose(i < 0, i + size, choose(i >= size, i - size, i));
        case TextureWrap::mirror: {
            const I8 both = 2 * size, inside = choose(i < 0, i + both, choose(i >= both, i - both, i));
            return choose(inside < size, inside, both - 1 - inside);
        }
        case TextureWrap::border:
        case TextureWrap::clamp:
            break;
    }
    return choose(i < 0, I8{}, choose(i >= size, size - 1, i));
}

/// Channel by channel.
struct Colors {
    F8 c[4];
};
Colors mixed(const Colors& a, const Colors& b, F8 fraction) {
    Colors r;
    for (int k = 0; k < 4; ++k) r.c[k] = a.c[k] * (1.0f - fraction) + b.c[k] * fraction;
    return r;
}

}  // namespace

/// Samples a texture whose pixels are bytes.
class LaneSampler {
  public:
    LaneSampler(const Texture& texture, const TextureAccess& access, bool decode)
        : texture_(texture), access_(access), decode_(decode) {}

    /// Whether this class can look it up; textures with borders are left to single look-ups.
    static bool suits(const Texture& texture, const TextureAccess& access) {
        return !texture.tiles_ && !texture.wide_ && access.wrapS != TextureWrap::border &&
               access.wrapT != TextureWrap::border;
    }

    Colors sample(F8 s, F8 t, F8 footprint, I8 lanes) {
        s = reduced(select(lanes, s, all(0)), access_.wrapS), t = reduced(select(lanes, t, all(0)), access_.wrapT);
        const float size = std::sqrt(static_cast<float>(texture_.width()) * static_cast<float>(texture_.height()));
        const F8 pixels = footprint * size;
        const I8 far = lanes & (pixels > 1.0f);
        const bool anyFar = any(far);
        for (const Texture::Level*& level : levels_) level = &texture_.finest_;
        const F8 deeper = anyFar && access_.levels != TextureLevels::finest ? chooseLevels(pixels, far) : F8{};
        // Pixels that are smaller than the texture's may be read otherwise than those that are larger.
        const bool same = access_.smooth == access_.smoothFar;
        const Colors fine = !anyFar || same ? atLevels(s, t, access_.smooth) : eitherPath(s, t, far);
        const I8 between = deeper != 0.0f;
        if (!any(between)) return fine;
        const std::vector<Texture::Level>& coarse = texture_.coarse(decode_);
        for (int i = 0; i < 8; ++i)
            if (between[i]) levels_[i] = &coarse[static_cast<std::size_t>(fine_[i])];
        // Lanes between two levels need a smooth look-up in both.
        const Colors both = mixed(fine, atLevels(s, t, access_.smoothFar), deeper);
        Colors r;
        for (int k = 0; k < 4; ++k) r.c[k] = select(between, both.c[k], fine.c[k]);
        return r;
    }

  private:
    /// Into `levels_` and `fine_`; returns how much of the next coarser one is mixed in.
    F8 chooseLevels(F8 pixels, I8 far) {
        const std::vector<Texture::Level>& coarse = texture_.coarse(decode_);
        const auto last = static_cast<std::int32_t>(coarse.size());
        F8 depth = log2Of(select(far, pixels, all(1)));
        if (access_.levels == TextureLevels::nearest)
            for (int i = 0; i < 8; ++i) depth[i] = std::round(depth[i]);
        depth = select(depth >= static_cast<float>(last), all(static_cast<float>(last)), depth);
        fine_ = integers(depth);
        for (int i = 0; i < 8; ++i)
            if (fine_[i] > 0) levels_[i] = &coarse[static_cast<std::size_t>(fine_[i] - 1)];
        return depth - floats(fine_);
    }
    Colors eitherPath(F8 s, F8 t, I8 far) const {
        const Colors near = atLevels(s, t, access_.smooth), away = atLevels(s, t, access_.smoothFar);
        Colors r;
        for (int k = 0; k < 4; ++k) r.c[k] = select(far, away.c[k], near.c[k]);
        return r;
    }
    Colors atLevels(F8 s, F8 t, bool smooth) const {
        I8 width, height;
        for (int i = 0; i < 8; ++i) width[i] = levels_[i]->width, height[i] = levels_[i]->height;
        const F8 x = s * floats(width), y = t * floats(height);
        if (!smooth) {
            const I8 column = wrapped(integers(floorOf(x)), width, access_.wrapS),
                     row = wrapped(integers(floorOf(y)), height, access_.wrapT);
            return colorsOf(pixelsAt(row * width + column));
        }
        const F8 left = floorOf(x - 0.5f), bottom = floorOf(y - 0.5f);
        const F8 fx = x - 0.5f - left, fy = y - 0.5f - bottom;
        const I8 x0 = wrapped(integers(left), width, access_.wrapS),
                 x1 = wrapped(integers(left) + 1, width, access_.wrapS);
        const I8 low = wrapped(integers(bottom), height, access_.wrapT) * width,
                 high = wrapped(integers(bottom) + 1, height, access_.wrapT) * width;
        const Colors bottomRow = mixed(colorsOf(pixelsAt(low + x0)), colorsOf(pixelsAt(low + x1)), fx);
        const Colors topRow = mixed(colorsOf(pixelsAt(high + x0)), colorsOf(pixelsAt(high + x1)), fx);
        return mixed(bottomRow, topRow, fy);
    }
    I8 pixelsAt(I8 offset) const {
        I8 words;
        for (int i = 0; i < 8; ++i)
            words[i] = std::bit_cast<std::int32_t>(levels_[i]->encoded[static_cast<std::size_t>(offset[i])]);
        return words;
    }
    Colors colorsOf(I8 words) const {
        const I8 bytes[3] = {words & 255, words >> 8 & 255, words >> 16 & 255};
        Colors r;
        r.c[3] = floats(words >> 24 & 255) * (1 / 255.0f);
        for (int k = 0; k < 3; ++k) r.c[k] = decode_ ? lightOf(bytes[k]) : floats(bytes[k]) * (1 / 255.0f);
        return r;
    }
    static F8 lightOf(I8 bytes) {
        const float* const table = lightOfBytes().data();
        F8 r;
        for (int i = 0; i < 8; ++i) r[i] = table[bytes[i]];
        return r;
    }

    const Texture& texture_;
    const TextureAccess& access_;
    const bool decode_;
    const Texture::Level* levels_[8] = {};
    I8 fine_{};
};

void Texture::sampleLanes(const float* s, const float* t, const float* footprints, std::uint32_t lanes,
                          const TextureAccess& access, ColorSpace space, Lanes& out) const {
    if (!LaneSampler::suits(*this, access)) {
        for (; lanes; lanes &= lanes - 1) {
            const int i = std::countr_zero(lanes);
            const Vec4f color = sample(s[i], t[i], footprints[i], access, space);
            out.r[i] = color.r, out.g[i] = color.g, out.b[i] = color.b, out.a[i] = color.a;
        }
        return;
    }
    const I8 each{1, 2, 4, 8, 16, 32, 64, 128};
    LaneSampler sampler(*this, access, content_ == Content::color && space == ColorSpace::linear);
    const Colors found =
        sampler.sample(load(s), load(t), load(footprints), (each & static_cast<std::int32_t>(lanes)) != 0);
    store(out.r, found.c[0]), store(out.g, found.c[1]), store(out.b, found.c[2]), store(out.a, found.c[3]);
}

}  // namespace rtsg
