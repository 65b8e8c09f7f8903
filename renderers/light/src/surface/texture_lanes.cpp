// Texture coordinates and the size of pixels in textures, eight lanes at a time.
#include <bit>
#include <cmath>

#include "texture_lanes.h"

namespace rtsg::trace {

using namespace simd;

void TextureLanes::findFootprints(const PathTask* tasks) {
    alignas(32) float run[16] = {};
    if (tasks)
        for (std::uint32_t rest = lanes_; rest; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            run[lane] = tasks[lane].travelled;
        }
    for (int at = 0; at < 16; at += 8) {
        if (!(lanes_ >> at & 0xFFu)) continue;
        const V8 outside{load(s_.hits.normalX + at), load(s_.hits.normalY + at), load(s_.hits.normalZ + at)};
        const F8 steep = absolute(dot(loadV(s_.view, at), outside));
        const F8 cosine = select(steep < 0.05f, all(0.05f), steep);
        const F8 far = load(run + at) + load(s_.distance + at);
        const F8 width = scene_.sampleFraction * (scene_.pixelSpread * far + scene_.pixelSize);
        store(footprint_ + at, width / sqrt(cosine));
    }
}

bool TextureLanes::isPlain(std::size_t channel) const {
    const std::vector<TexCoords>& all = instance_.mesh->texCoords;
    if (channel >= all.size()) return false;
    const TexCoords& set = all[channel];
    return set.generator == TexCoords::Generator::none && set.values.present() && set.values.components() <= 3 &&
           set.values.binding() != MeshAttribute::Binding::face;
}

TextureLanes::Corners TextureLanes::corners(std::size_t channel, int at) const {
    const Mesh& mesh = *instance_.mesh;
    const MeshAttribute& values = mesh.texCoords[channel].values;
    const float* const numbers = values.data();
    const auto step = static_cast<std::size_t>(values.components());
    const auto value = [&](std::uint32_t triangle, std::uint32_t corner) {
        return numbers + values.valueIndex(triangle, corner) * step;
    };
    const std::uint32_t first = s_.hits.triangle[at + std::countr_zero(lanes_ >> at & 0xFFu)];
    Corners r;
    std::uint32_t triangles[8];
    bool isOne = true;
    for (int i = 0; i < 8; ++i) {
        triangles[i] = lanes_ >> (at + i) & 1u ? s_.hits.triangle[at + i] : first;
        isOne = isOne && triangles[i] == first;
    }
    for (std::uint32_t c = 0; c < 3; ++c) {
        if (isOne) {
            const float* const st = value(first, c);
            r.s[c] = all(st[0]), r.t[c] = all(st[1]);
            r.positions[c] = broadcast(mesh.vertex(first, c));
            continue;
        }
        alignas(32) float number[5][8];
        for (int i = 0; i < 8; ++i) {
            const float* const st = value(triangles[i], c);
            const Vec3f position = mesh.vertex(triangles[i], c);
            number[0][i] = st[0], number[1][i] = st[1];
            number[2][i] = position.x, number[3][i] = position.y, number[4][i] = position.z;
        }
        r.s[c] = load(number[0]), r.t[c] = load(number[1]);
        r.positions[c] = {load(number[2]), load(number[3]), load(number[4])};
    }
    return r;
}

void TextureLanes::findCoordinates(std::size_t channel) {
    if (channel_ == channel) return;
    channel_ = channel;
    const auto length = [](const V8& v) { return sqrt(dot(v, v)); };
    const glm::mat4x3& m = instance_.rayFromLocal;
    const auto turned = [&](const V8& v) {
        const auto row = [&](int r) { return m[0][r] * v.x + m[1][r] * v.y + m[2][r] * v.z; };
        return V8{row(0), row(1), row(2)};
    };
    for (int at = 0; at < 16; at += 8) {
        if (!(lanes_ >> at & 0xFFu)) continue;
        const Corners c = corners(channel, at);
        const F8 u = load(s_.hits.u + at), v = load(s_.hits.v + at), w = 1.0f - u - v;
        store(given_[0] + at, w * c.s[0] + u * c.s[1] + v * c.s[2]);
        store(given_[1] + at, w * c.t[0] + u * c.t[1] + v * c.t[2]);
        const F8 fourth = w + u + v;  // of three times 1, rounded as the others are
        store(divisor_ + at, select(fourth == 0.0f, all(1), fourth));
        const F8 across = (c.s[1] - c.s[0]) * (c.t[2] - c.t[0]) - (c.s[2] - c.s[0]) * (c.t[1] - c.t[0]);
        const F8 inTexture = sqrt(across * across);
        const V8 origin = turned(c.positions[0]), a = turned(c.positions[1]) - origin,
                 b = turned(c.positions[2]) - origin;
        const F8 inSpace = length({a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y});
        const I8 sound = (inSpace > 0.0f) & (inTexture > 0.0f);
        store(size_ + at, select(sound, sqrt(inTexture / inSpace), all(0)));
    }
}

void TextureLanes::lookTogether(const TextureUse& use, Colors& out) const {
    const TextureMatrix& m = use.matrix;
    const float stretch = m.stretch();
    for (int at = 0; at < 16; at += 8) {
        const std::uint32_t now = lanes_ >> at & 0xFFu;
        if (!now) continue;
        const F8 s = load(given_[0] + at), t = load(given_[1] + at), divisor = load(divisor_ + at);
        alignas(32) float st[2][8], width[8];
        store(st[0], (m.s.x * s + m.s.y * t + m.s.z) / divisor);
        store(st[1], (m.t.x * s + m.t.y * t + m.t.z) / divisor);
        const F8 footprint = load(footprint_ + at), size = load(size_ + at);
        store(width, select((footprint <= 0.0f) | (size <= 0.0f), all(0), footprint * size * stretch));
        Texture::Lanes found;
        use.texture->sampleLanes(st[0], st[1], width, now, use.access, space_, found);
        store(out.r + at, load(found.r)), store(out.g + at, load(found.g));
        store(out.b + at, load(found.b)), store(out.a + at, load(found.a));
    }
}

void TextureLanes::look(const Material& material, TextureRole role, Colors& out) {
    const TextureUse& use = material.texture(role);
    const std::size_t channel = slot_.channels[static_cast<std::size_t>(role)];
    if (use.texture && !use.matrix3 && isPlain(channel)) {
        findCoordinates(channel);
        return lookTogether(use, out);
    }
    LastStretch last;
    for (std::uint32_t rest = lanes_; rest; rest &= rest - 1) {
        const int lane = std::countr_zero(rest);
        const Vec4f color = lookup(lane, &last).sample(material, role);
        out.r[lane] = color.r, out.g[lane] = color.g, out.b[lane] = color.b, out.a[lane] = color.a;
    }
}

}  // namespace rtsg::trace
