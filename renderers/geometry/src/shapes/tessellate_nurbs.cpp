// NURBS curves and surfaces: sampled as finely as their error asks for, surfaces trimmed by contours.
#include "tessellate_nurbs.h"

#include <algorithm>
#include <deque>
#include <functional>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/nurbs.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "glu.h"

namespace rtsg::detail {

namespace {

constexpr int kMaxPieces = 512;            // of one span between knots
constexpr std::size_t kMaxSamples = 4096;  // along one parameter
constexpr int kProbes = 8;                 // places of a span where its bend is looked at

std::span<const double> spanOf(const Array<double>& values) {
    return {values.data(), values.size()};
}

double halfDiagonal(const NurbsPoints& points) {
    Vec3d low(std::numeric_limits<double>::infinity()), high = -low;
    for (const Vec4d& p : points) low = glm::min(low, Vec3d(p) / p.w), high = glm::max(high, Vec3d(p) / p.w);
    return points.empty() ? 0 : glm::length(high - low) / 2;
}

/// The largest second derivative on [a, b] that differences of `at` tell.
template <class At>
double bendOf(double a, double b, const At& at) {
    const double h = (b - a) / kProbes;
    auto p0 = at(a), p1 = at(a + h);
    double maximum = 0;
    for (int k = 2; k <= kProbes; ++k) {
        const auto p2 = at(a + k * h);
        maximum = std::max(maximum, glm::length(p0 - 2.0 * p1 + p2) / (h * h));
        p0 = p1, p1 = p2;
    }
    return maximum;
}

int piecesFor(double length, double bend, double error) {
    // A chord of length h in the parameter lies within h^2 |second derivative| / 8.
    const double wanted = error > 0 ? std::ceil(length * std::sqrt(bend / (8 * error)) * 1.02) : kMaxPieces;
    return static_cast<int>(std::clamp(wanted, 1.0, double{kMaxPieces}));
}

/// `pieces[i]` equal parts of each span, ends included.
std::vector<double> parameters(const std::vector<double>& breaks, const std::vector<int>& pieces) {
    std::vector<double> result{breaks.front()};
    for (std::size_t i = 0; i + 1 < breaks.size(); ++i)
        for (int k = 1; k <= pieces[i]; ++k)
            result.push_back(k == pieces[i] ? breaks[i + 1] : breaks[i] + (breaks[i + 1] - breaks[i]) * k / pieces[i]);
    return result;
}

/// 27.2: a number above 0 is how many parts there are, one below how many for each control point. Empty: as the error
/// says.
std::vector<double> evenPositions(const NurbsBasis& basis, std::int32_t tessellation) {
    if (tessellation == 0) return {};
    const auto asked = static_cast<double>(tessellation);
    const double wanted = asked > 0 ? asked : -asked * static_cast<double>(basis.count());
    const auto n = static_cast<std::size_t>(std::clamp(wanted, 1.0, static_cast<double>(kMaxSamples)));
    std::vector<double> result;
    for (std::size_t i = 0; i <= n; ++i)
        result.push_back(basis.first() +
                         (basis.last() - basis.first()) * static_cast<double>(i) / static_cast<double>(n));
    return result;
}

template <class Curve>
std::vector<double> curvePositions(const NurbsBasis& basis, std::int32_t tessellation, double error, const Curve& at) {
    if (auto even = evenPositions(basis, tessellation); !even.empty()) return even;
    const std::vector<double> breaks = basis.breaks();
    std::vector<int> pieces;
    for (std::size_t i = 0; i + 1 < breaks.size(); ++i)
        pieces.push_back(piecesFor(breaks[i + 1] - breaks[i], bendOf(breaks[i], breaks[i + 1], at), error));
    return parameters(breaks, pieces);
}

/// How finely a surface is cut along both parameters.
class Cuts {
  public:
    Cuts(const NurbsSurface& s, std::int32_t tessellationU, std::int32_t tessellationV, double error)
        : us(evenPositions(s.u, tessellationU)), vs(evenPositions(s.v, tessellationV)) {
        // The bound for two triangles is h_u^2 |S_uu| + 2 h_u h_v |S_uv| + h_v^2 |S_vv| <= 8 error (Filip, Magedson and
        // Markot 1986), half of it for the twist.
        const std::vector<double> breaksU = s.u.breaks(), breaksV = s.v.breaks();
        const std::vector<double> lookU = probes(breaksU), lookV = probes(breaksV);
        std::vector<int> piecesU, piecesV;
        for (std::size_t i = 0; i + 1 < breaksU.size(); ++i) {
            double bend = 0;
            for (const double v : lookV)
                bend = std::max(bend, bendOf(breaksU[i], breaksU[i + 1], [&](double u) { return s.at(u, v); }));
            piecesU.push_back(piecesFor(breaksU[i + 1] - breaksU[i], bend, error / 4));
        }
        for (std::size_t i = 0; i + 1 < breaksV.size(); ++i) {
            double bend = 0;
            for (const double u : lookU)
                bend = std::max(bend, bendOf(breaksV[i], breaksV[i + 1], [&](double v) { return s.at(u, v); }));
            piecesV.push_back(piecesFor(breaksV[i + 1] - breaksV[i], bend, error / 4));
        }
        twist(s, breaksU, breaksV, error, piecesU, piecesV);
        if (us.empty()) us = parameters(breaksU, piecesU);
        if (vs.empty()) vs = parameters(breaksV, piecesV);
    }
    std::vector<double> us, vs;

