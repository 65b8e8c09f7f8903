// The geometry of a particle system: a shape at the place of each particle, with colour and texture by its age.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/color_blend.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include "particles.h"
#include "shapes/tessellate_deform.h"

namespace rtsg::detail {

namespace {

using P = x3d::ParticleSystem;

enum class Look : std::uint8_t { quad, sprite, triangle, line, point, geometry };

/// Copies of a geometry have no more corners together.
constexpr std::size_t kMaxCopied = std::size_t{1} << 22;

/// 40.2.1: a geometry that is given is used, whatever the geometryType.
Look lookOf(const Scene& scene, const Node& system, Mesh& problems) {
    const std::string_view name = system.get(P::geometryType).view();
    if (scene.effectiveNode(system.get(P::geometry)) || name == "GEOMETRY") return Look::geometry;
    constexpr std::pair<std::string_view, Look> kLooks[] = {{"QUAD", Look::quad},
                                                            {"SPRITE", Look::sprite},
                                                            {"TRIANGLE", Look::triangle},
                                                            {"LINE", Look::line},
                                                            {"POINT", Look::point}};
    for (const auto& [one, look] : kLooks)
        if (name == one) return look;
    warn(problems, fmt::format("geometryType {} is not known: taken as QUAD", name));
    return Look::quad;
}

/// Values with a key each; the keys are ages in seconds.
struct Span {
    std::size_t from = 0, to = 0;
    float weight = 0;
};
Span spanAt(const Array<float>& keys, std::size_t count, double age) {
    const auto* end = keys.begin() + static_cast<std::ptrdiff_t>(count);
    const auto after = static_cast<std::size_t>(std::upper_bound(keys.begin(), end, age) - keys.begin());
    if (after == 0) return {0, 0, 0};
    if (after == count) return {count - 1, count - 1, 0};
    const double from = keys[after - 1], to = keys[after];
    return {after - 1, after, to > from ? static_cast<float>((age - from) / (to - from)) : 0.0f};
}

/// The colours of particles by age; none without keys and colours.
class ColorRamp {
  public:
    ColorRamp(const Scene& scene, const Node& system) : keys_(system.get(P::colorKey)) {
        const Node* node = scene.effectiveNode(system.get(P::color));
        if (node && node->is(x3d::Color::type)) colors_ = node->get(x3d::Color::color);
        if (node && node->is(x3d::ColorRGBA::type)) withAlpha_ = node->get(x3d::ColorRGBA::color);
        count_ = std::min(keys_.size(), std::max(colors_.size(), withAlpha_.size()));
    }
    bool present() const { return count_ > 0; }
    ColorRGBA at(double age) const {
        const Span s = spanAt(keys_, count_, age);
        if (!colors_.empty()) {
            const Color c = blend(colors_[s.from], colors_[s.to], s.weight);
            return {c.r, c.g, c.b, 1};
        }
        const ColorRGBA &a = withAlpha_[s.from], &b = withAlpha_[s.to];
        const Color c = blend(Color{a.r, a.g, a.b}, Color{b.r, b.g, b.b}, s.weight);
        return {c.r, c.g, c.b, a.a + (b.a - a.a) * s.weight};
    }
    /// `corners` colours a particle, opaque ones as Color.
    void fill(const std::vector<MovedParticle>& particles, std::size_t corners, auto& params) const {
        if (!present()) return;
        const bool opaque = !colors_.empty();
        std::vector<Color> plain;
        std::vector<ColorRGBA> clear;
        for (const MovedParticle& particle : particles) {
            const ColorRGBA c = at(particle.age);
            if (opaque)
                plain.insert(plain.end(), corners, Color{c.r, c.g, c.b});
            else
                clear.insert(clear.end(), corners, c);
        }
        params.color = toArray(plain), params.colorRGBA = toArray(clear);
    }

