// Followers: chasers and dampers (ISO/IEC 19775-1 V4.0, clause 39). One template each for all types.
//
// Both answer in closed form for any time, so nothing depends on the frame rate, and their state changes with their
// inputs alone. Where the clause is open: a chaser answers a step with half a cosine, as others do; a damper is a chain
// of first-order filters, solved exactly; orientations are filtered as rotation vectors from the destination, which is
// exact about one axis; colours component by component.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "trigonometry.h"

namespace rtsg::behaviours {

namespace {

// ---- values: differences that can be scaled and added ----------------------------------------------------------

template <class E>
struct Motion;

template <class E, class W>
struct LinearMotion {
    using Wide = W;
    using Delta = W;
    static Wide widen(const E& value) { return Wide(value); }
    static E narrow(const Wide& value) { return E(value); }
    static Delta from(const Wide& a, const Wide& b) { return b - a; }
    static Wide moved(const Wide& a, const Delta& d) { return a + d; }
    static double size(const Delta& d) {
        if constexpr (std::is_same_v<W, double>)
            return std::abs(d);
        else
            return glm::length(d);
    }
};
template <>
struct Motion<float> : LinearMotion<float, double> {};
template <>
struct Motion<Vec2f> : LinearMotion<Vec2f, glm::dvec2> {};
template <>
struct Motion<Vec3f> : LinearMotion<Vec3f, glm::dvec3> {};
template <>
struct Motion<Color> : LinearMotion<Color, glm::dvec3> {
    static Wide widen(const Color& c) { return {c.r, c.g, c.b}; }
    static Color narrow(const Wide& c) {
        return {static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
    }
};
/// A difference is a rotation vector, about axes that turn with the first of the two.
template <>
struct Motion<Rotation> {
    using Wide = glm::dquat;
    using Delta = glm::dvec3;
    /// The quaternion that turns by `angle` about an axis of this length.
    static Wide turned(const glm::dvec3& axis, double length, double angle) {
        if (!(length > 0)) return {1, 0, 0, 0};
        const SineCosine half = sineCosine(angle / 2);
        const glm::dvec3 v = axis * (half.sine / length);
        return {half.cosine, v.x, v.y, v.z};
    }
    static Wide widen(const Rotation& r) {
        const glm::dvec3 axis(r.x, r.y, r.z);
        const double square = glm::dot(axis, axis);
        return turned(axis, square == 1 ? 1 : std::sqrt(square), r.angle);
    }
    /// The rotation of a quaternion of any length, so that quaternions need not be normalised.
    static Rotation narrow(Wide q) {
        if (q.w < 0) q = -q;
        const double s = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
        if (!(s > 0)) return {0, 0, 1, 0};
        return {static_cast<float>(q.x / s), static_cast<float>(q.y / s), static_cast<float>(q.z / s),
                static_cast<float>(2 * quadrantAngle(s, q.w))};
    }
    static Delta from(const Wide& a, const Wide& b) {
        Wide q = glm::conjugate(a) * b;
        if (q.w < 0) q = -q;  // the shorter way
        const glm::dvec3 v(q.x, q.y, q.z);
        const double s = glm::length(v);
        return s > 0 ? v * (2 * quadrantAngle(s, q.w) / s) : glm::dvec3(0);
    }
    static Wide moved(const Wide& a, const Delta& d) {
        const double angle = glm::length(d);
        return a * turned(d, angle, angle);
    }
    static double size(const Delta& d) { return glm::length(d); }
};

/// A field's value as a list of elements, of which types that are no arrays have one.
template <class T>
struct Elements {
    using Element = T;
    static std::size_t count(const T&) { return 1; }
    static T at(const T& value, std::size_t) { return value; }
    static T make(std::span<const T> elements) { return elements[0]; }
};
template <class E>
struct Elements<Array<E>> {
    using Element = E;
    static std::size_t count(const Array<E>& value) { return value.size(); }
    static const E& at(const Array<E>& value, std::size_t i) { return value[i]; }
    static Array<E> make(std::span<const E> elements) {
        auto created = Array<E>::ofSize(elements.size());
        std::ranges::copy(elements, created.mutableData());
        return created;
    }
};

template <class N>
using ValueOf = std::remove_cvref_t<decltype(std::declval<const Node&>().get(N::value_changed))>;
template <class N>
using ElementOf = typename Elements<ValueOf<N>>::Element;

/// `count` elements of a list, from element `first` on; missing ones are `otherwise`'s.
template <class E>
std::vector<E> part(const Array<E>& list, std::size_t first, std::size_t count, std::span<const E> otherwise) {
    std::vector<E> out(otherwise.begin(), otherwise.end());
    out.resize(count);
    for (std::size_t i = 0; i < count && first + i < list.size(); ++i) out[i] = list[first + i];
    return out;
}
template <class T>
std::vector<typename Elements<T>::Element> elements(const T& value) {
    std::vector<typename Elements<T>::Element> out(Elements<T>::count(value));
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = Elements<T>::at(value, i);
    return out;
}
/// 39.3.3: set_value sets the output at once, and its length too: elements that the destination lacks appear at once,
/// and those that it has in excess are dropped.
template <class E>
std::vector<E> asLongAs(const std::vector<E>& value, std::vector<E> destination) {
    const std::size_t had = std::min(destination.size(), value.size());
    destination.resize(had);
    destination.insert(destination.end(), value.begin() + static_cast<std::ptrdiff_t>(had), value.end());
    return destination;
}
template <class E>
Array<E> listOf(const std::vector<E>& elements) {
    return Elements<Array<E>>::make(elements);
}

/// A list of a length that stays, without memory of its own while it is short: most followers hold one element.
template <class E>
class Few {
  public:
    explicit Few(std::size_t size) : size_(size) {
        if (size > kShort)
            long_.resize(size);
        else
            std::fill_n(short_.begin(), size, E{});
    }
    std::size_t size() const { return size_; }
    E* data() { return size_ > kShort ? long_.data() : short_.data(); }
    E& operator[](std::size_t i) { return data()[i]; }
    std::span<const E> span() { return {data(), size_}; }

