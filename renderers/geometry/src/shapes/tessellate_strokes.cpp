// Lines and points: polylines to strokes of two ends each, with their colours.
#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include <rtsg/core/portable_math.h>

#include "tessellate_detail.h"

namespace rtsg {

using detail::usable;
using detail::warn;

namespace {

/// Collects strokes; each end has a place in the list of corners, by which colours are found.
class StrokeBuilder {
  public:
    StrokeBuilder(const StrokeParams& params, Mesh& mesh) : p_(params), mesh_(mesh) {}

    void points() {
        for (std::size_t i = 0; i < p_.coord.size(); ++i) add(i, i, i, i, 0);
    }
    /// `corner(i)`: the index of the i-th of `count` points; they are corners first, first + 1 ... of line `line`.
    template <class IndexOf>
    void line(std::size_t first, std::size_t count, std::size_t line, IndexOf indexOf) {
        if (count < 2) {
            ++short_;
            return;
        }
        for (std::size_t i = first; i + 1 < first + count; ++i) add(indexOf(i), indexOf(i + 1), i, i + 1, line);
    }

    void finish() {
        mesh_.positions = p_.coord;
        mesh_.triangles = detail::toArray(ends_);
        mesh_.strokes = ends_.empty() ? Mesh::Strokes::none : p_.kind;
        mesh_.strokeCount = static_cast<std::uint32_t>(ends_.size() / 3);
        mesh_.solid = false;
        if (short_ > 0) warn(mesh_, fmt::format("{} lines of fewer than two points are left out", short_));
        if (bad_ > 0)
            warn(mesh_, fmt::format("{} lines or points are left out: their coordinates do not exist or are not finite",
                                    bad_));
        if (ends_.empty()) return;
        bindFog();
        bindNormals();
        if (!p_.colorRGBA.empty())
            bind(p_.colorRGBA);
        else if (!p_.color.empty())
            bind(p_.color);
    }

  private:
    void add(std::size_t a, std::size_t b, std::size_t cornerA, std::size_t cornerB, std::size_t line) {
        if (a >= p_.coord.size() || b >= p_.coord.size() || !usable(p_.coord[a]) || !usable(p_.coord[b])) {
            ++bad_;
            return;
        }
        for (const std::size_t end : {a, b, b}) ends_.push_back(static_cast<std::int32_t>(end));
        for (const std::size_t c : {cornerA, cornerB, cornerB}) corners_.push_back(static_cast<std::int32_t>(c));
        lines_.push_back(static_cast<std::int32_t>(line));
        mesh_.bounds.extend(p_.coord[a]), mesh_.bounds.extend(p_.coord[b]);
    }

    void bindFog() {
        if (p_.fogDepth.empty()) return;
        mesh_.fogDepths = MeshAttribute(detail::inPairs(p_.fogDepth), MeshAttribute::Binding::vertex,
                                        byVertex(p_.fogDepth.size(), "fogCoord has {} depths"), 3);
    }
    void bindNormals() {
        if (p_.normal.empty()) return;
        mesh_.normals = MeshAttribute(p_.normal, MeshAttribute::Binding::vertex,
                                      byVertex(p_.normal.size(), "normal has {} vectors"), 3);
    }
    /// The index of each end's value; `has`: the message if there are too few.
    Array<std::int32_t> byVertex(std::size_t values, fmt::format_string<std::size_t&> has) {
        Array<std::int32_t> index = mesh_.triangles;
        if (values >= p_.coord.size()) return index;
        warn(mesh_, fmt::format("{} for {} points: the last one goes on", fmt::format(has, values), p_.coord.size()));
        std::int32_t* i = index.mutableData();
        for (std::size_t k = 0; k < index.size(); ++k) i[k] = std::min(i[k], static_cast<std::int32_t>(values) - 1);
        return index;
    }