  private:
    /// Places to look at: some in each span, but not too many.
    static std::vector<double> probes(const std::vector<double>& breaks) {
        const int n = breaks.size() > 40 ? 1 : 4;
        return parameters(breaks, std::vector<int>(breaks.size(), n));
    }
    static void twist(const NurbsSurface& s, const std::vector<double>& breaksU, const std::vector<double>& breaksV,
                      double error, std::vector<int>& piecesU, std::vector<int>& piecesV) {
        for (std::size_t i = 0; i + 1 < breaksU.size(); ++i)
            for (std::size_t j = 0; j + 1 < breaksV.size(); ++j) {
                const double a = breaksU[i], du = breaksU[i + 1] - a, b = breaksV[j], dv = breaksV[j + 1] - b;
                double maximum = 0;
                constexpr int n = 3;
                for (int x = 0; x < n; ++x)
                    for (int y = 0; y < n; ++y) {
                        const auto at = [&](int p, int q) { return s.at(a + du * p / n, b + dv * q / n); };
                        const Vec3d mixed = at(x + 1, y + 1) - at(x, y + 1) - at(x + 1, y) + at(x, y);
                        maximum = std::max(maximum, glm::length(mixed) * n * n);
                    }
                // du dv |S_uv| / (pieces u pieces v) / 4 <= error / 2
                const double ratio = maximum / (2 * error * piecesU[i] * piecesV[j]);
                if (!(ratio > 1)) continue;
                const double factor = std::sqrt(ratio);
                for (int* p : {&piecesU[i], &piecesV[j]})
                    *p = static_cast<int>(std::min(std::ceil(*p * factor), double{kMaxPieces}));
            }
    }
};

// ---- trimming -----------------------------------------------------------------------------------------------------

using Contour = std::vector<Vec2d>;

/// Sutherland and Hodgman's cut at one side of a box: on axis 0 or 1, keeps the part on the `sign` side of `at`.
Contour cutAt(const Contour& polygon, int axis, double sign, double at) {
    Contour result;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec2d& a = polygon[i];
        const Vec2d& b = polygon[(i + 1) % polygon.size()];
        const double da = sign * (a[axis] - at), db = sign * (b[axis] - at);
        if (da >= 0) result.push_back(a);
        if ((da >= 0) == (db >= 0)) continue;
        Vec2d cross = a + (b - a) * (da / (da - db));
        cross[axis] = at;
        result.push_back(cross);
    }
    return result;
}

/// The triangles of some contours' inside, by the odd rule, with GLU.
class ContourCutter {
  public:
    ContourCutter() : tessellator_(newTessellator()) {
        const auto set = [&](GLenum which, auto callback) {
            gluTessCallback(tessellator_, which, reinterpret_cast<void (*)()>(callback));
        };
        set(
            GLU_TESS_VERTEX_DATA, +[](void* vertex, void* user) {
                static_cast<ContourCutter*>(user)->out_.push_back(*static_cast<const Vec2d*>(vertex));
            });
        set(
            GLU_TESS_COMBINE_DATA, +[](GLdouble at[3], void**, GLfloat*, void** out, void* user) {
                auto& points = static_cast<ContourCutter*>(user)->points_;
                points.emplace_back(at[0], at[1]);
                *out = &points.back();
            });
        set(GLU_TESS_EDGE_FLAG, +[](GLboolean) {});  // its presence makes the library emit separate triangles only
        gluTessProperty(tessellator_, GLU_TESS_WINDING_RULE, GLU_TESS_WINDING_ODD);
        gluTessNormal(tessellator_, 0, 0, 1);
    }
    ContourCutter(const ContourCutter&) = delete;
    ContourCutter& operator=(const ContourCutter&) = delete;
    ~ContourCutter() { gluDeleteTess(tessellator_); }

