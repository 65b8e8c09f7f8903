// Cubes and blocks of pictures, looked up by three coordinates.
#include <rtsg/renderers/space_texture.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace rtsg {

namespace {

/// To the right and upwards on each side, seen from inside, and its middle.
struct SideFrame {
    Vec3f right, up, middle;
};
constexpr SideFrame kSides[6] = {
    {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}, {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 0, -1}, {0, 1, 0}, {-1, 0, 0}},
    {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},  {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},  {{1, 0, 0}, {0, 0, -1}, {0, -1, 0}},
};

/// Number of a layer that may lie outside; -1: the border.
int wrapLayer(int i, int count, TextureWrap wrap) {
    switch (wrap) {
        case TextureWrap::repeat:
            return ((i % count) + count) % count;
        case TextureWrap::mirror: {
            const int m = ((i % (2 * count)) + 2 * count) % (2 * count);
            return m < count ? m : 2 * count - 1 - m;
        }
        case TextureWrap::border:
            return i >= 0 && i < count ? i : -1;
        case TextureWrap::clamp:
            break;
    }
    return std::clamp(i, 0, count - 1);
}

}  // namespace

CubePosition cubePosition(const Vec3f& d) {
    const Vec3f a = glm::abs(d);
    CubePosition result;
    if (a.z >= a.x && a.z >= a.y)
        result.side = d.z > 0 ? CubeSide::back : CubeSide::front;
    else if (a.x >= a.y)
        result.side = d.x < 0 ? CubeSide::left : CubeSide::right;
    else
        result.side = d.y > 0 ? CubeSide::top : CubeSide::bottom;
    const SideFrame& frame = kSides[static_cast<std::size_t>(result.side)];
    const float depth = glm::dot(d, frame.middle);
    if (!(depth > 0) || !std::isfinite(depth)) return {};
    result.st = .5f + .5f * Vec2f(glm::dot(d, frame.right), glm::dot(d, frame.up)) / depth;
    return result;
}

Vec3f cubeDirection(CubeSide side, Vec2f st) {
    const SideFrame& frame = kSides[static_cast<std::size_t>(side)];
    return glm::normalize(frame.middle + (2 * st.x - 1) * frame.right + (2 * st.y - 1) * frame.up);
}

Vec2f panoramaPosition(const Vec3f& d) {
    constexpr float kPi = std::numbers::pi_v<float>;
    // Near the axis an arc sine of d.y knows no angles below a three-thousandth.
    const float across = std::sqrt(d.x * d.x + d.z * d.z);
    const float fromPole = std::atan2(across, std::abs(d.y)) / kPi;
    return {.5f + std::atan2(d.x, -d.z) / (2 * kPi), d.y > 0 ? 1 - fromPole : fromPole};
}

SpaceTexture SpaceTexture::cube(std::array<std::shared_ptr<const Texture>, 6> sides) {
    SpaceTexture result;
    result.layers_.assign(sides.begin(), sides.end());
    return result;
}

Result<SpaceTexture> SpaceTexture::ofPicture(const std::shared_ptr<const Texture>& picture) {
    const int w = picture->width(), h = picture->height();
    SpaceTexture result;
    if (w == 2 * h) {
        result.kind_ = Kind::panorama;
        result.layers_.push_back(picture);
        return result;
    }
    // The place of front, back, left, right, top or bottom: column and row from the top, and whether it is upside down.
    struct CubeFace {
        int column, row;
        bool turned = false;
    };
    struct Shape {
        int columns, rows;
        CubeFace sides[6];
    };
    constexpr Shape kShapes[] = {
        {3, 2, {{2, 0}, {2, 1}, {0, 1}, {0, 0}, {1, 0}, {1, 1}}},
        {6, 1, {{4, 0}, {5, 0}, {1, 0}, {0, 0}, {2, 0}, {3, 0}}},
        {1, 6, {{0, 4}, {0, 5}, {0, 1}, {0, 0}, {0, 2}, {0, 3}}},
        {4, 3, {{1, 1}, {3, 1}, {0, 1}, {2, 1}, {1, 0}, {1, 2}}},
        {3, 4, {{1, 1}, {1, 3, true}, {0, 1}, {2, 1}, {1, 0}, {1, 2}}},
    };
    for (const Shape& shape : kShapes) {
        const int side = w / shape.columns;
        if (side == 0 || w != side * shape.columns || h != side * shape.rows) continue;
        if (picture->inTiles()) return fail("a picture of the sides of a cube has to be small enough to be kept");
        for (const CubeFace& part : shape.sides)
            result.layers_.push_back(std::make_shared<const Texture>(
                picture->part(part.column * side, (shape.rows - 1 - part.row) * side, side, side, part.turned)));
        return result;
    }
    return fail(fmt::format("a picture of {} x {} pixels does not hold six sides of a cube", w, h));
}