  private:
    static constexpr std::size_t kShort = 5;
    std::size_t size_;
    std::array<E, kShort> short_;
    std::vector<E> long_;
};

template <class N>
void setActive(Cascade& cascade, const Node& node, bool active) {
    if (node.get(N::isActive) != active) cascade.emit(node, N::isActive, active);
}
template <class N>
void sendValue(Cascade& cascade, const Node& node, std::span<const ElementOf<N>> value) {
    using T = ValueOf<N>;
    const T& known = node.get(N::value_changed);
    if (Elements<T>::count(known) == value.size()) {
        std::size_t same = 0;
        while (same < value.size() && Elements<T>::at(known, same) == value[same]) ++same;
        if (same == value.size()) return;
    }
    cascade.emit(node, N::value_changed, Elements<T>::make(value));
}

// ---- chasers ---------------------------------------------------------------------------------------------------

/// State: `_base`, the value before all steps, and the destinations on the way with the times at which they came.
template <class N>
struct Chaser {
    using T = ValueOf<N>;
    using E = ElementOf<N>;
    using M = Motion<E>;
    /// Steps that are closer together than the duration over this number are merged.
    static constexpr double kMaxSteps = 256;

    /// 39.3.1: a duration is finite and not negative; any other value counts as 0.
    static double duration(const Node& node) {
        const double d = node.get(N::duration).seconds;
        return d > 0 && std::isfinite(d) ? d : 0;
    }
    /// The response to a step: 0 when it happens, 1 after `duration`.
    static double response(double t, double duration) {
        if (t >= duration) return 1;
        return t <= 0 ? 0 : .5 - .5 * portable::cos(std::numbers::pi * t / duration);
    }
    static std::size_t count(const Node& node) { return node.get(N::_base).size(); }
    static std::vector<E> destination(const Node& node) {
        const auto& all = node.get(N::_destinations);
        const std::size_t each = count(node);
        return all.size() < each || all.empty() ? elements(node.get(N::_base))
                                                : part<E>(all, all.size() - each, each, {});
    }
    /// Whether the last destination is another than where all began.
    static bool leadsAway(const Node& node) {
        const auto& base = node.get(N::_base);
        const auto& all = node.get(N::_destinations);
        if (all.size() < base.size() || all.empty()) return false;
        return !std::equal(base.begin(), base.end(), all.end() - base.size());
    }
    static Few<E> value(const Node& node, double now) {
        const auto& base = node.get(N::_base);
        const auto& steps = node.get(N::_destinations);
        const auto& times = node.get(N::_times);
        const double whole = duration(node);
        Few<E> out(base.size());
        Few<double> weight(times.size());
        bool moves = false;
        for (std::size_t j = 0; j < times.size(); ++j) {
            weight[j] = response(now - times[j].seconds, whole);
            moves |= weight[j] != 0;
        }
        if (!moves) {  // it is where it was, as it was written
            std::ranges::copy(base, out.data());
            return out;
        }
        for (std::size_t i = 0; i < out.size(); ++i) {
            auto from = M::widen(base[i]), at = from;
            for (std::size_t j = 0; j < times.size(); ++j) {
                const auto to = M::widen(steps[j * out.size() + i]);
                at = M::moved(at, M::from(from, to) * weight[j]);
                from = to;
            }
            out[i] = M::narrow(at);
        }
        return out;
    }
    static void begin(Cascade& cascade, const Node& node) {
        if (node.get(N::_begun)) return;
        cascade.store(node, N::_begun, true);
        const auto start = elements(node.get(N::initialValue)), goal = elements(node.get(N::initialDestination));
        cascade.store(node, N::_base, listOf(start));
        cascade.store(node, N::value_changed, node.get(N::initialValue));
        if (start != goal) approach(cascade, node, goal);
    }
    static void approach(Cascade& cascade, const Node& node, const std::vector<E>& goal) {
        const double now = cascade.now(), whole = duration(node);
        std::vector<E> base = elements(node.get(N::_base));
        Array<E> steps = node.get(N::_destinations);
        Array<Time> times = node.get(N::_times);
        std::size_t each = base.size(), done = 0;
        while (done < times.size() && now - times[done].seconds >= whole) ++done;
        if (done > 0) base = part<E>(steps, (done - 1) * each, each, {});
        std::vector<E> kept;
        std::vector<Time> keptTimes;
        const auto resized = [&](std::vector<E> list) {
            // New elements are there at once; those left out are gone.
            const std::size_t had = list.size();
            list.resize(goal.size());
            for (std::size_t i = had; i < list.size(); ++i) list[i] = goal[i];
            return list;
        };
        for (std::size_t j = done; j < times.size(); ++j) {
            const bool replaced = j + 1 == times.size() && now - times[j].seconds <= whole / kMaxSteps;
            if (replaced && times[j].seconds == now) break;
            if (replaced && j > done && times[j].seconds - times[j - 1].seconds <= whole / kMaxSteps) break;
            const auto list = resized(part<E>(steps, j * each, each, {}));
            kept.insert(kept.end(), list.begin(), list.end());
            keptTimes.push_back(times[j]);
        }
        kept.insert(kept.end(), goal.begin(), goal.end());
        keptTimes.push_back(Time{now});
        cascade.store(node, N::_base, listOf(resized(std::move(base))));
        cascade.store(node, N::_destinations, listOf(kept));
        cascade.store(node, N::_times, listOf(keptTimes));
    }
    static void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
        const bool isValue = field == N::set_value.index;
        if (!isValue && field != N::set_destination.index) return;
        begin(cascade, node);
        const auto given = elements(event.as<T>());
        if (!isValue) return approach(cascade, node, given);
        // From here the way to the destination begins anew.
        const auto goal = asLongAs(given, destination(node));
        cascade.store(node, N::_base, listOf(given));
        cascade.store(node, N::_destinations, Array<E>());
        cascade.store(node, N::_times, Array<Time>());
        approach(cascade, node, goal);
    }
    static double onTime(Cascade& cascade, const Node& node) {
        begin(cascade, node);
        const auto& times = node.get(N::_times);
        const double now = cascade.now();
        const bool moves =
            !times.empty() && now - times.back().seconds < duration(node) && (times.size() > 1 || leadsAway(node));
        if (moves) {
            setActive<N>(cascade, node, true);
            sendValue<N>(cascade, node, value(node, now).span());
            return now;
        }
        const auto goal = destination(node);
        sendValue<N>(cascade, node, goal);
        if (!times.empty()) {
            cascade.store(node, N::_base, listOf(goal));
            cascade.store(node, N::_destinations, Array<E>());
            cascade.store(node, N::_times, Array<Time>());
        }
        setActive<N>(cascade, node, false);
        return kNever;
    }
};

// ---- dampers ---------------------------------------------------------------------------------------------------

/// State: the values of the filters at `_since`, all elements of the first one, then those of the next; `_tau` is the
/// time constant that they have used since then.
template <class N>
struct Damper {
    using T = ValueOf<N>;
    using E = ElementOf<N>;
    using M = Motion<E>;

