// Value, density and samples of the reflection models.
#include "bsdf.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "bsdf8.h"

namespace rtsg::trace {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

Vec3f headOn(const Vec3f& base, float metallic) {
    return glm::mix(Vec3f(0.04f), base, metallic);
}
float alphaOf(float roughness) {
    return std::max(roughness * roughness, 1e-3f);
}

/// Density cos / pi about +z.
Vec3f cosineSample(float u, float v) {
    const float r = std::sqrt(u), phi = 2 * kPi * v;
    return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(1 - u, 0.0f))};
}

/// A microfacet's normal as seen from `view`, for GGX of roughness alpha.
Vec3f visibleNormal(const Vec3f& view, float alpha, float u, float v) {
    const Vec3f stretched = glm::normalize(Vec3f(alpha * view.x, alpha * view.y, view.z));
    const float r = std::sqrt(u), phi = 2 * kPi * v;
    const float x = r * std::cos(phi);
    float y = r * std::sin(phi);
    const float blend = 0.5f * (1 + stretched.z);
    const Vec3f across = stretched.z < 0.9999f ? glm::normalize(glm::cross(Vec3f(0, 0, 1), stretched)) : Vec3f(1, 0, 0);
    const Vec3f along = glm::cross(stretched, across);
    y = (1 - blend) * std::sqrt(std::max(1 - x * x, 0.0f)) + blend * y;
    const Vec3f h = x * across + y * along + std::sqrt(std::max(1 - x * x - y * y, 0.0f)) * stretched;
    return glm::normalize(Vec3f(alpha * h.x, alpha * h.y, std::max(h.z, 1e-6f)));
}

/// Smith's masking of one direction, 2 / (1 + sqrt(1 + alpha^2 tan^2)).
float masking(float cosine, float alpha) {
    const float c2 = cosine * cosine;
    return 2 / (1 + std::sqrt(1 + alpha * alpha * std::max(1 - c2, 0.0f) / c2));
}

/// The normal half way between; 0, 0, 0 for opposite directions.
Vec3f halfway(const Vec3f& a, const Vec3f& b) {
    const Vec3f sum = a + b;
    const float length = glm::length(sum);
    return length > 1e-20f ? sum / length : Vec3f(0);
}

}  // namespace

Bsdf Bsdf::phong(const Vec3f& diffuse, const Vec3f& specular, float exponent) {
    Bsdf result;
    result.base_ = diffuse, result.specular_ = specular, result.exponent_ = exponent;
    return result;
}

Bsdf Bsdf::physical(const Vec3f& base, float metallic, float roughness) {
    Bsdf result;
    result.physical_ = true;
    result.base_ = base, result.metallic_ = metallic, result.roughness_ = roughness;
    return result;
}

Vec3f Bsdf::value(const Vec3f& view, const Vec3f& light) const {
    if (!(light.z > 0) || !(view.z > 0)) return Vec3f(0);
    if (isMatte()) return base_ * light.z;
    const Vec3f h = halfway(view, light);
    if (physical_)
        return light.z * metallicRoughness(base_, metallic_, roughness_, light.z, view.z, h.z,
                                           std::max(glm::dot(light, h), 0.0f));
    return base_ * light.z + specular_ * std::pow(std::clamp(h.z, 0.0f, 1.0f), exponent_);
}

Vec3f Bsdf::albedo(float cosView) const {
    if (isMatte()) return base_;
    if (!physical_) return base_ + specular_ * highlightAlbedo(exponent_);
    const Vec3f fresnel = fresnelSchlick(headOn(base_, metallic_), cosView);
    return (Vec3f(1) - fresnel) * (1 - metallic_) * base_ + fresnel;
}

float Bsdf::diffuseFraction(float cosView) const {
    if (isMatte()) return 1;
    float diffuse, glossy;
    if (physical_) {
        glossy = largest(fresnelSchlick(headOn(base_, metallic_), cosView));
        diffuse = (1 - glossy) * (1 - metallic_) * largest(base_);
    } else {
        glossy = largest(specular_) * highlightAlbedo(exponent_);
        diffuse = largest(base_);
    }
    const float sum = diffuse + glossy;
    return sum > 0 ? diffuse / sum : 1;
}

float Bsdf::density(const Vec3f& view, const Vec3f& light) const {
    const float diffuse = diffuseFraction(view.z);
    const float result = diffuse * std::max(light.z, 0.0f) / kPi;
    if (diffuse >= 1) return result;
    const Vec3f h = halfway(view, light);
    const float cosine = std::abs(glm::dot(view, h));
    if (!(cosine > 0)) return result;
    if (physical_) {
        if (!(h.z > 0)) return result;
        // The visible normals' G1 D (v.h) / (v.z), over the 4 (v.h) by which a mirror spreads directions.
        const float alpha = alphaOf(roughness_);
        return result + (1 - diffuse) * masking(view.z, alpha) * ggx(h.z, alpha * alpha) / (4 * kPi * view.z);
    }
    return result +
           (1 - diffuse) * (exponent_ + 1) * std::pow(std::min(std::abs(h.z), 1.0f), exponent_) / (8 * kPi * cosine);
}