    template <class T>
    void bind(const Array<T>& values) {
        const bool lines = p_.kind == Mesh::Strokes::lines, byLine = lines && !p_.colorPerVertex;
        const Array<std::int32_t>& index = p_.colorIndex.empty() ? p_.coordIndex : p_.colorIndex;
        const Array<std::int32_t>* through = nullptr;
        if (lines && p_.indexed) through = !byLine ? &index : p_.colorIndex.empty() ? nullptr : &p_.colorIndex;
        std::size_t repairs = 0;
        std::vector<std::int32_t>& positions = byLine ? lines_ : corners_;
        for (std::int32_t& slot : positions) {
            std::size_t value = static_cast<std::size_t>(slot);
            if (through)
                value = value < through->size() ? static_cast<std::uint32_t>((*through)[value]) : values.size();
            if (value >= values.size()) ++repairs, value = values.size() - 1;
            slot = static_cast<std::int32_t>(value);
        }
        if (repairs > 0)
            warn(mesh_, fmt::format("color refers to values that do not exist: {} ends or lines use the last of the {} "
                                    "there are",
                                    repairs, values.size()));
        mesh_.colors = MeshAttribute(values, byLine ? MeshAttribute::Binding::face : MeshAttribute::Binding::corner,
                                     detail::toArray(positions), byLine ? 1 : 3);
    }

    const StrokeParams& p_;
    Mesh& mesh_;
    std::vector<std::int32_t> ends_, corners_, lines_;
    std::size_t short_ = 0, bad_ = 0;
};

}  // namespace

Mesh tessellate(const StrokeParams& p) {
    Mesh mesh;
    StrokeBuilder builder(p, mesh);
    if (p.kind == Mesh::Strokes::points) {
        builder.points();
    } else if (p.indexed) {
        std::size_t line = 0;
        const auto indexOf = [&](std::size_t i) { return std::size_t{static_cast<std::uint32_t>(p.coordIndex[i])}; };
        for (std::size_t first = 0; first < p.coordIndex.size(); ++line) {
            std::size_t end = first;
            while (end < p.coordIndex.size() && p.coordIndex[end] >= 0) ++end;
            builder.line(first, end - first, line, indexOf);
            first = end + 1;
        }
    } else {
        std::size_t first = 0, line = 0;
        for (const std::int32_t count : p.vertexCount) {
            const std::size_t wanted = count > 0 ? static_cast<std::size_t>(count) : 0;
            const std::size_t there = std::min(wanted, p.coord.size() - first);
            if (there < wanted)
                warn(mesh, fmt::format("vertexCount asks for {} points, and {} are left", wanted, there));
            builder.line(first, there, line++, [](std::size_t i) { return i; });
            first += there;
            if (there < wanted) break;
        }
    }
    builder.finish();
    return mesh;
}

Mesh tessellate(const Arc2DParams& p, const TessellationOptions& options) {
    Mesh none;
    if (!(p.radius > 0) || !usable(p.radius)) {
        warn(none, fmt::format("radius {} is not above 0 and up to {:g}: nothing is drawn", p.radius,
                               detail::kLargestCoordinate));
        return none;
    }
    constexpr double angle = 2 * std::numbers::pi;
    if (!usable(p.startAngle) || !usable(p.endAngle)) {
        warn(none, "startAngle and endAngle are not finite: nothing is drawn");
        return none;
    }
    // 14.3.1, as ArcClose2D: equal angles, or a whole turn between them, give the whole circle.
    const double span = double{p.endAngle} - double{p.startAngle};
    double sweep = span == 0 || std::abs(span) >= angle - 1e-6 ? angle : std::fmod(span, angle);
    if (sweep < 0) sweep += angle;
    const int n = std::max(1, static_cast<int>(std::ceil(options.segmentsAround() * sweep / angle)));
    StrokeParams line;
    line.coord = Array<Vec3f>::ofSize(static_cast<std::size_t>(n) + 1);
    line.vertexCount = {n + 1};
    Vec3f* out = line.coord.mutableData();
    for (int i = 0; i <= n; ++i) {
        const double a = p.startAngle + (sweep == angle && i == n ? 0 : sweep * i / n);
        out[i] = p.radius * Vec3f(static_cast<float>(portable::cos(a)), static_cast<float>(portable::sin(a)), 0);
    }
    Mesh mesh = tessellate(line);
    mesh.curveSize = p.radius;
    return mesh;
}

}  // namespace rtsg