    /// Three points a triangle, counter-clockwise.
    const std::vector<Vec2d>& cut(const std::vector<Contour>& contours) {
        points_.clear(), out_.clear();
        gluTessBeginPolygon(tessellator_, this);
        for (const Contour& contour : contours) {
            gluTessBeginContour(tessellator_);
            for (const Vec2d& p : contour) {
                points_.push_back(p);
                GLdouble at[3] = {p.x, p.y, 0};
                gluTessVertex(tessellator_, at, &points_.back());
            }
            gluTessEndContour(tessellator_);
        }
        gluTessEndPolygon(tessellator_);
        return out_;
    }

  private:
    GLUtesselator* tessellator_;
    std::deque<Vec2d> points_;  // never move: the library is given their addresses
    std::vector<Vec2d> out_;
};

bool isInside(const std::vector<Contour>& contours, const Vec2d& at) {
    bool inside = false;
    for (const Contour& c : contours)
        for (std::size_t i = 0; i < c.size(); ++i) {
            const Vec2d& a = c[i];
            const Vec2d& b = c[(i + 1) % c.size()];
            if ((a.y > at.y) != (b.y > at.y) && at.x < a.x + (b.x - a.x) * (at.y - a.y) / (b.y - a.y)) inside = !inside;
        }
    return inside;
}

// ---- surfaces -----------------------------------------------------------------------------------------------------

/// The texture coordinates of a surface: a NURBS of their own, or the place in the domain.
struct SurfaceTexture {
    NurbsSurface coordinates;  // z = 0; without points: none
    bool ccw = true, solid = true;
};

class SurfaceMesher {
  public:
    SurfaceMesher(const NurbsSurface& surface, const SurfaceTexture& texture) : s_(surface), t_(texture) {}

    void grid(const Cuts& cuts) {
        const std::size_t nu = cuts.us.size(), nv = cuts.vs.size();
        for (const double v : cuts.vs)
            for (const double u : cuts.us) (void)add({u, v});
        for (std::size_t j = 0; j + 1 < nv; ++j)
            for (std::size_t i = 0; i + 1 < nu; ++i) {
                const int a = static_cast<int>(j * nu + i), below = static_cast<int>(nu);
                quad(a, a + 1, a + 1 + below, a + below);
            }
    }
    void trimmed(const Cuts& cuts, const std::vector<Contour>& contours) {
        const std::size_t nu = cuts.us.size() - 1, nv = cuts.vs.size() - 1;
        std::vector<bool> crossed(nu * nv);
        const auto cellOf = [](const std::vector<double>& parameters, double x) {
            const auto after = std::upper_bound(parameters.begin(), parameters.end(), x) - parameters.begin();
            return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(after - 1, 0, std::ssize(parameters) - 2));
        };
        for (const Contour& c : contours)
            for (std::size_t k = 0; k < c.size(); ++k) {
                const Vec2d low = glm::min(c[k], c[(k + 1) % c.size()]), high = glm::max(c[k], c[(k + 1) % c.size()]);
                // A side that lies on the border of two cells crosses both.
                const double slackU = 1e-12 * (cuts.us.back() - cuts.us.front()),
                             slackV = 1e-12 * (cuts.vs.back() - cuts.vs.front());
                for (std::size_t j = cellOf(cuts.vs, low.y - slackV); j <= cellOf(cuts.vs, high.y + slackV); ++j)
                    for (std::size_t i = cellOf(cuts.us, low.x - slackU); i <= cellOf(cuts.us, high.x + slackU); ++i)
                        crossed[j * nu + i] = true;
            }
        ContourCutter cutter;
        for (std::size_t j = 0; j < nv; ++j)
            for (std::size_t i = 0; i < nu; ++i) {
                const Vec2d low(cuts.us[i], cuts.vs[j]), high(cuts.us[i + 1], cuts.vs[j + 1]);
                if (crossed[j * nu + i])
                    cell(contours, low, high, cutter);
                else if (isInside(contours, (low + high) * .5))
                    quad(add(low), add({high.x, low.y}), add(high), add({low.x, high.y}));
            }
    }
    void finish(Mesh& mesh) const {
        mesh.solid = t_.solid;
        out_.finish(mesh);
        if (!mesh.texCoords.empty()) mesh.texCoords[0].authored = !t_.coordinates.points.empty();
    }

