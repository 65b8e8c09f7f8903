// The field of a line source beside rigid bodies that go on for ever along z, by boundary elements in double precision:
// outlines of straight panels, pressure constant on each, and equations within the bodies, where there is nothing, so
// that no tone of a closed room spoils it (Schenck, JASA 44 (1968), 41-58).
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

namespace rtsg::test {

class RigidOutline {
  public:
    using Value = std::complex<double>;
    using Closed = std::vector<glm::dvec2>;  // against the clock; the air is outside

    /// `inside`: places within the bodies.
    RigidOutline(const std::vector<Closed>& outlines, const std::vector<glm::dvec2>& inside, double waveNumber,
                 double longest)
        : k_(waveNumber) {
        for (const Closed& one : outlines)
            for (std::size_t i = 0; i < one.size(); ++i) {
                const glm::dvec2 from = one[i], displacement = one[(i + 1) % one.size()] - from;
                const int parts = static_cast<int>(std::ceil(glm::length(displacement) / longest));
                const glm::dvec2 normal = glm::dvec2(displacement.y, -displacement.x) / glm::length(displacement);
                for (int p = 0; p < parts; ++p)
                    panels_.push_back(
                        {from + displacement * (double(p) / parts), displacement / double(parts), normal});
            }
        const std::size_t n = panels_.size();
        std::vector<std::vector<Value>> rows;
        for (const Panel& panel : panels_) {
            positions_.push_back(panel.from + 0.5 * panel.displacement);
            rows.push_back(rowOf(positions_.back(), &panel));
            rows.back()[positions_.size() - 1] += 0.5;
        }
        for (const glm::dvec2& point : inside) {
            positions_.push_back(point);
            rows.push_back(rowOf(point, nullptr));
        }
        // Least squares, by Cholesky.
        rows_ = rows;
        factor_.assign(n * n, 0);
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t j = 0; j <= i; ++j) {
                Value sum = 0;
                for (const std::vector<Value>& row : rows) sum += std::conj(row[i]) * row[j];
                factor_[i * n + j] = sum;
            }
        for (std::size_t j = 0; j < n; ++j)
            for (std::size_t i = j; i < n; ++i) {
                Value sum = factor_[i * n + j];
                for (std::size_t m = 0; m < j; ++m) sum -= factor_[i * n + m] * std::conj(factor_[j * n + m]);
                factor_[i * n + j] = i == j ? Value(std::sqrt(sum.real())) : sum / factor_[j * n + j].real();
            }
    }

    /// Re the line source in the open at the listener.
    Value beside(const glm::dvec2& source, const glm::dvec2& listener) const {
        const std::size_t n = panels_.size();
        std::vector<Value> p(n);
        for (std::size_t r = 0; r < positions_.size(); ++r) {
            const Value sent = straight(glm::distance(positions_[r], source));
            for (std::size_t i = 0; i < n; ++i) p[i] += std::conj(rows_[r][i]) * sent;
        }
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t m = 0; m < i; ++m) p[i] -= factor_[i * n + m] * p[m];
            p[i] /= factor_[i * n + i].real();
        }
        for (std::size_t i = n; i-- > 0;) {
            for (std::size_t m = i + 1; m < n; ++m) p[i] -= std::conj(factor_[m * n + i]) * p[m];
            p[i] /= factor_[i * n + i].real();
        }
        const Value open = straight(glm::distance(source, listener));
        Value sum = open;
        const std::vector<Value> row = rowOf(listener, nullptr);
        for (std::size_t i = 0; i < n; ++i) sum -= row[i] * p[i];
        return sum / open;
    }

  private:
    struct Panel {
        glm::dvec2 from, displacement, normal;
    };
    Value straight(double distance) const {
        return Value(0, -0.25) * Value(std::cyl_bessel_j(0, k_ * distance), -std::cyl_neumann(0, k_ * distance));
    }
    /// Less the integral of what each panel sends to a place; of its own panel nothing.
    std::vector<Value> rowOf(const glm::dvec2& point, const Panel* own) const {
        static constexpr double kPositions[] = {-.8611363115940526, -.3399810435848563, .3399810435848563,
                                                .8611363115940526};
        static constexpr double kWeights[] = {.3478548451374538, .6521451548625461, .6521451548625461,
                                              .3478548451374538};
        std::vector<Value> row;
        for (const Panel& panel : panels_) {
            Value sum = 0;
            const double size = glm::length(panel.displacement);
            const bool far = glm::distance(point, panel.from + 0.5 * panel.displacement) > 3 * size;
            if (&panel != own)
                for (std::size_t g = 0; g < (far ? 1u : 4u); ++g) {
                    const glm::dvec2 to = panel.from + panel.displacement * (far ? .5 : .5 * (1 + kPositions[g]));
                    const glm::dvec2 displacement = to - point;
                    const double r = glm::length(displacement);
                    const Value h(std::cyl_bessel_j(1, k_ * r), -std::cyl_neumann(1, k_ * r));
                    sum += (far ? 1 : .5 * kWeights[g]) * size * Value(0, .25) * k_ * h *
                           glm::dot(displacement, panel.normal) / r;
                }
            row.push_back(-sum);
        }
        return row;
    }

    double k_;
    std::vector<Panel> panels_;
    std::vector<glm::dvec2> positions_;
    std::vector<std::vector<Value>> rows_;
    std::vector<Value> factor_;
};

}  // namespace rtsg::test