BsdfSample Bsdf::sample(const Vec3f& view, float choice, float u, float v) const {
    BsdfSample result;
    if (choice < diffuseFraction(view.z)) {
        result.direction = cosineSample(u, v);
    } else {
        Vec3f h;
        if (physical_) {
            h = visibleNormal(view, alphaOf(roughness_), u, v);
        } else {
            const float c = std::pow(1 - u, 1 / (exponent_ + 1)), s = std::sqrt(std::max(1 - c * c, 0.0f));
            h = {s * std::cos(2 * kPi * v), s * std::sin(2 * kPi * v), c};
        }
        result.direction = glm::normalize(2 * glm::dot(view, h) * h - view);
    }
    result.density = density(view, result.direction);
    if (result.density > 0) result.weight = value(view, result.direction) / (kPi * result.density);
    return result;
}

float highlightAlbedo(float exponent) {
    // 1 / pi times the integral of (n.h)^e over the light's directions, which mirror spreads: d light = 4 (n.h) d half.
    return 8 / (exponent + 2) * (1 - std::exp2(-0.5f * (exponent + 2)));
}

Vec3f energyLimited(const Vec3f& diffuse, const Vec3f& specular, float exponent) {
    const Vec3f room = glm::max(Vec3f(1) - diffuse, Vec3f(0)) / highlightAlbedo(exponent);
    return glm::min(specular, room);
}

namespace {

/// The light of a white sky that the parts of glTF's model reflect, by angle of view and roughness: f0 * mirrored +
/// grazing by the facets, and 1 - lost by the diffuse part.
struct Albedos {
    static constexpr int kSteps = 32;
    float mirrored[kSteps][kSteps], grazing[kSteps][kSteps], lost[kSteps];

    static float cosineOf(int i) { return std::max(static_cast<float>(i) / (kSteps - 1), 0.01f); }

    Albedos() {
        const Disk disk;
        for (int i = 0; i < kSteps; ++i) {
            const float c = cosineOf(i);
            const Vec3f view(std::sqrt(1 - c * c), 0, c);
            for (int j = 0; j < kSteps; ++j)
                facets(disk, view, alphaOf(static_cast<float>(j) / (kSteps - 1)), mirrored[i][j], grazing[i][j]);
            lost[i] = halfwayLoss(disk, view);
        }
    }

    /// Places spread evenly over the unit disk, the same for all angles of view: a program's first picture waits for
    /// the table.
    struct Disk {
        static constexpr int kCount = 256, kCosines = 1024;
        float x[kCount], y[kCount], left[kCount];  // left: 1 - x^2, not below 0
        Vec3f cosine[kCosines];                    // of cosineSample()
        Disk() {
            spread<16>([this](int i, float u, float v) {
                const float r = std::sqrt(u), phi = 2 * kPi * v;
                x[i] = r * std::cos(phi), y[i] = r * std::sin(phi);
                left[i] = std::max(1 - x[i] * x[i], 0.0f);
            });
            spread<32>([this](int i, float u, float v) { cosine[i] = cosineSample(u, v); });
        }
        template <int kSide, class Visit>
        static void spread(const Visit& visit) {
            for (int i = 0; i < kSide * kSide; ++i) {
                const int row = i / kSide, column = i % kSide;
                visit(i, (static_cast<float>(row) + 0.5f) / kSide, (static_cast<float>(column) + 0.5f) / kSide);
            }
        }
    };

    /// By visibleNormal(), eight at a time.
    static void facets(const Disk& disk, const Vec3f& view, float alpha, float& mirrored, float& grazing) {
        using namespace simd;
        const Vec3f stretched = glm::normalize(Vec3f(alpha * view.x, alpha * view.y, view.z));
        const float blend = 0.5f * (1 + stretched.z);
        const Vec3f across =
            stretched.z < 0.9999f ? glm::normalize(glm::cross(Vec3f(0, 0, 1), stretched)) : Vec3f(1, 0, 0);
        const Vec3f along = glm::cross(stretched, across);
        const float gv = masking(view.z, alpha);
        F8 mirror{}, graze{};
        for (int i = 0; i < Disk::kCount; i += 8) {
            const F8 x = load(disk.x + i), left = load(disk.left + i);
            const F8 y = (1 - blend) * simd::sqrt(left) + blend * load(disk.y + i),
                     z = simd::sqrt(max(left - y * y, all(0)));
            const auto part = [&](int k) { return x * across[k] + y * along[k] + z * stretched[k]; };
            V8 h{alpha * part(0), alpha * part(1), max(part(2), all(1e-6f))};
            h = h * (1 / simd::sqrt(dot(h, h)));
            const F8 cosine = view.x * h.x + view.y * h.y + view.z * h.z, light = 2 * cosine * h.z - view.z;
            // The weight of a visible normal is G2 / G1, with correlated heights.
            const F8 l2 = max(light * light, all(1e-12f)),
                     gl = 2 / (1 + simd::sqrt(1 + alpha * alpha * max(1 - l2, all(0)) / l2));
            const F8 weight = select(light > 0.0f, gl / (gv + gl - gv * gl), all(0)), m = max(1 - cosine, all(0)),
                     m5 = m * m * m * m * m;
            mirror += weight * (1 - m5), graze += weight * m5;
        }
        mirrored = grazing = 0;
        for (int lane = 0; lane < 8; ++lane) mirrored += mirror[lane], grazing += graze[lane];
        mirrored /= Disk::kCount, grazing /= Disk::kCount;
    }