  private:
    int add(const Vec2d& at) {
        const auto [found, isNew] = known_.try_emplace({at.x, at.y}, static_cast<int>(out_.positions.size()));
        if (!isNew) return found->second;
        out_.addPosition(Vec3f(s_.at(at.x, at.y)));
        out_.addNormal(Vec3f(s_.normal(at.x, at.y)) * (t_.ccw ? 1.0f : -1.0f));
        const Vec2d fraction((at.x - s_.u.first()) / (s_.u.last() - s_.u.first()),
                             (at.y - s_.v.first()) / (s_.v.last() - s_.v.first()));
        if (t_.coordinates.points.empty()) {
            out_.addTexCoord(Vec2f(fraction));
        } else {
            const NurbsBasis& u = t_.coordinates.u;
            const NurbsBasis& v = t_.coordinates.v;
            out_.addTexCoord(Vec2f(t_.coordinates.at(u.first() + fraction.x * (u.last() - u.first()),
                                                     v.first() + fraction.y * (v.last() - v.first()))));
        }
        return found->second;
    }
    void triangle(int a, int b, int c) {
        const Vec3f& p = out_.positions[static_cast<std::size_t>(a)];
        const Vec3f& q = out_.positions[static_cast<std::size_t>(b)];
        const Vec3f& r = out_.positions[static_cast<std::size_t>(c)];
        if (p == q || q == r || r == p || !usable(p) || !usable(q) || !usable(r)) return;  // at a pole
        if (!t_.ccw) std::swap(b, c);
        out_.addTriangle({a, a, a}, {b, b, b}, {c, c, c});
    }
    void quad(int a, int b, int c, int d) { triangle(a, b, c), triangle(a, c, d); }
    void cell(const std::vector<Contour>& contours, const Vec2d& low, const Vec2d& high, ContourCutter& cutter) {
        std::vector<Contour> here;
        for (const Contour& contour : contours) {
            Contour part = cutAt(cutAt(cutAt(cutAt(contour, 0, 1, low.x), 0, -1, high.x), 1, 1, low.y), 1, -1, high.y);
            if (part.size() >= 3) here.push_back(std::move(part));
        }
        if (here.empty()) return;
        const std::vector<Vec2d>& corners = cutter.cut(here);
        for (std::size_t k = 0; k + 2 < corners.size(); k += 3)
            triangle(add(corners[k]), add(corners[k + 1]), add(corners[k + 2]));
    }

    struct UvHash {
        std::size_t operator()(const std::pair<double, double>& p) const {
            return std::hash<double>()(p.first) * 31 + std::hash<double>()(p.second);
        }
    };
    const NurbsSurface& s_;
    const SurfaceTexture& t_;
    CornerMesh out_;
    std::unordered_map<std::pair<double, double>, int, UvHash> known_;
};

// ---- nodes --------------------------------------------------------------------------------------------------------

/// Whether even knots stand in for those given: none are, or they do not fit.
bool takesEvenKnots(int order, std::size_t count, std::span<const double> knots) {
    bool replaced = false;
    if (NurbsBasis::fits(order, count)) NurbsBasis(order, count, knots, &replaced);
    return replaced;
}

/// Closed ones without knots of their own go around evenly: the first points come again after the last. False: they do
/// not end where they begin.
bool closeEvenly(int order, std::vector<Vec3d>& points, std::vector<double>& weights) {
    if (points.size() < 2 || points.front() != points.back()) return false;
    const std::size_t n = points.size() - 1;
    weights.resize(points.size(), 1);
    for (int i = 1; i + 1 < order; ++i) {
        points.push_back(points[static_cast<std::size_t>(i) % n]);
        weights.push_back(weights[static_cast<std::size_t>(i) % n]);
    }
    return true;
}

