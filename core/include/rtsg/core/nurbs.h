// NURBS: points and derivatives of non-uniform rational B-splines, for geometry and for interpolators.
//
// Invariant: a knot vector that does not fit (not as many as control points plus order, decreasing, or with more than
// order - 1 equal ones inside) is replaced by a uniform one, as the standard wants; evaluation then never fails. The
// clause does not say whether an open curve with "a default uniform knot vector" reaches its first and last control
// point: here it does, as in X_ITE. Weights that are missing, or not above 0, count as 1. Threading: plain data, const
// members are re-entrant. Source: ISO/IEC 19775-1 V4.0 27.2; Piegl and Tiller, The NURBS Book (1997), algorithms A2.2,
// A3.1 and A4.3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg {

/// The basis functions of the control points, along one parameter.
class NurbsBasis {
  public:
    static constexpr int kMaxOrder = 16;

    NurbsBasis() = default;
    /// The ends of uniform knots. `clamped`: the curve ends at the outer control points (`order` equal knots at each
    /// end). `periodic`: the knots go on evenly, for points whose first order - 1 are repeated at the end.
    enum class EvenEnds : std::uint8_t { clamped, periodic };
    /// Precondition: fits(order, count). `replaced` is set if the knots do not fit.
    NurbsBasis(int order, std::size_t count, std::span<const double> knots, bool* replaced = nullptr,
               EvenEnds ends = EvenEnds::clamped);
    static bool fits(int order, std::size_t count) {
        return order >= 2 && order <= kMaxOrder && count >= static_cast<std::size_t>(order);
    }

    int order() const { return order_; }
    std::size_t count() const { return count_; }
    /// The ends of the domain.
    double first() const { return knots_[static_cast<std::size_t>(order_) - 1]; }
    double last() const { return knots_[count_]; }
    /// The parameters at which pieces begin and end, from first() to last(), each once.
    std::vector<double> breaks() const;

    /// The weights of the `order` control points from `start` on at `u`, which is clamped to the domain, and the
    /// derivatives of these weights.
    struct At {
        std::size_t start = 0;
        std::array<double, kMaxOrder> value{}, slope{};
    };
    At at(double u) const;

  private:
    int order_ = 2;
    std::size_t count_ = 0;
    std::vector<double> knots_;
};

/// Homogeneous control points: the point in space is (x, y, z) / w.
using NurbsPoints = std::vector<Vec4d>;
/// Makes control points of nodes' fields, whose points are the (x, y, z) of homogeneous ones. The clause leaves open
/// whether they are homogeneous or points in space; browsers and existing files take them as homogeneous: a corner of a
/// round square of side 2 is (.7071, .7071) with a weight of .7071.
NurbsPoints nurbsPoints(std::span<const Vec3d> points, std::span<const double> weights);

struct NurbsCurve {
    NurbsBasis basis;
    NurbsPoints points;
    Vec3d at(double u, Vec3d* slope = nullptr) const;
};

/// Control point (i, j) is number i + j * u.count().
struct NurbsSurface {
    NurbsBasis u, v;
    NurbsPoints points;
    Vec3d at(double s, double t, Vec3d* alongU = nullptr, Vec3d* alongV = nullptr) const;
    /// A unit vector along the cross product of both slopes; where that is 0, the normal of places nearby; else 0.
    Vec3d normal(double s, double t) const;
};

}  // namespace rtsg