  private:
    Array<float> keys_;
    Array<Color> colors_;
    Array<ColorRGBA> withAlpha_;
    std::size_t count_ = 0;
};

/// Flat particles: QUAD, SPRITE and TRIANGLE.
Mesh flat(const Scene& scene, const Node& system, Look look, const std::vector<MovedParticle>& particles,
          std::optional<Vec3d> eye, Mesh& problems) {
    const bool isTriangle = look == Look::triangle;
    const std::size_t corners = isTriangle ? 3 : 4;
    const std::vector<Vec2f> shape =
        isTriangle ? std::vector<Vec2f>{{0, 0}, {1, 0}, {.5f, 1}} : std::vector<Vec2f>{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    PrimitiveSetParams set;
    set.kind = isTriangle ? PrimitiveSetParams::Kind::triangleSet : PrimitiveSetParams::Kind::quadSet;
    set.solid = set.normalPerVertex = false;
    const Array<float>& keys = system.get(P::texCoordKey);
    Array<Vec2f> ramp;
    if (const Node* node = scene.effectiveNode(system.get(P::texCoord)); node && !keys.empty()) {
        if (node->is(x3d::TextureCoordinate::type)) ramp = node->get(x3d::TextureCoordinate::point);
        if (ramp.size() / corners < keys.size()) {
            warn(problems,
                 fmt::format("texCoord has no {} points for each of {} keys: it is not used", corners, keys.size()));
            ramp = {};
        }
    }
    set.coord = Array<Vec3f>::ofSize(particles.size() * corners);
    TexCoordParams channel;
    channel.point = Array<Vec2f>::ofSize(particles.size() * corners);
    Vec3f* out = set.coord.mutableData();
    Vec2f* texture = channel.point.mutableData();
    for (const MovedParticle& particle : particles) {
        Vec3d x(1, 0, 0), y(0, 1, 0);
        if (look == Look::sprite && eye) {
            const Vec3d towards = *eye - particle.position;
            Vec3d up(0, 1, 0);
            if (!(glm::length(glm::cross(up, towards)) > 1e-9 * glm::length(towards))) up = {0, 0, -1};
            if (glm::length(towards) > 0) {
                x = glm::normalize(glm::cross(up, towards));
                y = glm::normalize(glm::cross(towards, x));
            }
        }
        const std::size_t key = ramp.empty() ? 0 : spanAt(keys, keys.size(), particle.age).from;
        for (std::size_t c = 0; c < corners; ++c) {
            const Vec2d at = (Vec2d(shape[c]) - .5) * Vec2d(particle.size);
            *out++ = Vec3f(particle.position + x * at.x + y * at.y);
            *texture++ = ramp.empty() ? shape[c] : ramp[key * corners + c];
        }
    }
    set.texCoord.push_back(std::move(channel));
    ColorRamp(scene, system).fill(particles, corners, set);
    return tessellate(set);
}

Mesh strokes(const Scene& scene, const Node& system, Look look, const std::vector<MovedParticle>& particles) {
    StrokeParams params;
    const bool lines = look == Look::line;
    std::vector<Vec3f> points;
    for (const MovedParticle& particle : particles) {
        if (!lines) {
            points.emplace_back(particle.position);
            continue;
        }
        // Along the way that it goes; upright if it goes none.
        const double speed = glm::length(particle.velocity);
        const Vec3d half = (speed > 0 ? particle.velocity / speed : Vec3d(0, 1, 0)) * (.5 * double{particle.size.y});
        points.emplace_back(particle.position - half);
        points.emplace_back(particle.position + half);
    }
    params.coord = toArray(points);
    params.kind = lines ? Mesh::Strokes::lines : Mesh::Strokes::points;
    if (lines) params.vertexCount = toArray(std::vector<std::int32_t>(particles.size(), 2));
    ColorRamp(scene, system).fill(particles, lines ? 2 : 1, params);
    return tessellate(params);
}

template <class T>
Array<T> copies(const Array<T>& one, std::size_t count) {
    std::vector<T> all;
    all.reserve(one.size() * count);
    for (std::size_t i = 0; i < count; ++i) all.insert(all.end(), one.begin(), one.end());
    return toArray(all);
}

/// Copies of lines or points.
Mesh copiedStrokes(const Scene& scene, const Node& system, const Mesh& source,
                   const std::vector<MovedParticle>& particles) {
    StrokeParams params;
    params.kind = source.strokes;
    const std::uint32_t ends = source.strokes == Mesh::Strokes::lines ? 2 : 1;
    std::vector<Vec3f> points;
    std::vector<ColorRGBA> colors;
    const ColorRamp ramp(scene, system);
    for (const MovedParticle& particle : particles)
        for (std::uint32_t s = 0; s < source.strokeCount; ++s)
            for (std::uint32_t end = 0; end < ends; ++end) {
                points.emplace_back(Vec3d(source.vertex(s, end)) + particle.position);
                if (ramp.present())
                    colors.push_back(ramp.at(particle.age));
                else if (source.colors.present())
                    colors.push_back(source.color(s, end == 0 ? 0.0f : 1.0f, 0));
            }
    params.coord = toArray(points);
    params.colorRGBA = toArray(colors);
    if (ends == 2) params.vertexCount = toArray(std::vector<std::int32_t>(points.size() / 2, 2));
    return tessellate(params);
}

Mesh copied(const Scene& scene, const Node& system, const Mesh* source, std::vector<MovedParticle> particles,
            Mesh& problems) {
    if (!source || (source->empty() && source->strokeCount == 0)) {
        warn(problems, "geometryType is GEOMETRY, and there is none: nothing is drawn");
        return Mesh();
    }
    const bool lines = source->strokeCount > 0;
    const VertexArrays one = lines ? VertexArrays{} : vertexArrays(*source);
    const std::size_t corners = lines ? 2 * std::size_t{source->strokeCount} : one.triangles.size();
    if (particles.size() > kMaxCopied / corners) {
        warn(problems, fmt::format("a geometry of {} corners is too large for so many particles: {} of them are drawn",
                                   corners, kMaxCopied / corners));
        particles.resize(kMaxCopied / corners);
    }
    if (lines) return copiedStrokes(scene, system, *source, particles);
    PrimitiveSetParams set;
    set.kind = PrimitiveSetParams::Kind::indexedTriangleSet;
    set.solid = source->solid;
    const std::size_t points = one.positions.size();
    set.coord = Array<Vec3f>::ofSize(points * particles.size());
    set.index = Array<std::int32_t>::ofSize(one.triangles.size() * particles.size());
    Vec3f* out = set.coord.mutableData();
    std::int32_t* index = set.index.mutableData();
    for (std::size_t i = 0; i < particles.size(); ++i) {
        for (const Vec3f& p : one.positions) *out++ = Vec3f(Vec3d(p) + particles[i].position);
        for (const std::uint32_t v : one.triangles) *index++ = static_cast<std::int32_t>(v + i * points);
    }
    set.normal = copies(one.normals, particles.size());
    TexCoordParams channel;
    channel.point = copies(one.texCoords, particles.size());
    set.texCoord.push_back(std::move(channel));
    if (const ColorRamp ramp(scene, system); ramp.present())
        ramp.fill(particles, points, set);
    else
        set.colorRGBA = copies(one.colors, particles.size());
    return tessellate(set);
}

}  // namespace

bool facesTheEye(const Scene& scene, const Node& system) {
    Mesh unused;
    return lookOf(scene, system, unused) == Look::sprite;
}

Mesh tessellateParticles(const Scene& scene, const Node& system, const MeshOf& meshOf, std::optional<Vec3d> eye) {
    Mesh problems;
    const Look look = lookOf(scene, system, problems);
    const std::vector<MovedParticle> particles = moveParticles(scene, system, meshOf, problems);
    Mesh mesh;
    if (!particles.empty()) {
        if (look == Look::geometry)
            mesh = copied(scene, system, meshOf(system.get(P::geometry)).get(), particles, problems);
        else if (look == Look::line || look == Look::point)
            mesh = strokes(scene, system, look, particles);
        else
            mesh = flat(scene, system, look, particles, eye, problems);
    }
    problems.diagnostics.append(mesh.diagnostics);
    mesh.diagnostics = std::move(problems.diagnostics);
    labelDiagnostics(scene, system, mesh);
    return mesh;
}

}  // namespace rtsg::detail
