// The field about a rigid body in the open, by boundary elements: no edges, and no theory of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg::test {

/// Kirchhoff's and Helmholtz's integral equation with one pressure on each element; at places within, where there is no
/// sound, it is asked for too, so that resonances of the inside do no harm (Schenck, JASA 44 (1968), 41-58). With ten
/// elements along each side, smaller towards the edges, it is within .1 dB of sixteen where a side is two waves long.
class RigidBody {
  public:
    using Complex = std::complex<double>;

    /// Tones that were asked for before, whatever the source, are soon there.
    void light(const glm::dvec3& source, double waveNumber) {
        source_ = source;
        k_ = waveNumber;
        const auto [tone, isNew] = tones_.try_emplace(waveNumber);
        if (isNew) tone->second.eliminate(equations());
        std::vector<Complex> sent;
        for (const Element& one : elements_) sent.push_back(open(one.middle));
        for (const glm::dvec3& position : within_) sent.push_back(open(position));
        pressure_ = tone->second.solved(std::move(sent));
    }
    /// Re the source in the open at 1 m.
    Complex pressure(const glm::dvec3& position) const {
        Complex sum = open(position);
        for (std::size_t j = 0; j < elements_.size(); ++j) sum += pressure_[j] * integral(position, elements_[j], 0);
        return sum;
    }
    /// Re that of the source in the open, dB.
    double level(const glm::dvec3& position) const {
        return 20 * std::log10(std::abs(pressure(position)) * glm::distance(position, source_));
    }
    /// Another body, elsewhere.
    void add(const RigidBody& other) {
        elements_.insert(elements_.end(), other.elements_.begin(), other.elements_.end());
        within_.insert(within_.end(), other.within_.begin(), other.within_.end());
        tones_.clear();
    }

  protected:
    struct Element {
        glm::dvec3 middle, u, v;  // a rectangle's sides
    };

    std::vector<Element> elements_;
    std::vector<glm::dvec3> within_;

  private:
    using Rows = std::vector<std::vector<Complex>>;

    /// Gauss's elimination, which any number of right sides share.
    struct Eliminated {
        Rows rows;  // below the diagonal what was taken of the row above
        std::vector<std::size_t> swaps;

        void eliminate(Rows from) {
            rows = std::move(from);
            const std::size_t n = rows.size();
            for (std::size_t c = 0; c < n; ++c) {
                std::size_t best = c;
                for (std::size_t i = c + 1; i < n; ++i)
                    if (std::norm(rows[i][c]) > std::norm(rows[best][c])) best = i;
                std::swap(rows[c], rows[best]);
                swaps.push_back(best);
                const Complex inverse = 1.0 / rows[c][c];
                for (std::size_t i = c + 1; i < n; ++i) {
                    const Complex f = rows[i][c] *= inverse;
                    for (std::size_t j = c + 1; j < n; ++j) rows[i][j] -= times(f, rows[c][j]);
                }
            }
        }
        std::vector<Complex> solved(std::vector<Complex> right) const {
            const std::size_t n = rows.size();
            for (std::size_t c = 0; c < n; ++c) std::swap(right[c], right[swaps[c]]);
            for (std::size_t c = 0; c < n; ++c)
                for (std::size_t i = c + 1; i < n; ++i) right[i] -= times(rows[i][c], right[c]);
            for (std::size_t i = n; i-- > 0;) {
                for (std::size_t j = i + 1; j < n; ++j) right[i] -= rows[i][j] * right[j];
                right[i] /= rows[i][i];
            }
            return right;
        }
        static Complex times(const Complex& a, const Complex& b) {
            return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
        }
    };

    Rows equations() const {
        const std::size_t n = elements_.size(), all = n + within_.size();
        Rows rows(all, std::vector<Complex>(all));
        for (std::size_t i = 0; i < all; ++i) {
            const glm::dvec3& position = i < n ? elements_[i].middle : within_[i - n];
            for (std::size_t j = 0; j < n; ++j) rows[i][j] = i == j ? 0.5 : -integral(position, elements_[j], 0);
        }
        // Least errors on the surface, none within.
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t q = n; q < all; ++q) rows[i][q] = std::conj(rows[q][i]);
        return rows;
    }
    Complex open(const glm::dvec3& position) const {
        const double distance = glm::distance(position, source_);
        return std::polar(1 / distance, -k_ * distance);
    }
    /// Integral of the slope of exp(-i k r) / (4 pi r) along the normal, by Gauss's rule, in four parts if the point is
    /// near.
    Complex integral(const glm::dvec3& position, const Element& e, int depth) const {
        const glm::dvec3 normal = glm::cross(e.u, e.v), off = e.middle - position;
        const double size = std::max(glm::length(e.u), glm::length(e.v));
        if (std::abs(glm::dot(off, normal)) < 1e-12 * glm::length(normal)) return 0;
        Complex sum;
        if (glm::length(off) < 1.5 * size && depth < 6) {
            for (const double a : {-.25, .25})
                for (const double b : {-.25, .25})
                    sum += integral(position, {e.middle + a * e.u + b * e.v, .5 * e.u, .5 * e.v}, depth + 1);
            return sum;
        }
        const double gauss = .5 / std::sqrt(3.0);
        for (const double a : {-gauss, gauss})
            for (const double b : {-gauss, gauss}) {
                const glm::dvec3 displacement = off + a * e.u + b * e.v;
                const double r = glm::length(displacement);
                sum += std::polar(.25 / (4 * M_PI * r), -k_ * r) * Complex(-1 / r, -k_) *
                       (glm::dot(displacement, normal) / r);
            }
        return sum;
    }
    std::map<double, Eliminated> tones_;  // by wave numbers
    std::vector<Complex> pressure_;
    glm::dvec3 source_{0};
    double k_ = 0;
};