    static std::size_t order(const Node& node) {
        return static_cast<std::size_t>(std::clamp(node.get(N::order), 0, 5));
    }
    static double tau(const Node& node) {
        const double tau = node.get(N::tau).seconds;
        return tau > 0 && std::isfinite(tau) ? tau : 0;
    }
    /// The values of the filters at `_since`, as distances from the destination, and the parts of these that remain
    /// later.
    class Course {
      public:
        /// `s`: time since then / tau.
        Course(const Node& node, double s)
            : goal_(node.get(N::_destination)),
              each_(goal_.size()),
              order_(Damper::order(node)),
              to_(each_),
              began_(order_ * each_) {
            const auto& filters = node.get(N::_filters);
            for (std::size_t e = 0; e < each_; ++e) to_[e] = M::widen(goal_[e]);
            for (std::size_t i = 0; i < std::min(began_.size(), filters.size()); ++i)
                // The filters of a follower that was at rest all hold the same.
                began_[i] = i >= each_ && filters[i] == filters[i - each_]
                                ? began_[i - each_]
                                : M::from(to_[i % each_], M::widen(filters[i]));
            double weight = portable::exp(-s);
            for (std::size_t k = 0; k < order_; ++k) {
                weights_[k] = weight;
                weight *= s / static_cast<double>(k + 1);
            }
        }
        /// How far filter `i`, from 1, is from the destination:
        /// exp(-s) sum over k of s^k / k! times how far filter i - k was at the beginning.
        typename M::Delta distance(std::size_t i, std::size_t element) {
            typename M::Delta sum{};
            for (std::size_t k = 0; k < i; ++k) sum += began_[(i - 1 - k) * each_ + element] * weights_[k];
            return sum;
        }
        /// Its value; at the destination, as that is written.
        E held(std::size_t i, std::size_t element) {
            const auto left = distance(i, element);
            return left == typename M::Delta{} ? goal_[element] : M::narrow(M::moved(to_[element], left));
        }
        bool isNear(double tolerance) {
            for (std::size_t e = 0; e < each_; ++e)
                for (std::size_t i = 1; i <= order_; ++i)
                    if (!(M::size(distance(i, e)) <= tolerance)) return false;
            return true;
        }
        double longestPath() {
            double distance = 0;
            for (std::size_t i = 0; i < began_.size(); ++i) distance = std::max(distance, M::size(began_[i]));
            return distance;
        }

