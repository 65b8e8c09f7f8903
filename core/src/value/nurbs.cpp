// Basis functions by the Cox-de Boor recurrence, and the curves and surfaces that they blend.
#include <rtsg/core/nurbs.h>

#include <algorithm>
#include <cmath>

namespace rtsg {

namespace {

bool areUsable(std::span<const double> knots, int order, std::size_t count) {
    if (knots.size() != count + static_cast<std::size_t>(order)) return false;
    int same = 1;
    for (std::size_t i = 0; i < knots.size(); ++i) {
        if (!std::isfinite(knots[i]) || std::abs(knots[i]) > 1e100) return false;
        if (i == 0) continue;
        if (knots[i] < knots[i - 1]) return false;
        same = knots[i] == knots[i - 1] ? same + 1 : 1;
        if (same > order) return false;
    }
    return knots[static_cast<std::size_t>(order) - 1] < knots[count];
}

}  // namespace

NurbsBasis::NurbsBasis(int order, std::size_t count, std::span<const double> knots, bool* replaced, EvenEnds ends)
    : order_(order), count_(count), knots_(knots.begin(), knots.end()) {
    const bool good = areUsable(knots, order, count);
    if (replaced) *replaced = !good;
    if (good) return;
    knots_.clear();
    const auto inner = static_cast<std::ptrdiff_t>(count) - order + 1;  // pieces
    for (std::ptrdiff_t i = 1 - order; i <= inner + order - 1; ++i) {
        const std::ptrdiff_t at = ends == EvenEnds::clamped ? std::clamp<std::ptrdiff_t>(i, 0, inner) : i;
        knots_.push_back(static_cast<double>(at) / static_cast<double>(inner));
    }
}

std::vector<double> NurbsBasis::breaks() const {
    std::vector<double> result;
    for (std::size_t i = static_cast<std::size_t>(order_) - 1; i <= count_; ++i)
        if (result.empty() || knots_[i] > result.back()) result.push_back(knots_[i]);
    return result;
}

NurbsBasis::At NurbsBasis::at(double u) const {
    const auto p = static_cast<std::size_t>(order_) - 1;
    u = std::isfinite(u) ? std::clamp(u, first(), last()) : first();
    // The last knot that is not above u, but one that a piece follows.
    const auto begin = knots_.begin() + static_cast<std::ptrdiff_t>(p),
               end = knots_.begin() + static_cast<std::ptrdiff_t>(count_);
    auto found = std::upper_bound(begin, end, u);
    if (found == end && u >= *end) found = std::lower_bound(begin, end, *end);
    const auto span = static_cast<std::size_t>(found - knots_.begin()) - 1;

    At result;
    result.start = span - p;
    std::array<double, kMaxOrder> left{}, right{}, lower{};
    auto& n = result.value;
    n[0] = 1;
    for (std::size_t k = 1; k <= p; ++k) {
        if (k == p) lower = n;  // of one degree less
        left[k] = u - knots_[span + 1 - k];
        right[k] = knots_[span + k] - u;
        double saved = 0;
        for (std::size_t r = 0; r < k; ++r) {
            const double fraction = n[r] / (right[r + 1] + left[k - r]);
            n[r] = saved + right[r + 1] * fraction;
            saved = left[k - r] * fraction;
        }
        n[k] = saved;
    }
    for (std::size_t j = 0; j <= p; ++j) {
        const std::size_t i = result.start + j;
        const double before = j > 0 ? lower[j - 1] / (knots_[i + p] - knots_[i]) : 0;
        const double after = j < p ? lower[j] / (knots_[i + p + 1] - knots_[i + 1]) : 0;
        result.slope[j] = static_cast<double>(p) * (before - after);
    }
    return result;
}

NurbsPoints nurbsPoints(std::span<const Vec3d> points, std::span<const double> weights) {
    NurbsPoints result;
    result.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double w = i < weights.size() && weights[i] > 0 && std::isfinite(weights[i]) ? weights[i] : 1;
        result.emplace_back(points[i], w);
    }
    return result;
}

Vec3d NurbsCurve::at(double u, Vec3d* slope) const {
    const NurbsBasis::At b = basis.at(u);
    Vec4d sum(0), change(0);
    for (std::size_t i = 0; i < static_cast<std::size_t>(basis.order()); ++i) {
        sum += b.value[i] * points[b.start + i];
        change += b.slope[i] * points[b.start + i];
    }
    const Vec3d at = Vec3d(sum) / sum.w;
    if (slope) *slope = (Vec3d(change) - change.w * at) / sum.w;
    return at;
}

Vec3d NurbsSurface::at(double s, double t, Vec3d* alongU, Vec3d* alongV) const {
    const NurbsBasis::At a = u.at(s), b = v.at(t);
    Vec4d sum(0), changeU(0), changeV(0);
    for (std::size_t j = 0; j < static_cast<std::size_t>(v.order()); ++j) {
        Vec4d row(0), rowChange(0);
        const Vec4d* p = points.data() + (b.start + j) * u.count() + a.start;
        for (std::size_t i = 0; i < static_cast<std::size_t>(u.order()); ++i) {
            row += a.value[i] * p[i];
            rowChange += a.slope[i] * p[i];
        }
        sum += b.value[j] * row;
        changeU += b.value[j] * rowChange;
        changeV += b.slope[j] * row;
    }
    const Vec3d at = Vec3d(sum) / sum.w;
    if (alongU) *alongU = (Vec3d(changeU) - changeU.w * at) / sum.w;
    if (alongV) *alongV = (Vec3d(changeV) - changeV.w * at) / sum.w;
    return at;
}

Vec3d NurbsSurface::normal(double s, double t) const {
    const double sizeU = u.last() - u.first(), sizeV = v.last() - v.first();
    const double middleS = u.first() + sizeU / 2, middleT = v.first() + sizeV / 2;
    // At a pole one direction vanishes; a little towards the middle it does not.
    for (const double step : {0.0, 1e-6, 1e-4}) {
        const double a = s + (middleS - s) * step, b = t + (middleT - t) * step;
        Vec3d du, dv;
        (void)at(a, b, &du, &dv);
        du *= sizeU, dv *= sizeV;
        const Vec3d n = glm::cross(du, dv);
        const double length = glm::length(n), scale = glm::dot(du, du) + glm::dot(dv, dv);
        if (length > 1e-9 * scale && std::isfinite(length)) return n / length;
    }
    // Both may vanish; then only far steps tell.
    Vec3d du, dv;
    (void)at(s + (middleS - s) * .01, t + (middleT - t) * .01, &du, &dv);
    const Vec3d n = glm::cross(du * sizeU, dv * sizeV);
    const double length = glm::length(n);
    return length > 0 && std::isfinite(length) ? n / length : Vec3d(0);
}

}  // namespace rtsg
