// BatchTracer: follows the rays of one batch through a geometry, for one listener or for several at once.
//
// From a wall that scatters one of the listeners and their images (trace/listener_images.h) is looked for by chance, or
// where there are no images the one listener always. Of several without images each is looked for with a chance that
// grows with what it might hear. What is heard is divided by the chance: the expectation stays, and a ray takes hardly
// longer for several. Energies are kept for bands that walls tell apart (trace/band_classes.h), N at most. What air
// takes depends on the way alone and is left to whoever reads the histogram. Source: see acoustic_tracer.h; Veach 1997,
// chapters 9 and 10, on connections. Threading: one thread an object.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_tracer.h>

#include "band_classes.h"
#include "listener_choice.h"
#include "listener_images.h"
#include "places.h"
#include "signal/random.h"

namespace rtsg::trace {

inline glm::dvec3 directionFrom(double u, double v) {
    const double z = 1 - 2 * u, r = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * std::numbers::pi * v;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

/// Lambert-distributed about a unit normal: an even place on the unit disc, raised to the sphere.
inline glm::dvec3 cosineDirection(const glm::dvec3& normal, Random& random) {
    double x = 0, y = 0, r2 = 1;
    do {
        x = 2 * random.uniform() - 1;
        y = 2 * random.uniform() - 1;
        r2 = x * x + y * y;
    } while (r2 >= 1);
    // Axes beside the normal without a root; Duff et al., JCGT 6 (1), 2017.
    const double sign = std::copysign(1.0, normal.z), a = -1 / (sign + normal.z), b = normal.x * normal.y * a;
    const glm::dvec3 tangent(1 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    const glm::dvec3 bitangent(b, sign + normal.y * normal.y * a, -normal.y);
    return x * tangent + y * bitangent + std::sqrt(1 - r2) * normal;
}

inline double ballVolume(double radius) {
    return 4 * std::numbers::pi / 3 * radius * radius * radius;
}

template <std::size_t N>
using Energy = std::array<double, N>;

template <std::size_t N>
double largest(const Energy<N>& energy) {
    return *std::max_element(energy.begin(), energy.end());
}
template <std::size_t N>
double sum(const Energy<N>& energy) {
    double result = 0;
    for (const double e : energy) result += e;
    return result;
}
template <std::size_t N>
void add(Energy<N>& target, const Energy<N>& energy, double factor = 1) {
    for (std::size_t b = 0; b < N; ++b) target[b] += energy[b] * factor;
}

/// What a wall does with energy.
template <std::size_t N>
struct Shares {
    Energy<N> diffuse{}, mirror{}, through{};  // nothing where there are fewer classes

    Shares(const AcousticMaterial& material, const BandClasses& classes) {
        for (std::size_t c = 0; c < classes.count; ++c) {
            const std::size_t b = classes.first[c];
            const double reflected = std::max(0.0, material.reflected(b));
            diffuse[c] = reflected * material.scattering[b];
            mirror[c] = reflected * (1 - material.scattering[b]);
            through[c] = material.transmission[b];
        }
    }
};

/// What one listener hears, without what air takes.
template <std::size_t N>
struct Heard {
    std::vector<Energy<N>> bins;
    Energy<N> tried{};
};

/// Without what air takes.
template <std::size_t N>
struct Batch {
    std::vector<Heard<N>> heard;  // by listener
    Energy<N> sent{};
    /// What left, and what is still under way: energy and metres, of each ray.
    std::vector<std::pair<Energy<N>, double>> escaped, truncated;
    struct Exit {
        glm::dvec3 origin, direction;
        Energy<N> energy;  // 1: all that a ray is sent with
        double metres;
    };
    std::vector<Exit> exits;  // of those that left
};

/// A listener with its ball, and what of the paths to it is exact.
struct Ear {
    glm::dvec3 position;
    double radius, volume;
    bool cut;  // the ball, by walls
    double startMetres;
    int imageOrder;
    double imageShare;
    ListenerImages images;  // what is scattered and then mirrored on one of their ways is looked for there

    Ear(const glm::dvec3& at, const TraceResult& result, double speedOfSound)
        : position(at),
          radius(result.receiverRadius),
          volume(result.receiverVolume),
          cut(volume < ballVolume(radius) * (1 - 1e-9)),
          startMetres(result.batches.front().start * speedOfSound),
          imageOrder(result.imageOrder),
          imageShare(result.imageShare) {}
};

/// What all batches of one run have in common.
template <std::size_t N>
struct Task {
    const AcousticGeometry& geometry;
    const BandClasses& classes;
    glm::dvec3 source;
    std::vector<Ear> ears;
    const TraceOptions& options;
    double seconds;
    std::vector<Shares<N>> walls;
    std::span<const ReflectingPlane> planes;
    bool transmits;  // any of them

    Task(const AcousticGeometry& g, const BandClasses& apart, const glm::dvec3& s, std::vector<Ear> e,
         const TraceOptions& o, double length)
        : geometry(g), classes(apart), source(s), ears(std::move(e)), options(o), seconds(length), planes(g.planes()) {
        for (const AcousticMaterial& material : g.materials()) walls.emplace_back(material, classes);
        transmits =
            std::any_of(walls.begin(), walls.end(), [](const Shares<N>& w) { return largest<N>(w.through) > 0; });
    }
};

/// With what chance each of several listeners is looked for from a wall that scatters: in proportion to cos^2 / d^2 as
/// far as that goes, which is near enough to the cos / d^2 of what it hears, and takes no root. Chances depend on walls
/// before, never on whether anybody is seen, so what is heard divided by them is unbiased.
class ListenerChances {
  public:
    explicit ListenerChances(std::span<const Ear> ears) : count_(ears.size()) {
        const std::size_t padded = (count_ + kLanes - 1) / kLanes * kLanes;
        for (std::vector<double>* list : {&x_, &y_, &z_, &worth_, &sum_}) list->resize(padded);
        scale_.resize(padded, std::numeric_limits<double>::infinity());
        for (std::size_t i = 0; i < count_; ++i) {
            x_[i] = ears[i].position.x;
            y_[i] = ears[i].position.y;
            z_[i] = ears[i].position.z;
        }
        // For many listeners the looks of one wall grow with the root of their number: errors and time together are
        // least then.
        const auto n = static_cast<double>(count_);
        share_ = std::max(kLooks, kLooks / 2 * std::sqrt(n)) / n;
    }

    void weigh(const glm::dvec3& point, const glm::dvec3& normal) {
        double* const worth = worth_.data();
        for (std::size_t i = 0; i < x_.size(); ++i) {
            const double x = x_[i] - point.x, y = y_[i] - point.y, z = z_[i] - point.z;
            const double towards = std::max(0.0, x * normal.x + y * normal.y + z * normal.z);
            const double ratio = towards / (x * x + y * y + z * z);
            worth[i] = ratio * ratio;
        }
        for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] += worth[i];
        if (++walls_ % kRenewed != 0) return;
        for (std::size_t i = 0; i < sum_.size(); ++i) scale_[i] = share_ * static_cast<double>(walls_) / sum_[i];
    }
    double chance(std::size_t i) const {
        // Written so that what is no number is certain: before the first renewal, and on a listener's own place.
        const double ratio = worth_[i] * scale_[i];
        return ratio < 1 ? ratio : 1;
    }

  private:
    static constexpr std::size_t kLanes = 4;  // so that vectors of numbers need no rest
    static constexpr std::int64_t kRenewed = 32;
    static constexpr double kLooks = 0.8;  // from one wall, of all listeners together

    std::size_t count_;
    std::vector<double> x_, y_, z_, worth_, sum_, scale_;
    std::int64_t walls_ = 0;
    double share_ = 1;
};

template <std::size_t N>
class BatchTracer {
  public:
    BatchTracer(const Task<N>& task, Batch<N>& batch, std::uint64_t seed)
        : task_(task),
          geometry_(task.geometry),
          ears_(task.ears),
          maxDistance_(task.seconds * task.options.air.speedOfSound),
          binsPerMetre_(task.options.binsPerSecond / task.options.air.speedOfSound),
          batch_(batch),
          random_(seed),
          exitRandom_(Random::mix(seed, 0xE517)),
          looks_(ears_),
          choice_(task.planes.size()) {
        batch_.heard.resize(ears_.size());
        if (std::any_of(ears_.begin(), ears_.end(), [](const Ear& ear) { return !ear.images.all().empty(); }))
            for (std::size_t i = 0; i < ears_.size(); ++i) {
                choice_.add({ears_[i].position, i, ListenerImages::kNone}, 1);
                for (std::uint32_t k = 0; k < ears_[i].images.all().size(); ++k)
                    choice_.add({ears_[i].images.all()[k].position, i, k}, ears_[i].images.all()[k].share);
            }
        earlyLooks_ = std::max(1.0, 0.4 * std::sqrt(static_cast<double>(ears_.size())));
        laterLooks_ = kLaterLooks * earlyLooks_;
    }

    /// Sixteen rays are under way at a time, so that they can be asked about together.
    void run(std::uint64_t rays) {
        // Evenly spread directions, shifted at random: unbiased, less noise, and batches stay independent.
        shiftU_ = random_.uniform(), shiftV_ = random_.uniform();
        initial_ = 1 / static_cast<double>(rays);
        std::uint64_t sent = 0, asked = 0;
        for (int count = 0;;) {
            if (sent >= asked) {
                asked = sent + kBetweenQuestions;
                if (task_.options.goOn && !task_.options.goOn()) return;
            }
            while (count < AcousticRays::kMost && sent < rays) count += start(lanes_[count], sent++);
            if (count == 0) {
                while (connections_.rays.count > 0) followConnections();
                return askEvents();
            }
            step(count);
            for (int i = 0; i < count;)
                if (lanes_[i].ended)
                    lanes_[i] = lanes_[--count];
                else
                    ++i;
        }
    }

  private:
    /// Share of a ray's energy at which Russian roulette begins: T20 and T30 need little of what comes later.
    static constexpr double kRouletteStart = 1e-4;
    /// Rays that are sent from one TraceOptions::goOn to the next: some milliseconds.
    static constexpr std::uint64_t kBetweenQuestions = 256;
    /// So many walls look for a listener or an image of it each time, those that a ray meets later less often: what
    /// comes from one after the other is much alike.
    static constexpr int kEarly = 3;
    static constexpr double kLaterLooks = 0.3;

    /// From a wall that scatters to the image of a listener.
    struct Connection {
        Energy<N> energy;
        double factor, travelled;  // once it arrives
        std::size_t ear;
        std::uint32_t image;
        MirrorSequence mirrors;  // so far
    };
    void arrive(const Connection& way, const glm::dvec3& point, const glm::dvec3& facing, const AcousticHit& hit) {
        const glm::dvec3 toListener = ears_[way.ear].position - point;
        const double distance = glm::length(toListener);
        if (!(distance > 0)) return receive(way.ear, way.energy, way.factor, way.travelled);
        ask(way.ear, way.energy, way.factor, way.travelled, point, facing, toListener / distance, distance, hit);
    }
    /// Whether nothing is in between will be asked, with others.
    void ask(std::size_t who, const Energy<N>& energy, double factor, double travelled, const glm::dvec3& point,
             const glm::dvec3& facing, const glm::dvec3& direction, double distance, const AcousticHit& wall) {
        const int at = events_.rays.count;
        events_.rays.add(point, facing, direction, distance, wall.plane, wall.clear);
        events_.ear[at] = who;
        events_.energy[at] = energy;
        events_.factor[at] = factor;
        events_.travelled[at] = travelled;
        if (events_.rays.count == AcousticRays::kMost) askEvents();
    }

    enum class LastEvent : std::uint8_t { emitted, diffuse, mirror };

    struct Ray {
        glm::dvec3 origin, direction;
        Energy<N> energy;
        glm::dvec3 before;     // where it came from to `origin`
        double travelled = 0;  // metres
        std::uint32_t plane = kNoPlane;
        LastEvent last = LastEvent::emitted;
        int mirrorOrder = 0;     // reflections while all were mirror-like
        MirrorSequence mirrors;  // since the last reflection that was not mirror-like
        double mirrorShare = 1;  // at most, of energy that they left
        bool onlyMirrors = true;
        glm::dvec3 facing{0};              // of the surface at `origin`, towards `direction`
        int walls = 0;                     // that it met, as far as they scatter
        double roulette = kRouletteStart;  // share of what a ray starts with at which it is played next
        bool ended = false;
    };

    /// Ray number `i`; whether it carries anything.
    bool start(Ray& ray, std::uint64_t i) {
        constexpr double kPlastic = 1.32471795724474602596;  // the R2 sequence
        const double n = static_cast<double>(i) + 1;
        ray = {};
        ray.origin = ray.before = task_.source;
        const double u = n / kPlastic + shiftU_, v = n / (kPlastic * kPlastic) + shiftV_;
        ray.direction = directionFrom(u - std::floor(u), v - std::floor(v));
        const double each = task_.options.pattern ? initial_ * task_.options.pattern(ray.direction) : initial_;
        for (std::size_t c = 0; c < task_.classes.count; ++c) ray.energy[c] = each;
        add<N>(batch_.sent, ray.energy);
        return largest<N>(ray.energy) > 0;
    }

    /// Each ray to the next wall and what is heard of it there.
    void step(int count) {
        AcousticRays& rays = asked_;
        rays.count = 0;
        for (int i = 0; i < count; ++i) {
            const Ray& ray = lanes_[i];
            rays.add(ray.origin, ray.facing, ray.direction, maxDistance_ - ray.travelled, ray.plane);
        }
        AcousticHits hits;
        const std::uint32_t met = geometry_.closestOf(rays, hits);
        for (int i = 0; i < count; ++i)
            lanes_[i].ended =
                !goOn(lanes_[i], (met >> i & 1) != 0, rays.maxDistance[i], hits[static_cast<std::size_t>(i)]);
    }

    /// Counts what is heard where nothing is in between.
    void askEvents() {
        if (events_.rays.count == 0) return;
        const std::uint32_t blocked = geometry_.blockedOf(events_.rays);
        for (int i = 0; i < events_.rays.count; ++i)
            if (!(blocked >> i & 1))
                receive(events_.ear[i], events_.energy[i], events_.factor[i], events_.travelled[i]);
        events_.rays.count = 0;
    }

    bool goOn(Ray& ray, bool met, double left, AcousticHit& hit) {
        // What came through a wall would meet that again.
        const bool through = glm::dot(ray.before - ray.origin, ray.facing) < 0;
        if (!met && ray.plane != kNoPlane && !through) {
            // In a corner rounding may have put the start behind the next wall, or the ray between two of them.
            const glm::dvec3 inside = offWalls(geometry_, ray.origin, ray.before);
            met = geometry_.closest(inside, ray.direction, left, kNoPlane, hit);
            if (met) ray.origin = inside;
        }
        if (ray.last == LastEvent::mirror)
            for (std::size_t i = 0; i < ears_.size(); ++i)
                if (countsInBall(ray, ears_[i])) crossBall(ray, i, met ? hit.distance : left);
        if (met) return interact(ray, hit);
        // Beyond the echogram's end there may still be a wall: then the sound is late, not gone.
        if (geometry_.closest(ray.origin, ray.direction, 1e9, ray.plane, hit))
            batch_.truncated.emplace_back(ray.energy, maxDistance_);
        else
            escape(ray);
        return false;
    }

    /// Of all that leave some are kept, each with the same chance (Vitter 1985, algorithm R).
    void escape(const Ray& ray) {
        batch_.escaped.emplace_back(ray.energy, ray.travelled);
        const auto most = static_cast<std::size_t>(std::max(0, task_.options.exits));
        if (most == 0) return;
        std::size_t at = batch_.exits.size();
        if (at < most)
            batch_.exits.emplace_back();
        else
            at = static_cast<std::size_t>(exitRandom_.uniform() * static_cast<double>(batch_.escaped.size()));
        if (at >= most) return;
        typename Batch<N>::Exit& exit = batch_.exits[at];
        exit = {ray.origin, ray.direction, ray.energy, ray.travelled};
        for (double& e : exit.energy) e /= initial_;
    }

    /// Of a ray that a mirror sent here: not where it is one of the images of the source, nor where images of the
    /// listener were looked for.
    static bool countsInBall(const Ray& ray, const Ear& ear) {
        if (!ray.onlyMirrors) return ear.images.of(ray.mirrors) == ListenerImages::kNone;
        return !(ray.mirrorOrder <= ear.imageOrder && ray.mirrorShare >= ear.imageShare);
    }

    /// Mean intensity over the ball is energy times chord over volume.
    void crossBall(const Ray& ray, std::size_t who, double length) {
        const Ear& ear = ears_[who];
        add<N>(batch_.heard[who].tried, ray.energy);
        const glm::dvec3 toCenter = ear.position - ray.origin;
        const double nearest = glm::dot(toCenter, ray.direction);
        const double half2 = ear.radius * ear.radius - (glm::dot(toCenter, toCenter) - nearest * nearest);
        if (half2 <= 0) return;
        const double half = std::sqrt(half2), from = std::max(0.0, nearest - half),
                     to = std::min(length, nearest + half);
        if (to <= from) return;
        double at = (from + to) / 2;
        if (ear.cut) {
            // One point of the chord stands for all: it counts if it is seen from the listener.
            at = from + (to - from) * random_.uniform();
            const glm::dvec3 toPoint = ray.origin + ray.direction * at - ear.position;
            const double distance = glm::length(toPoint);
            AcousticHit hit;
            if (distance > 0 && geometry_.closest(ear.position, toPoint / distance, distance, kNoPlane, hit)) return;
        }
        receive(who, ray.energy, (to - from) / ear.volume, ray.travelled + at);
    }

    void receive(std::size_t who, const Energy<N>& energy, double factor, double travelled) {
        if (travelled >= maxDistance_) return;
        std::vector<Energy<N>>& bins = batch_.heard[who].bins;
        const auto bin = static_cast<std::size_t>(std::max(0.0, (travelled - ears_[who].startMetres) * binsPerMetre_));
        if (bin >= bins.size()) bins.resize(bin + 1 + bin / 4, Energy<N>{});
        add<N>(bins[bin], energy, factor);
    }

    bool interact(Ray& ray, const AcousticHit& hit) {
        const Shares<N>& wall = task_.walls[hit.material];
        const double cosine = glm::dot(ray.direction, hit.normal);
        const glm::dvec3 point = ray.origin + ray.direction * hit.distance;
        ray.before = ray.origin;
        ray.travelled += hit.distance;
        const glm::dvec3 facing = cosine > 0 ? -hit.normal : hit.normal;

        Energy<N> diffuse, mirror, through;
        for (std::size_t b = 0; b < N; ++b) {
            diffuse[b] = ray.energy[b] * wall.diffuse[b];
            mirror[b] = ray.energy[b] * wall.mirror[b];
            through[b] = ray.energy[b] * wall.through[b];
        }
        const double diffuseSum = sum<N>(diffuse), mirrorSum = sum<N>(mirror), throughSum = sum<N>(through);
        const double all = diffuseSum + mirrorSum + throughSum;
        if (!(all > 0)) return false;
        if (diffuseSum > 0) lookForListeners(point, facing, diffuse, hit, ray.travelled, ray.walls++ < kEarly);

        const double choice = random_.uniform() * all;
        double share = 0;  // of `all`, and so the chance
        // Rounding may put the choice past the last share; a share of nothing is never chosen.
        if (diffuseSum > 0 && (choice < diffuseSum || mirrorSum + throughSum <= 0)) {
            ray.energy = diffuse;
            share = diffuseSum;
            ray.direction = cosineDirection(facing, random_);
            ray.last = LastEvent::diffuse;
            ray.onlyMirrors = false;
            ray.mirrors = {};
        } else if (mirrorSum > 0 && (choice < diffuseSum + mirrorSum || throughSum <= 0)) {
            ray.energy = mirror;
            share = mirrorSum;
            ray.direction -= hit.normal * (2 * cosine);
            ray.last = LastEvent::mirror;
            ++ray.mirrorOrder;
            ray.mirrors.append(hit.plane);
            if (hit.plane < task_.planes.size()) ray.mirrorShare *= task_.planes[hit.plane].mirrors;
        } else {
            ray.energy = through;
            share = throughSum;
        }
        ray.origin = point;
        ray.plane = hit.plane;
        ray.facing = glm::dot(ray.direction, facing) < 0 ? -facing : facing;
        if constexpr (N == 1)
            ray.energy[0] = all;
        else
            for (double& e : ray.energy) e *= all / share;
        return largest<N>(ray.energy) >= ray.roulette * initial_ || survives(ray);
    }

    /// Russian roulette: half of the rays go on with twice the energy, each time that their own has fallen to a
    /// quarter. So their number falls with the root of the energy that is left.
    bool survives(Ray& ray) {
        do {
            if (random_.uniform() >= 0.5) return false;
            for (double& e : ray.energy) e *= 2;
            ray.roulette /= 2;
        } while (largest<N>(ray.energy) < ray.roulette * initial_);
        return true;
    }

    /// From a wall that scatters: some of the listeners and their images, or the one listener, or some of several.
    void lookForListeners(const glm::dvec3& point, const glm::dvec3& normal, const Energy<N>& energy,
                          const AcousticHit& wall, double travelled, bool early) {
        const std::size_t count = ears_.size();
        if (choice_.size() > 0) return connectSome(point, normal, energy, wall, travelled, early);
        if (count == 1) return nextEvent(0, 1, point, normal, energy, wall, travelled);
        looks_.weigh(point, normal);
        // Chances in a row, and a comb across them with teeth at distances of 1: each is met with its chance.
        double comb = random_.uniform();
        for (std::size_t i = 0; i < count; ++i) {
            const double chance = looks_.chance(i);
            comb += chance;
            if (comb < 1) continue;
            comb -= 1;
            if (chance > 0) nextEvent(i, 1 / chance, point, normal, energy, wall, travelled);
        }
    }

    /// Lambert: of the energy scattered at `point` the listener gets cos / (pi d^2), through whatever lets sound pass;
    /// it stands for `weight` such events.
    void nextEvent(std::size_t who, double weight, const glm::dvec3& point, const glm::dvec3& normal, Energy<N> energy,
                   const AcousticHit& wall, double travelled) {
        const glm::dvec3 toListener = ears_[who].position - point;
        const double towards = glm::dot(toListener, normal);
        if (!(towards > 0)) return;
        const double squared = glm::dot(toListener, toListener), distance = std::sqrt(squared);
        if (travelled + distance >= maxDistance_) return;
        add<N>(batch_.heard[who].tried, energy, weight);
        const double inverse = 1 / distance;
        const glm::dvec3 direction = toListener * inverse;
        const double factor = weight * towards * (inverse * inverse * inverse) * std::numbers::inv_pi;
        if (!task_.transmits) {
            ask(who, energy, factor, travelled + distance, point, normal, direction, distance, wall);
            return;
        }
        glm::dvec3 origin = point;
        double left = distance;
        std::uint32_t plane = wall.plane;
        AcousticHit hit;
        while (geometry_.closest(origin, direction, left, plane, hit)) {
            for (std::size_t b = 0; b < N; ++b) energy[b] *= task_.walls[hit.material].through[b];
            if (!(largest<N>(energy) > 0)) return;
            origin += direction * hit.distance;
            left -= hit.distance;
            plane = hit.plane;
        }
        receive(who, energy, factor, travelled + distance);
    }

    /// Looks for some of the listeners and their images, each by chance in proportion to what it might hear.
    void connectSome(const glm::dvec3& point, const glm::dvec3& normal, const Energy<N>& energy,
                     const AcousticHit& wall, double travelled, bool early) {
        const double looks = early ? earlyLooks_ : laterLooks_;
        const std::size_t side = 2 * std::size_t{wall.plane} + (glm::dot(normal, wall.normal) > 0 ? 1 : 0);
        for (int left = static_cast<int>(looks + random_.uniform()); left > 0; --left) {
            std::size_t which = 0;
            const double chance = choice_.choose(side, point, normal, random_.uniform(), which) * looks;
            if (!(chance > 0)) return;
            const ListenerChoice::Target& target = choice_.target(which);
            if (target.image == ListenerImages::kNone)
                nextEvent(target.ear, 1 / chance, point, normal, energy, wall, travelled);
            else
                connect(target, 1 / chance, point, normal, energy, wall, travelled);
        }
    }

    /// Starts on the way to a listener's image; it stands for `weight` such ways.
    void connect(const ListenerChoice::Target& target, double weight, const glm::dvec3& point, const glm::dvec3& normal,
                 const Energy<N>& energy, const AcousticHit& wall, double travelled) {
        const glm::dvec3 toImage = target.position - point;
        const double towards = glm::dot(toImage, normal);
        if (!(towards > 0)) return;
        const double squared = glm::dot(toImage, toImage), distance = std::sqrt(squared);
        if (travelled + distance >= maxDistance_) return;
        add<N>(batch_.heard[target.ear].tried, energy, weight);
        const int at = connections_.rays.count;
        const double inverse = 1 / distance;
        connections_.rays.add(point, normal, toImage * inverse, distance, wall.plane, wall.clear);
        connections_.of[at] = {energy,
                               weight * towards * (inverse * inverse * inverse) * std::numbers::inv_pi,
                               travelled + distance,
                               target.ear,
                               target.image,
                               {}};
        while (connections_.rays.count == AcousticRays::kMost) followConnections();
    }

    /// Each way to an image to its next mirror. If those so far are a way to the image, the listener is next.
    void followConnections() {
        AcousticHits hits;
        AcousticRays& rays = connections_.rays;
        const std::uint32_t met = geometry_.closestOf(rays, hits);
        const int count = std::exchange(rays.count, 0);
        for (int i = 0; i < count; ++i) {
            if (!(met >> i & 1)) continue;
            Connection way = connections_.of[i];
            const AcousticHit& hit = hits[static_cast<std::size_t>(i)];
            const Shares<N>& wall = task_.walls[hit.material];
            for (std::size_t b = 0; b < N; ++b) way.energy[b] *= wall.mirror[b];
            if (!(largest<N>(way.energy) > 0)) continue;
            const glm::dvec3 point = rays.origin[i] + rays.direction[i] * hit.distance;
            const double cosine = glm::dot(rays.direction[i], hit.normal);
            const glm::dvec3 direction = rays.direction[i] - hit.normal * (2 * cosine);
            const glm::dvec3 facing = cosine > 0 ? -hit.normal : hit.normal;
            const double left = rays.maxDistance[i] - hit.distance;
            way.mirrors.append(hit.plane);
            if (ears_[way.ear].images.of(way.mirrors) == way.image) {
                arrive(way, point, facing, hit);
            } else if (!way.mirrors.full()) {
                // No farther than those that were read already.
                const int at = rays.count;
                rays.add(point, facing, direction, left, hit.plane, hit.clear);
                connections_.of[at] = way;
            }
        }
    }

    const Task<N>& task_;
    const AcousticGeometry& geometry_;
    std::span<const Ear> ears_;
    double maxDistance_, binsPerMetre_;
    Batch<N>& batch_;
    Random random_, exitRandom_;  // the latter changes nothing that is heard
    double initial_ = 1, shiftU_ = 0, shiftV_ = 0;
    Ray lanes_[AcousticRays::kMost];
    AcousticRays asked_;  // of the lanes
    /// What is heard of the walls of one step if nothing is in between.
    struct {
        AcousticRays rays;
        std::size_t ear[AcousticRays::kMost];
        Energy<N> energy[AcousticRays::kMost];
        double factor[AcousticRays::kMost], travelled[AcousticRays::kMost];
    } events_;
    ListenerChances looks_;
    struct {
        AcousticRays rays;
        Connection of[AcousticRays::kMost];
    } connections_;
    ListenerChoice choice_;
    double earlyLooks_, laterLooks_;  // of one wall, for all listeners together
};

}  // namespace rtsg::trace