class NurbsReader {
  public:
    NurbsReader(const Scene& scene, const Node& node, const TessellationOptions& options)
        : scene_(scene), node_(node), options_(options) {}

    Mesh run() {
        if (node_.is(x3d::NurbsCurve::type))
            curve();
        else if (node_.is(x3d::NurbsPatchSurface::type))
            patch<x3d::NurbsPatchSurface>({});
        else if (node_.is(x3d::NurbsTrimmedSurface::type))
            patch<x3d::NurbsTrimmedSurface>(contours());
        else if (node_.is(x3d::NurbsSweptSurface::type))
            swept();
        else
            swung();
        return std::move(mesh_);
    }

  private:
    std::vector<Vec3d> points(NodeId id) {
        std::vector<Vec3d> result;
        const Node* node = scene_.effectiveNode(id);
        if (!node) return result;
        const auto take = [&](const auto& list) {
            result.reserve(list.size());
            for (const auto& p : list) result.emplace_back(p);
        };
        if (node->is(x3d::Coordinate::type))
            take(node->get(x3d::Coordinate::point));
        else if (node->is(x3d::CoordinateDouble::type))
            take(node->get(x3d::CoordinateDouble::point));
        else
            warn(mesh_, fmt::format("controlPoint: {} is not supported here and left out", node->type().name));
        return checked(std::move(result));
    }
    std::vector<Vec3d> checked(std::vector<Vec3d> list) {
        for (const Vec3d& p : list)
            if (!usable(Vec3f(p))) {
                warn(mesh_, "a control point is not finite: nothing is drawn");
                return {};
            }
        return list;
    }
    void reportOfKnots(int order, std::size_t count, const Array<double>& knots, const char* name) {
        if (!knots.empty())
            warn(mesh_, fmt::format("the knots{} do not fit {} control points of order {}: taken as even", name, count,
                                    order));
    }
    /// Warns unless there are as many weights as control points, or none, in which case all are 1.
    void reportOfWeights(std::size_t weights, std::size_t points) {
        if (weights != 0 && weights != points)
            warn(mesh_, fmt::format("{} weights for {} control points: those that are missing are 1", weights, points));
    }
    /// `even`: in place of the knots; `around`: the first points come again in the end.
    bool basis(int order, std::size_t count, std::span<const double> knots, const char* name, bool even, bool around,
               NurbsBasis& out) {
        using Ends = NurbsBasis::EvenEnds;
        if (!NurbsBasis::fits(order, count)) {
            warn(mesh_,
                 fmt::format("{} control points{} for an order of {}: it is from 2 to {}, and there are as many points "
                             "at least; nothing is drawn",
                             count, name, order, NurbsBasis::kMaxOrder));
            return false;
        }
        if (even) knots = {};
        out = NurbsBasis(order, count, knots, nullptr, around ? Ends::periodic : Ends::clamped);
        return true;
    }

