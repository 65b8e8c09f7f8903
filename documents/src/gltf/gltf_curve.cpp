// Reads the keys of a sampler, steps as two keys at one time, and splines as lines.
#include "gltf_curve.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace rtsg::detail {

using nlohmann::json;

namespace {

/// Splines as the file has them: each key has a tangent with which it is reached, its value, and a tangent with which
/// it is left; tangents are changes a second.
class Splines {
  public:
    Splines(const std::vector<float>& numbers, const std::vector<float>& times, std::size_t size)
        : numbers_(numbers), times_(times), size_(size) {}

    GltfCurve lines(double tolerance) const {
        GltfCurve result{size_, {}, {}};
        const std::size_t spans = times_.size() - 1;
        const double allowed = tolerance * extent();
        for (std::size_t k = 0; k < spans; ++k) {
            const std::size_t pieces = allowed > 0 ? piecesOf(k, allowed, spans) : 1;
            for (std::size_t i = 0; i < pieces; ++i)
                add(result, k, static_cast<double>(i) / static_cast<double>(pieces));
        }
        result.times.push_back(double{times_.back()});
        for (std::size_t c = 0; c < size_; ++c) result.numbers.push_back(value(spans, c));
        return result;
    }

  private:
    double number(std::size_t key, std::size_t part, std::size_t c) const {
        return double{numbers_[(3 * key + part) * size_ + c]};
    }
    double value(std::size_t key, std::size_t c) const { return number(key, 1, c); }
    double duration(std::size_t k) const { return double{times_[k + 1]} - double{times_[k]}; }
    /// The changes that the tangents at either end of a span would make in all of it.
    double leaving(std::size_t k, std::size_t c) const { return duration(k) * number(k, 2, c); }
    double arriving(std::size_t k, std::size_t c) const { return duration(k) * number(k + 1, 0, c); }

    void add(GltfCurve& to, std::size_t k, double t) const {
        const double t2 = t * t, t3 = t2 * t;
        to.times.push_back(double{times_[k]} + t * duration(k));
        for (std::size_t c = 0; c < size_; ++c)
            to.numbers.push_back((2 * t3 - 3 * t2 + 1) * value(k, c) + (t3 - 2 * t2 + t) * leaving(k, c) +
                                 (3 * t2 - 2 * t3) * value(k + 1, c) + (t3 - t2) * arriving(k, c));
    }
    /// The largest difference of one component within all splines, by their Bezier points, between which they are.
    double extent() const {
        double maximum = 0;
        for (std::size_t c = 0; c < size_; ++c) {
            double low = value(0, c), high = low;
            const auto take = [&](double one) {
                low = std::min(low, one);
                high = std::max(high, one);
            };
            for (std::size_t k = 0; k + 1 < times_.size(); ++k) {
                take(value(k, c) + leaving(k, c) / 3);
                take(value(k + 1, c) - arriving(k, c) / 3);
                take(value(k + 1, c));
            }
            maximum = std::max(maximum, high - low);
        }
        return maximum;
    }
    /// A power of two, so that the values half way are exact. A chord of a curve is at most an eighth of the largest
    /// second derivative away from it, times the square of its length; that derivative is largest at an end.
    std::size_t piecesOf(std::size_t k, double allowed, std::size_t spans) const {
        double bend = 0;
        for (std::size_t c = 0; c < size_; ++c) {
            const double whole = 6 * (value(k + 1, c) - value(k, c));
            bend = std::max({bend, std::abs(whole - 4 * leaving(k, c) - 2 * arriving(k, c)),
                             std::abs(-whole + 2 * leaving(k, c) + 4 * arriving(k, c))});
        }
        constexpr double maximum = 128;
        constexpr std::size_t maxInAll = std::size_t{1} << 22;  // numbers, whatever the file says
        const double wanted = std::clamp(std::ceil(std::sqrt(bend / (8 * allowed))), 1.0, maximum);
        return std::min(std::bit_ceil(static_cast<std::size_t>(wanted)),
                        std::bit_floor(std::max<std::size_t>(maxInAll / (spans * size_), 1)));
    }

    const std::vector<float>&numbers_, &times_;
    std::size_t size_;
};

}  // namespace

std::optional<GltfCurve> readCurve(GltfFile& file, const json& sampler, const std::vector<float>& times,
                                   std::size_t size, double tolerance) {
    const std::string how = GltfFile::text(sampler, "interpolation");
    const bool cubic = how == "CUBICSPLINE", step = how == "STEP";
    std::size_t components = 0;
    const std::vector<float> numbers = file.floats(GltfFile::index(sampler, "output").value_or(kNoIndex), components);
    const std::size_t groups = times.size() * (cubic ? 3 : 1);
    const bool any = size == 0 && components == 1 && groups != 0 && numbers.size() % groups == 0;
    if (any) size = numbers.size() / groups;
    if (size == 0 || (!any && components != size) || numbers.size() != groups * size || times.empty()) {
        if (!numbers.empty())
            file.fault("an animation of the glTF file has another number of values than keys; it is left out");
        return std::nullopt;
    }
    if (cubic) return Splines(numbers, times, size).lines(tolerance);
    GltfCurve result{size, {}, {}};
    const auto add = [&](double time, std::size_t key) {
        result.times.push_back(time);
        for (std::size_t c = 0; c < size; ++c) result.numbers.push_back(double{numbers[key * size + c]});
    };
    for (std::size_t i = 0; i < times.size(); ++i) {
        if (step && i > 0) add(double{times[i]}, i - 1);
        add(double{times[i]}, i);
    }
    return result;
}

}  // namespace rtsg::detail