Result<SpaceTexture> SpaceTexture::block(Layers layers) {
    if (layers.empty()) return fail("a three-dimensional texture has no layers");
    for (const auto& layer : layers)
        if (!layer || layer->width() != layers[0]->width() || layer->height() != layers[0]->height())
            return fail("the layers of a three-dimensional texture are not all there, or not all of one size");
    SpaceTexture result;
    result.kind_ = Kind::block;
    result.layers_ = std::move(layers);
    return result;
}

bool SpaceTexture::hasAlpha() const {
    return std::ranges::any_of(layers_, [](const auto& layer) { return !layer || layer->hasAlpha(); });
}

std::size_t SpaceTexture::bytes() const {
    std::size_t sum = 0;
    for (const auto& layer : layers_)
        if (layer) sum += layer->bytes();
    return sum;
}

Vec4f SpaceTexture::sampleSide(std::size_t side, Vec2f point, float footprint, const TextureAccess& access,
                               ColorSpace space) const {
    if (!layers_[side]) return Vec4f(0);
    TextureAccess own = access;
    own.wrapS = kind_ == Kind::panorama ? TextureWrap::repeat : TextureWrap::clamp, own.wrapT = TextureWrap::clamp;
    return layers_[side]->sample(point.x, point.y, footprint, own, space);
}

Vec4f SpaceTexture::sample(const Vec3f& str, float footprint, const TextureAccess& access, ColorSpace space) const {
    if (kind_ == Kind::cube) {
        const CubePosition onCube = cubePosition(str);
        return sampleSide(static_cast<std::size_t>(onCube.side), onCube.st, footprint, access, space);
    }
    if (kind_ == Kind::panorama) {
        const float length = glm::length(str);
        const Vec3f d = length > 0 && std::isfinite(length) ? str / length : Vec3f(0, 0, -1);
        return sampleSide(0, panoramaPosition(d), footprint, access, space);
    }
    const auto count = static_cast<int>(layers_.size());
    const auto of = [&](int i) {
        const int layer = wrapLayer(i, count, access.wrapR);
        if (layer >= 0) return layers_[static_cast<std::size_t>(layer)]->sample(str.x, str.y, footprint, access, space);
        if (space == ColorSpace::display) return access.border;
        return Vec4f(linearFromSrgb(Vec3f(access.border)), access.border.a);
    };
    // Reduces a coordinate so that the number of layers fits into int and keeps its precision.
    float r = std::isfinite(str.z) ? str.z : 0.0f;
    if (access.wrapR == TextureWrap::clamp || access.wrapR == TextureWrap::border)
        r = std::clamp(r, -1.0f, 2.0f);
    else
        r -= 2 * std::floor(r / 2);
    const float z = r * static_cast<float>(count);
    if (!access.smooth) return of(static_cast<int>(std::floor(z)));
    const float low = std::floor(z - .5f), f = z - .5f - low;
    const int first = static_cast<int>(low);
    return of(first) * (1 - f) + of(first + 1) * f;
}

}  // namespace rtsg