    bool readCurve(const Node& node, NurbsCurve& out) {
        using C = x3d::NurbsCurve;
        return make(points(node.get(C::controlPoint)), node.get(C::weight), node.get(C::knot), node.get(C::order),
                    node.get(C::closed), out);
    }
    bool make(std::vector<Vec3d> list, const Array<double>& weight, const Array<double>& knot, int order, bool closed,
              NurbsCurve& out) {
        std::vector<double> weights(weight.begin(), weight.end());
        reportOfWeights(weights.size(), list.size());
        const bool even = takesEvenKnots(order, list.size(), spanOf(knot));
        if (even) reportOfKnots(order, list.size(), knot, "");
        const bool around = closed && even && closeEvenly(order, list, weights);
        out.points = nurbsPoints(list, weights);
        return basis(order, list.size(), spanOf(knot), "", even, around, out.basis);
    }
    /// A NurbsCurve2D, or a ContourPolyline2D, which is one of order 2.
    bool readFlat(NodeId id, NurbsCurve& out, std::int32_t& tessellation) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return false;
        std::vector<Vec3d> list;
        const auto take = [&](const Array<Vec2d>& from) {
            for (const Vec2d& p : from) list.emplace_back(p, 0);
            list = checked(std::move(list));
        };
        tessellation = 0;
        if (node->is(x3d::NurbsCurve2D::type)) {
            using C = x3d::NurbsCurve2D;
            take(node->get(C::controlPoint));
            tessellation = node->get(C::tessellation);
            return make(std::move(list), node->get(C::weight), node->get(C::knot), node->get(C::order),
                        node->get(C::closed), out);
        }
        if (!node->is(x3d::ContourPolyline2D::type)) return false;
        take(node->get(x3d::ContourPolyline2D::controlPoint));
        return make(std::move(list), {}, {}, 2, false, out);
    }
    double error(const NurbsPoints& list) const { return double{options_.chordError} * halfDiagonal(list); }

    std::vector<Vec3d> sampled(const NurbsCurve& c, std::int32_t tessellation, double allowed) {
        std::vector<Vec3d> result;
        for (const double u : curvePositions(c.basis, tessellation, allowed, [&](double x) { return c.at(x); }))
            result.push_back(c.at(u));
        return result;
    }

    void curve() {
        NurbsCurve c;
        if (!readCurve(node_, c)) return;
        StrokeParams line;
        const auto list = sampled(c, node_.get(x3d::NurbsCurve::tessellation), error(c.points));
        line.coord = Array<Vec3f>::ofSize(list.size());
        Vec3f* to = line.coord.mutableData();
        for (const Vec3d& p : list) *to++ = Vec3f(p);
        line.vertexCount = {static_cast<std::int32_t>(list.size())};
        add(tessellate(line));
        mesh_.curveSize = static_cast<float>(halfDiagonal(c.points));
    }
    void add(Mesh created) {
        mesh_.diagnostics.append(created.diagnostics);
        created.diagnostics = std::move(mesh_.diagnostics);
        mesh_ = std::move(created);
    }

    std::vector<Contour> contours() {
        std::vector<Contour> result;
        for (const NodeId id : node_.get(x3d::NurbsTrimmedSurface::trimmingContour)) {
            const Node* node = scene_.effectiveNode(id);
            if (!node || !node->is(x3d::Contour2D::type)) continue;
            Contour contour;
            for (const NodeId child : node->get(x3d::Contour2D::children)) {
                NurbsCurve c;
                std::int32_t tessellation = 0;
                if (!readFlat(child, c, tessellation)) continue;
                for (const Vec3d& p : sampled(c, tessellation, error(c.points)))
                    if (contour.empty() || contour.back() != Vec2d(p)) contour.emplace_back(p);
            }
            if (contour.size() > 1 && contour.front() == contour.back()) contour.pop_back();
            if (contour.size() >= 3) result.push_back(std::move(contour));
        }
        return result;
    }

    template <class T>
    void patch(const std::vector<Contour>& trim) {
        NurbsSurface s;
        std::vector<Vec3d> list = points(node_.get(T::controlPoint));
        const auto counts = [](std::int32_t n) { return static_cast<std::size_t>(std::max(n, 0)); };
        std::size_t nu = counts(node_.get(T::uDimension)), nv = counts(node_.get(T::vDimension));
        if (nu == 0 || nv == 0 || list.size() / nu < nv) {
            warn(mesh_, fmt::format("{} control points for {} times {}: nothing is drawn", list.size(), nu, nv));
            return;
        }
        list.resize(nu * nv);
        std::vector<double> weights(node_.get(T::weight).begin(), node_.get(T::weight).end());
        reportOfWeights(weights.size(), list.size());
        weights.resize(list.size(), 1);
        const int orderU = node_.get(T::uOrder), orderV = node_.get(T::vOrder);
        const std::size_t plainU = nu, plainV = nv;
        const auto knotsU = spanOf(node_.get(T::uKnot)), knotsV = spanOf(node_.get(T::vKnot));
        const bool evenU = takesEvenKnots(orderU, nu, knotsU), evenV = takesEvenKnots(orderV, nv, knotsV);
        if (evenU) reportOfKnots(orderU, nu, node_.get(T::uKnot), " along u");
        if (evenV) reportOfKnots(orderV, nv, node_.get(T::vKnot), " along v");
        const bool aroundU = node_.get(T::uClosed) && evenU && closeU(orderU, nu, nv, list, weights);
        const bool aroundV = node_.get(T::vClosed) && evenV && closeV(orderV, nu, nv, list, weights);
        if (!basis(orderU, nu, knotsU, " along u", evenU, aroundU, s.u) ||
            !basis(orderV, nv, knotsV, " along v", evenV, aroundV, s.v))
            return;
        s.points = nurbsPoints(list, weights);
        SurfaceTexture texture;
        texture.solid = node_.get(T::solid);
        readTexture(node_.get(T::texCoord), s, plainU == nu && plainV == nv, texture);
        surface(s, texture, node_.get(T::uTessellation), node_.get(T::vTessellation), trim);
    }
    static bool closeU(int order, std::size_t& nu, std::size_t nv, std::vector<Vec3d>& list,
                       std::vector<double>& weights) {
        for (std::size_t j = 0; j < nv; ++j)
            if (nu < 2 || list[j * nu] != list[j * nu + nu - 1]) return false;
        std::vector<Vec3d> closed;
        std::vector<double> closedWeights;
        std::size_t wide = nu;
        for (std::size_t j = 0; j < nv; ++j) {
            const auto first = static_cast<std::ptrdiff_t>(j * nu), end = static_cast<std::ptrdiff_t>(j * nu + nu);
            std::vector<Vec3d> row(list.begin() + first, list.begin() + end);
            std::vector<double> rowWeights(weights.begin() + first, weights.begin() + end);
            closeEvenly(order, row, rowWeights);
            wide = row.size();
            closed.insert(closed.end(), row.begin(), row.end());
            closedWeights.insert(closedWeights.end(), rowWeights.begin(), rowWeights.end());
        }
        list = std::move(closed), weights = std::move(closedWeights), nu = wide;
        return true;
    }
    static bool closeV(int order, std::size_t nu, std::size_t& nv, std::vector<Vec3d>& list,
                       std::vector<double>& weights) {
        for (std::size_t i = 0; i < nu; ++i)
            if (nv < 2 || list[i] != list[(nv - 1) * nu + i]) return false;
        const std::size_t rows = nv - 1;
        for (int k = 1; k + 1 < order; ++k, ++nv)
            for (std::size_t i = 0; i < nu; ++i) {
                const std::size_t from = static_cast<std::size_t>(k) % rows * nu + i;
                list.emplace_back(list[from]), weights.push_back(double{weights[from]});
            }
        return true;
    }

    void readTexture(NodeId id, const NurbsSurface& s, bool plain, SurfaceTexture& out) {
        const Node* node = scene_.effectiveNode(id);
        if (!node) return;
        std::vector<Vec3d> list;
        if (node->is(x3d::TextureCoordinate::type)) {
            // One for each control point, blended as these are.
            for (const Vec2f& p : node->get(x3d::TextureCoordinate::point)) list.emplace_back(p.x, p.y, 0);
            if (!plain || list.size() < s.points.size()) {
                warn(mesh_, fmt::format("texCoord has {} points for {} control points: not used", list.size(),
                                        s.points.size()));
                return;
            }
            out.coordinates = {s.u, s.v, {}};
            for (std::size_t i = 0; i < s.points.size(); ++i)
                out.coordinates.points.emplace_back(list[i] * s.points[i].w, s.points[i].w);
        } else if (node->is(x3d::NurbsTextureCoordinate::type)) {
            using T = x3d::NurbsTextureCoordinate;
            for (const Vec2f& p : node->get(T::controlPoint)) list.emplace_back(p.x, p.y, 0);
            const auto nu = static_cast<std::size_t>(std::max(node->get(T::uDimension), 0)),
                       nv = static_cast<std::size_t>(std::max(node->get(T::vDimension), 0));
            NurbsSurface created;
            if (nu == 0 || list.size() / nu < nv) {
                warn(mesh_, fmt::format("texCoord: {} control points for {} times {}: not used", list.size(), nu, nv));
                return;
            }
            list.resize(nu * nv);
            const auto alongSide = [&](int order, std::size_t count, const Array<double>& knots, const char* name,
                                       NurbsBasis& to) {
                const bool even = takesEvenKnots(order, count, spanOf(knots));
                if (even) reportOfKnots(order, count, knots, name);
                return basis(order, count, spanOf(knots), name, even, false, to);
            };
            if (!alongSide(node->get(T::uOrder), nu, node->get(T::uKnot), " of texCoord along u", created.u) ||
                !alongSide(node->get(T::vOrder), nv, node->get(T::vKnot), " of texCoord along v", created.v))
                return;
            created.points = nurbsPoints(list, spanOf(node->get(T::weight)));
            out.coordinates = std::move(created);
        } else {
            warn(mesh_, fmt::format("texCoord: {} is not supported here and left out", node->type().name));
        }
    }

    void surface(const NurbsSurface& s, const SurfaceTexture& texture, std::int32_t tessellationU,
                 std::int32_t tessellationV, const std::vector<Contour>& trim) {
        double allowed = error(s.points);
        Cuts cuts(s, tessellationU, tessellationV, allowed);
        while (cuts.us.size() * cuts.vs.size() > kMaxVertices / 32) {
            allowed *= 4;
            warn(mesh_,
                 fmt::format("cut less finely than asked for: {} times {} points", cuts.us.size(), cuts.vs.size()));
            cuts = Cuts(s, 0, 0, allowed);
        }
        SurfaceMesher mesher(s, texture);
        if (trim.empty())
            mesher.grid(cuts);
        else
            mesher.trimmed(cuts, trim);
        Mesh created;
        mesher.finish(created);
        if (created.empty() && !trim.empty())
            warn(created,
                 fmt::format("nothing of it is within its trimming contours, over a domain from {} {} to {} {}",
                             s.u.first(), s.v.first(), s.u.last(), s.v.last()));
        add(std::move(created));
        // Twice the size, as for a Sphere, since the errors of both directions may add up.
        mesh_.curveSize = static_cast<float>(2 * halfDiagonal(s.points));
    }

    /// The cross section along the trajectory, as an Extrusion has it along its spine (27.4.11).
    void swept() {
        using S = x3d::NurbsSweptSurface;
        NurbsCurve section, curve;
        std::int32_t tessellation = 0;
        const Node* trajectory = scene_.effectiveNode(node_.get(S::trajectoryCurve));
        if (!trajectory || !trajectory->is(x3d::NurbsCurve::type) || !readCurve(*trajectory, curve) ||
            !readFlat(node_.get(S::crossSectionCurve), section, tessellation)) {
            warn(mesh_, "it has no trajectory or no cross section: nothing is drawn");
            return;
        }
        ExtrusionParams p;
        p.crossSection = {}, p.spine = {};
        for (const Vec3d& at : sampled(section, tessellation, error(section.points)))
            p.crossSection.push_back(Vec2f(Vec2d(at)));
        const double size = halfDiagonal(curve.points) + halfDiagonal(section.points);
        for (const Vec3d& at :
             sampled(curve, trajectory->get(x3d::NurbsCurve::tessellation), double{options_.chordError} * size))
            p.spine.push_back(Vec3f(at));
        p.beginCap = p.endCap = false;
        p.ccw = node_.get(S::ccw), p.solid = node_.get(S::solid);
        p.creaseAngle = 3.14f;
        add(tessellate(p));
        mesh_.curveSize = static_cast<float>(2 * size);
    }

    /// The profile turned and stretched by the trajectory (27.4.12): (p.x t.x, p.y, p.x t.y).
    void swung() {
        using S = x3d::NurbsSwungSurface;
        NurbsCurve profile, curve;
        std::int32_t tessellationU = 0, tessellationV = 0;
        if (!readFlat(node_.get(S::profileCurve), profile, tessellationU) ||
            !readFlat(node_.get(S::trajectoryCurve), curve, tessellationV)) {
            warn(mesh_, "it has no profile or no trajectory: nothing is drawn");
            return;
        }
        NurbsSurface s{profile.basis, curve.basis, {}};
        for (const Vec4d& t : curve.points)
            for (const Vec4d& p : profile.points) s.points.emplace_back(p.x * t.x, p.y * t.w, p.x * t.y, p.w * t.w);
        SurfaceTexture texture;
        texture.ccw = node_.get(S::ccw), texture.solid = node_.get(S::solid);
        surface(s, texture, tessellationU, tessellationV, {});
    }

    const Scene& scene_;
    const Node& node_;
    const TessellationOptions& options_;
    Mesh mesh_;
};

}  // namespace

bool isNurbs(const Node& geometry) {
    return geometry.is(x3d::NurbsCurve::type) || geometry.is(x3d::NurbsPatchSurface::type) ||
           geometry.is(x3d::NurbsTrimmedSurface::type) || geometry.is(x3d::NurbsSweptSurface::type) ||
           geometry.is(x3d::NurbsSwungSurface::type);
}

Mesh tessellateNurbs(const Scene& scene, const Node& geometry, const TessellationOptions& options) {
    return NurbsReader(scene, geometry, options).run();
}

}  // namespace rtsg::detail
