// The modes of TextureCoordinateGenerator.
#include "generated_coordinates.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include <rtsg/renderers/shading.h>

namespace rtsg::trace {

namespace {

float parameterAt(const TexCoords& channel, std::size_t i, float otherwise) {
    return i < channel.parameter.size() && std::isfinite(channel.parameter[i]) ? channel.parameter[i] : otherwise;
}

/// A unit vector's x and y onto [0, 1].
Vec3f onSphere(const Vec3f& v) {
    return .5f * v + Vec3f(.5f);
}

/// A shuffle of 0 to 255, the same always, twice in a row.
const std::array<std::uint8_t, 512>& shuffled() {
    static const auto table = [] {
        std::array<std::uint8_t, 512> t{};
        std::iota(t.begin(), t.begin() + 256, std::uint8_t{0});
        std::uint32_t state = 1;
        for (std::uint32_t i = 255; i > 0; --i) {
            state = state * 1664525u + 1013904223u;
            std::swap(t[i], t[(state >> 8) % (i + 1)]);
        }
        for (std::size_t i = 0; i < 256; ++i) t[256 + i] = t[i];
        return t;
    }();
    return table;
}

float slope(std::uint8_t hash, float x, float y, float z) {
    const int h = hash & 15;
    const float u = h < 8 ? x : y, v = h < 4 ? y : h == 12 || h == 14 ? x : z;
    return (h & 1 ? -u : u) + (h & 2 ? -v : v);
}

/// `normal` on the side that `towards` comes from; with an index other than 0, bent instead of mirrored.
Vec3f bounced(const Vec3f& towards, const Vec3f& normal, float index) {
    if (index > 0)
        if (const auto bent = refractDirection(towards, normal, index)) return *bent;
    return reflectDirection(towards, normal);
}
Vec3f unit(const Vec3f& v) {
    const float length = glm::length(v);
    return length > 0 ? v / length : Vec3f(0, 0, -1);
}

}  // namespace

float noiseAt(const Vec3f& at) {
    const auto& p = shuffled();
    const Vec3f floor = glm::floor(at), f = at - floor;
    const auto low = [](float x) {
        return static_cast<std::size_t>(static_cast<std::int64_t>(glm::clamp(x, -1e15f, 1e15f)) & 255);
    };
    const std::size_t x = low(floor.x), y = low(floor.y), z = low(floor.z);
    const Vec3f w = f * f * f * (f * (f * 6.0f - 15.0f) + 10.0f);
    const auto corner = [&](std::size_t i, std::size_t j, std::size_t k) {
        const std::uint8_t hash = p[(p[(p[(x + i) & 255] + y + j) & 255] + z + k) & 255];
        return slope(hash, f.x - static_cast<float>(i), f.y - static_cast<float>(j), f.z - static_cast<float>(k));
    };
    const auto alongX = [&](std::size_t j, std::size_t k) { return glm::mix(corner(0, j, k), corner(1, j, k), w.x); };
    const auto alongY = [&](std::size_t k) { return glm::mix(alongX(0, k), alongX(1, k), w.y); };
    return glm::mix(alongY(0), alongY(1), w.z);
}

Vec3f generatedCoordinates(const TexCoords& channel, const GeneratorInput& in) {
    using G = TexCoords::Generator;
    const auto noise = [&](const Vec3f& position) {
        const Vec3f scale(parameterAt(channel, 0, 1), parameterAt(channel, 1, 1), parameterAt(channel, 2, 1));
        const Vec3f shift(parameterAt(channel, 3, 0), parameterAt(channel, 4, 0), parameterAt(channel, 5, 0));
        const Vec3f at = position * scale + shift;
        // Three places of one noise, far apart.
        return onSphere({noiseAt(at), noiseAt(at + Vec3f(37.5f, 0, 0)), noiseAt(at + Vec3f(0, 91.5f, 0))});
    };
    switch (channel.generator) {
        case G::sphere:
            return onSphere(in.normal);
        case G::cameraSpaceNormal:
        case G::worldSpaceNormal:
            return in.normal;
        case G::cameraSpacePosition:
        case G::coordEye:
            return in.position;
        case G::cameraSpaceReflection:
        case G::worldSpaceReflection:
            return bounced(unit(in.position), in.normal, 0);
        case G::sphereLocal:
            return onSphere(in.localNormal);
        case G::sphereReflect:
            return bounced(unit(in.position), in.normal, parameterAt(channel, 0, 0));
        case G::sphereReflectLocal: {
            const Vec3f eye(parameterAt(channel, 1, 0), parameterAt(channel, 2, 0), parameterAt(channel, 3, 0));
            const Vec3f towards = unit(in.localPosition - eye);
            const Vec3f normal = glm::dot(towards, in.localNormal) > 0 ? -in.localNormal : in.localNormal;
            return bounced(towards, normal, parameterAt(channel, 0, 0));
        }
        case G::noise:
            return noise(in.localPosition);
        case G::noiseEye:
            return noise(in.position);
        case G::none:
            break;
    }
    return Vec3f(0);
}

}  // namespace rtsg::trace