class RigidBox : public RigidBody {
  public:
    RigidBox(const glm::dvec3& low, const glm::dvec3& high, int along) {
        const glm::dvec3 size = high - low, x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z);
        addFace(low, z, y, along);
        addFace(low + x, y, z, along);
        addFace(low, x, z, along);
        addFace(low + y, z, x, along);
        addFace(low, y, x, along);
        addFace(low + z, x, y, along);
        for (const glm::dvec3& part : {glm::dvec3(.37, .41, .59), glm::dvec3(.61, .33, .27), glm::dvec3(.23, .71, .37),
                                       glm::dvec3(.53, .57, .79), glm::dvec3(.77, .67, .47)})
            within_.push_back(low + size * part);
    }

  private:
    void addFace(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v, int along) {
        const auto at = [&](int i) {
            const double t = double(i) / along;
            return .35 * t + .65 * (.5 - .5 * std::cos(M_PI * t));
        };
        for (int i = 0; i < along; ++i)
            for (int j = 0; j < along; ++j)
                elements_.push_back({corner + u * (.5 * (at(i) + at(i + 1))) + v * (.5 * (at(j) + at(j + 1))),
                                     u * (at(i + 1) - at(i)), v * (at(j + 1) - at(j))});
    }
};

/// An even prism whose corners are 1 m from the z axis, from -height / 2 to height / 2.
class RigidPrism : public RigidBody {
  public:
    /// `sides` times `along` elements round it, so many rings of them on its ends and `layers` on its sides.
    RigidPrism(int sides, double height, int along, int rings, int layers) {
        const auto corner = [&](int i) {
            return glm::dvec3(std::cos(2 * M_PI * i / sides), std::sin(2 * M_PI * i / sides), 0);
        };
        const auto ring = [&](int i) { return .7 * std::sin(.5 * M_PI * i / rings) + .3 * i / rings; };
        const glm::dvec3 up(0, 0, height);
        for (int i = 0; i < sides; ++i)
            for (int j = 0; j < along; ++j) {
                const glm::dvec3 a = glm::mix(corner(i), corner(i + 1), double(j) / along);
                const glm::dvec3 b = glm::mix(corner(i), corner(i + 1), double(j + 1) / along);
                for (int r = 0; r < rings; ++r) {
                    const glm::dvec3 middle = .25 * (a + b) * (ring(r) + ring(r + 1));
                    const glm::dvec3 out = .5 * (a + b) * (ring(r + 1) - ring(r));
                    const glm::dvec3 round = .5 * (b - a) * (ring(r) + ring(r + 1));
                    elements_.push_back({middle + .5 * up, out, round});
                    elements_.push_back({middle - .5 * up, round, out});
                }
                for (int l = 0; l < layers; ++l)
                    elements_.push_back({.5 * (a + b) + up * ((l + .5) / layers - .5), b - a, up / double(layers)});
            }
        within_ = {{.1, .2, .1 * height}, {-.3, .15, -.2 * height}, {.35, -.4, .15 * height}, {-.5, -.2, .05 * height}};
    }
};

/// A frustum, or a cone, about the z axis, all x times `wide`: elements lie along planes from ring to ring.
class RigidFrustum : public RigidBody {
  public:
    RigidFrustum(double lowRadius, double highRadius, double low, double high, double wide = 1) {
        constexpr int kRound = 24, kRings = 4, kLayers = 9;
        const auto corner = [&](int i) {
            return glm::dvec3(wide * std::cos(2 * M_PI * i / kRound), std::sin(2 * M_PI * i / kRound), 0);
        };
        const auto ring = [&](int i) { return .7 * std::sin(.5 * M_PI * i / kRings) + .3 * i / kRings; };
        const bool apex = !(highRadius > 0);
        const auto layer = [&](int i) {
            const double t = double(i) / kLayers;
            return .4 * t + .6 * (apex ? 1 - std::cos(.5 * M_PI * t) : .5 - .5 * std::cos(M_PI * t));
        };
        const auto radius = [&](double t) { return lowRadius + (highRadius - lowRadius) * t; };
        for (int i = 0; i < kRound; ++i) {
            const glm::dvec3 middle = .5 * (corner(i) + corner(i + 1)), round = corner(i + 1) - corner(i);
            for (int r = 0; r < kRings; ++r) {
                const double at = .5 * (ring(r) + ring(r + 1)), across = ring(r + 1) - ring(r);
                elements_.push_back({lowRadius * at * middle + glm::dvec3(0, 0, low), lowRadius * at * round,
                                     lowRadius * across * middle});
                if (!apex)
                    elements_.push_back({highRadius * at * middle + glm::dvec3(0, 0, high),
                                         highRadius * across * middle, highRadius * at * round});
            }
            for (int l = 0; l < kLayers; ++l) {
                const double from = layer(l), to = layer(l + 1);
                const glm::dvec3 below = radius(from) * middle + glm::dvec3(0, 0, low + (high - low) * from);
                const glm::dvec3 above = radius(to) * middle + glm::dvec3(0, 0, low + (high - low) * to);
                elements_.push_back({.5 * (below + above), .5 * (radius(from) + radius(to)) * round, above - below});
            }
        }
        for (const glm::dvec3& part : {glm::dvec3(.08, .16, .2), glm::dvec3(-.24, .12, .3), glm::dvec3(.16, -.24, .1),
                                       glm::dvec3(-.12, -.08, .5), glm::dvec3(.04, -.03, .62)})
            within_.push_back(lowRadius * glm::dvec3(wide * part.x, part.y, 0) +
                              glm::dvec3(0, 0, low + (high - low) * part.z));
    }
};

}  // namespace rtsg::test