      private:
        const Array<E>& goal_;
        std::size_t each_, order_;
        Few<typename M::Wide> to_;
        Few<typename M::Delta> began_;
        std::array<double, 5> weights_;
    };
    static double elapsed(const Node& node, double now) {
        const double tau = node.get(N::_tau).seconds;
        return tau > 0 ? std::max(0.0, now - node.get(N::_since).seconds) / tau
                       : std::numeric_limits<double>::infinity();
    }
    static void begin(Cascade& cascade, const Node& node) {
        if (node.get(N::_begun)) return;
        cascade.store(node, N::_begun, true);
        cascade.store(node, N::value_changed, node.get(N::initialValue));
        cascade.store(node, N::_destination, listOf(elements(node.get(N::initialDestination))));
        reset(cascade, node, elements(node.get(N::initialValue)));
    }
    /// All filters hold `value` now.
    static void reset(Cascade& cascade, const Node& node, std::vector<E> value) {
        const auto& goal = node.get(N::_destination);
        const std::size_t had = value.size();
        value.resize(goal.size());
        for (std::size_t i = had; i < goal.size(); ++i) value[i] = goal[i];
        std::vector<E> filters;
        for (std::size_t i = 0; i < order(node); ++i) filters.insert(filters.end(), value.begin(), value.end());
        restart(cascade, node, filters);
    }
    static void restart(Cascade& cascade, const Node& node, const std::vector<E>& filters) {
        cascade.store(node, N::_filters, listOf(filters));
        cascade.store(node, N::_since, Time{cascade.now()});
        cascade.store(node, N::_tau, Time{tau(node)});
    }
    static void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue event) {
        const bool isGoal = field == N::set_destination.index;
        if (!isGoal && field != N::set_value.index && field != N::tau.index) return;
        begin(cascade, node);
        if (field == N::set_value.index) {
            const auto given = elements(event.as<T>());
            cascade.store(node, N::_destination, listOf(asLongAs(given, elements(node.get(N::_destination)))));
            return reset(cascade, node, given);
        }
        const double s = elapsed(node, cascade.now());
        std::vector<E> goal = elements(node.get(N::_destination));
        const std::size_t had = goal.size();
        if (isGoal) goal = elements(event.as<T>());
        const bool isOver = s > kOver;
        const auto& reached = node.get(N::_destination);
        Course course(node, isOver ? 0 : s);
        std::vector<E> filters;
        for (std::size_t i = 1; i <= order(node); ++i)
            for (std::size_t e = 0; e < goal.size(); ++e)
                filters.push_back(e >= had ? goal[e] : isOver ? reached[e] : course.held(i, e));
        cascade.store(node, N::_destination, listOf(goal));
        restart(cascade, node, filters);
    }
    /// exp(-s) is none beyond.
    static constexpr double kOver = 700;
    /// How far from the destination is near enough: if the author leaves it open, a hundred-thousandth of the way.
    static double tolerance(const Node& node, Course& course) {
        const double given = node.get(N::tolerance);
        return given >= 0 ? given : course.longestPath() * 1e-5;
    }
    static double onTime(Cascade& cascade, const Node& node) {
        begin(cascade, node);
        const auto& goal = node.get(N::_destination);
        const double s = elapsed(node, cascade.now());
        Course course(node, std::min(s, kOver));
        if (s > kOver || course.isNear(tolerance(node, course))) {
            if (order(node) > 0 && node.get(N::_filters).size() > 0) reset(cascade, node, elements(goal));
            sendValue<N>(cascade, node, elements(goal));
            setActive<N>(cascade, node, false);
            return kNever;
        }
        Few<E> value(goal.size());
        const auto& filters = node.get(N::_filters);
        if (s == 0 && order(node) > 0 && filters.size() == order(node) * value.size())
            std::copy(filters.end() - static_cast<std::ptrdiff_t>(value.size()), filters.end(),
                      value.data());  // as written
        else
            for (std::size_t e = 0; e < value.size(); ++e) value[e] = course.held(order(node), e);
        setActive<N>(cascade, node, true);
        sendValue<N>(cascade, node, value.span());
        return cascade.now();
    }
};

template <template <class> class Follower, class... N>
void append(std::vector<BuiltinBehaviour>& table) {
    (table.push_back({N::type, {.onEvent = Follower<N>::onEvent, .onTime = Follower<N>::onTime, .local = true}}), ...);
}

}  // namespace

void appendFollowers(std::vector<BuiltinBehaviour>& table) {
    append<Chaser, x3d::ColorChaser, x3d::CoordinateChaser, x3d::OrientationChaser, x3d::PositionChaser,
           x3d::PositionChaser2D, x3d::ScalarChaser, x3d::TexCoordChaser2D>(table);
    append<Damper, x3d::ColorDamper, x3d::CoordinateDamper, x3d::OrientationDamper, x3d::PositionDamper,
           x3d::PositionDamper2D, x3d::ScalarDamper, x3d::TexCoordDamper2D>(table);
}

}  // namespace rtsg::behaviours