    static float halfwayLoss(const Disk& disk, const Vec3f& view) {
        float sum = 0;
        for (const Vec3f& light : disk.cosine) {
            const float m = std::max(1 - glm::dot(light, halfway(view, light)), 0.0f);
            sum += m * m * m * m * m;
        }
        return sum / Disk::kCosines;
    }
};

}  // namespace

namespace {

const Albedos& albedos() {
    static const Albedos table;
    return table;
}

}  // namespace

EvenlyLit evenlyLit(const Vec3f& base, float metallic, float roughness, float cosView) {
    const Albedos& table = albedos();
    const float x = std::clamp(cosView, 0.0f, 1.0f) * (Albedos::kSteps - 1),
                y = std::clamp(roughness, 0.0f, 1.0f) * (Albedos::kSteps - 1);
    const int i = std::min(static_cast<int>(x), Albedos::kSteps - 2),
              j = std::min(static_cast<int>(y), Albedos::kSteps - 2);
    const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
    const auto at = [&](const auto& t) {
        return (t[i][j] * (1 - fx) + t[i + 1][j] * fx) * (1 - fy) +
               (t[i][j + 1] * (1 - fx) + t[i + 1][j + 1] * fx) * fy;
    };
    const Vec3f f0 = headOn(base, metallic);
    const float lost = table.lost[i] * (1 - fx) + table.lost[i + 1] * fx;
    return {f0 * at(table.mirrored) + at(table.grazing), (1 - metallic) * (1 - lost) * base * (Vec3f(1) - f0)};
}

Vec3f energyLimited(const Vec3f& base, float metallic, float roughness, float cosView) {
    Vec3f result = glm::min(base, Vec3f(1));
    const auto [specular, diffuse] = evenlyLit(result, metallic, roughness, cosView);
    for (int c = 0; c < 3; ++c)
        if (diffuse[c] > 1e-3f && specular[c] + diffuse[c] > 1)
            result[c] *= std::max(1 - specular[c], 0.0f) / diffuse[c];
    return result;
}

simd::V8 energyLimited(const simd::V8& base, simd::F8 metallic, simd::F8 roughness, simd::F8 cosView) {
    using namespace simd;
    const Albedos& table = albedos();
    const auto step = [](F8 fraction) { return min(max(fraction, all(0)), all(1)) * (Albedos::kSteps - 1); };
    const F8 x = step(cosView), y = step(roughness);
    alignas(32) float mirrored[4][8], grazing[4][8], lost[2][8], fx[8], fy[8];
    for (int lane = 0; lane < 8; ++lane) {
        const int i = std::min(static_cast<int>(x[lane]), Albedos::kSteps - 2),
                  j = std::min(static_cast<int>(y[lane]), Albedos::kSteps - 2);
        fx[lane] = x[lane] - static_cast<float>(i), fy[lane] = y[lane] - static_cast<float>(j);
        for (int corner = 0; corner < 4; ++corner) {
            mirrored[corner][lane] = table.mirrored[i + corner % 2][j + corner / 2];
            grazing[corner][lane] = table.grazing[i + corner % 2][j + corner / 2];
        }
        lost[0][lane] = table.lost[i], lost[1][lane] = table.lost[i + 1];
    }
    const F8 across = load(fx), down = load(fy);
    const auto at = [&](const float(&t)[4][8]) {
        return (load(t[0]) * (1 - across) + load(t[1]) * across) * (1 - down) +
               (load(t[2]) * (1 - across) + load(t[3]) * across) * down;
    };
    const F8 mirrors = at(mirrored), grazes = at(grazing);
    const F8 body = (1 - metallic) * (1 - (load(lost[0]) * (1 - across) + load(lost[1]) * across));
    const auto limited = [&](F8 color) {
        const F8 own = min(color, all(1)), f0 = 0.04f * (1 - metallic) + own * metallic;
        const F8 specular = f0 * mirrors + grazes, diffuse = body * own * (1 - f0);
        const I8 beyond = (diffuse > 1e-3f) & (specular + diffuse > 1.0f);
        return own * select(beyond, max(1 - specular, all(0)) / diffuse, all(1));
    };
    return {limited(base.x), limited(base.y), limited(base.z)};
}

}  // namespace rtsg::trace
