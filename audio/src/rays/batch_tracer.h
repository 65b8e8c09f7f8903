// BatchTracer: follows the rays of one batch through a geometry, for one listener or for several at once.
//
// At each wall that scatters, one of the listeners and their images (response/listener_images.h) is chosen at random,
// with a probability that grows with the energy it might receive; without images, a single listener is always chosen.
// The energy is divided by the probability, so the expectation stays the same, and a ray takes hardly longer for
// several listeners. Source: see acoustic_tracer.h; Veach 1997, chapters 9 and 10, on connections. Threading: one
// thread an object.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/trace_result.h>

#include "batch_task.h"
#include "ray_lanes.h"
#include "response/directions.h"
#include "response/listener_choice.h"
#include "response/listener_images.h"
#include "response/listening_positions.h"
#include "signal/random.h"

namespace rtsg::trace {

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
          choice_(task.planes.size()) {
        batch_.heard.resize(ears_.size());
        wasTried_.resize(ears_.size());
        if (ears_.size() > 1 || !ears_.front().images.all().empty())
            for (std::size_t i = 0; i < ears_.size(); ++i) {
                choice_.add({ears_[i].position, i, ListenerImages::kNone}, 1);
                for (std::uint32_t k = 0; k < ears_[i].images.all().size(); ++k)
                    choice_.add({ears_[i].images.all()[k].position, i, k}, ears_[i].images.all()[k].fraction);
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
        lanes_.rays.count = RayLanes<N>::kMax;
        for (std::uint32_t free = (1u << RayLanes<N>::kMax) - 1;;) {
            if (sent >= asked) {
                asked = sent + kBetweenQuestions;
                if (task_.options.goOn && !task_.options.goOn()) return;
            }
            for (; free != 0 && !parts_.empty(); free &= free - 1) startPart(std::countr_zero(free));
            while (free != 0 && sent < rays)
                if (start(std::countr_zero(free), sent++)) free &= free - 1;
            if (free != 0) closeRanks(free);
            while (lanes_.rays.count < RayLanes<N>::kMax && !parts_.empty()) startPart(lanes_.rays.count++);
            if (lanes_.rays.count == 0) break;
            free = step();
        }
        while (connections_.rays.count > 0) followConnections();
        askEvents();
    }

  private:
    /// Share of a ray's energy at which Russian roulette begins: T20 and T30 need little of the later energy.
    static constexpr double kRouletteStart = 1e-4;
    /// Rays that are sent from one TraceOptions::goOn to the next: some milliseconds.
    static constexpr std::uint64_t kBetweenQuestions = 256;
    /// The first walls of a ray always connect to a listener or an image, later ones less often, because their
    /// contributions resemble each other.
    static constexpr int kEarly = 3;
    static constexpr double kLaterLooks = 0.3;
    /// Metres; a little more than places on walls are moved off them.
    static constexpr double kBesideWall = 1e-3;
    /// Bounds 1 / m: sound from nearer than a centimetre is as loud as from one, as direct sound and images are.
    static double bounded(double inverse) { return inverse < 100 ? inverse : 100; }
    /// Walls that parts of rays meet at most, for each that those meet which were sent.
    static constexpr std::int64_t kWallsOfParts = 3;

    /// From a scattering wall to the image of a listener.
    struct Connection {
        Energy<N> energy;
        double factor, travelled;  // once it arrives
        std::size_t ear;
        std::uint32_t image;
        MirrorSequence mirrors;  // so far
    };
    void arrive(const Connection& connection, const glm::dvec3& point, const glm::dvec3& facing,
                const AcousticHit& hit) {
        const glm::dvec3 toListener = ears_[connection.ear].position - point;
        const double distance = glm::length(toListener);
        if (!(distance > 0))
            return receive(connection.ear, connection.energy, connection.factor, connection.travelled, facing);
        ask(connection.ear, connection.energy, connection.factor, connection.travelled, point, facing,
            toListener / distance, distance, hit);
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
        if (events_.rays.count == AcousticRays::kMax) askEvents();
    }

    /// Ray number `ray`; whether it carries anything.
    bool start(int lane, std::uint64_t ray) {
        constexpr double kPlastic = 1.32471795724474602596;  // the R2 sequence
        const double n = static_cast<double>(ray) + 1;
        const double u = n / kPlastic + shiftU_, v = n / (kPlastic * kPlastic) + shiftV_;
        const glm::dvec3 direction = directionFrom(u - std::floor(u), v - std::floor(v));
        const double each = task_.options.pattern ? initial_ * task_.options.pattern(direction) : initial_;
        Energy<N> energy{};
        for (std::size_t c = 0; c < task_.classes.count; ++c) energy[c] = each;
        add<N>(batch_.sent, energy);
        lanes_.start(lane, task_.source, direction, energy, kRouletteStart);
        return each > 0;
    }
    void startPart(int lane) {
        lanes_.start(lane, parts_.back());
        parts_.pop_back();
    }
    /// Moves rays under way into the first lanes, once no more are sent.
    void closeRanks(std::uint32_t free) {
        int count = 0;
        for (int i = 0; i < lanes_.rays.count; ++i)
            if (!(free >> i & 1)) {
                if (i != count) lanes_.copy(i, count);
                ++count;
            }
        lanes_.rays.count = count;
    }

    /// Traces each ray to the next wall, and adds its contribution there. Returns a bit for each lane whose ray has
    /// ended.
    std::uint32_t step() {
        AcousticRays& rays = lanes_.rays;
        for (int i = 0; i < RayLanes<N>::kMax; ++i) rays.maxDistance[i] = maxDistance_ - lanes_.travelled[i];
        std::uint32_t met = geometry_.closestOf(rays, hits_);
        const std::uint32_t asked = (1u << rays.count) - 1;
        cornered_ = 0;
        forEachBit(asked & ~met, [&](int i) {
            if (isBehindCorner(i))
                met |= 1u << i, cornered_ |= 1u << i;
            else
                leave(i);
        });
        forEachBit(asked & comeBy(), [&](int i) {
            hearAlong(i, (met >> i & 1) != 0 ? hits_[static_cast<std::size_t>(i)].distance : rays.maxDistance[i]);
        });
        return met == 0 ? asked : asked & ~interact(met);
    }

    /// Adds the contributions whose paths are free.
    void askEvents() {
        if (events_.rays.count == 0) return;
        const std::uint32_t blocked = geometry_.blockedOf(events_.rays);
        for (int i = 0; i < events_.rays.count; ++i)
            if (!(blocked >> i & 1))
                receive(events_.ear[i], events_.energy[i], events_.factor[i], events_.travelled[i],
                        -events_.rays.direction[i]);
        events_.rays.count = 0;
    }

    /// Whether a ray that met nothing met something after all: in a corner rounding may have put its start behind the
    /// next wall, or the ray between two of them.
    bool isBehindCorner(int i) {
        AcousticRays& rays = lanes_.rays;
        // A ray that came through a wall would meet that wall again.
        const bool through = glm::dot(lanes_.before[i] - rays.origin[i], rays.facing[i]) < 0;
        if (rays.except[i] == kNoPlane || through) return false;
        // A start next to the wall, as from a source that touches a body, tells no side.
        glm::dvec3 towards = lanes_.before[i];
        if (glm::dot(towards - rays.origin[i], rays.facing[i]) < kBesideWall) towards += kBesideWall * rays.facing[i];
        const glm::dvec3 inside = offWalls(geometry_, rays.origin[i], towards);
        const bool met = geometry_.closest(inside, rays.direction[i], rays.maxDistance[i], kNoPlane,
                                           hits_[static_cast<std::size_t>(i)]);
        if (met) rays.origin.set(i, inside);
        return met;
    }

    void leave(int i) {
        const AcousticRays& rays = lanes_.rays;
        // Beyond the echogram's end there may still be a wall: then the sound is late, not gone.
        AcousticHit hit;
        if (geometry_.closest(rays.origin[i], rays.direction[i], 1e9, rays.except[i], hit))
            batch_.truncated.emplace_back(lanes_.energyOf(i), maxDistance_);
        else
            escape(i);
    }

    /// Keeps some of the rays that leave, each with the same chance (Vitter 1985, algorithm R).
    void escape(int i) {
        batch_.escaped.emplace_back(lanes_.energyOf(i), lanes_.travelled[i]);
        const auto maximum = static_cast<std::size_t>(std::max(0, task_.options.exits));
        if (maximum == 0) return;
        std::size_t at = batch_.exits.size();
        if (at < maximum)
            batch_.exits.emplace_back();
        else
            at = static_cast<std::size_t>(exitRandom_.uniform() * static_cast<double>(batch_.escaped.size()));
        if (at >= maximum) return;
        typename Batch<N>::Exit& exit = batch_.exits[at];
        exit = {lanes_.rays.origin[i], lanes_.rays.direction[i], lanes_.energyOf(i), lanes_.travelled[i]};
        for (double& e : exit.energy) e /= initial_;
    }

    /// Rays that a mirror sent here and that come by a listener; all of them as long as it matters whether they would
    /// have counted.
    std::uint32_t comeBy() const {
        const AcousticRays::Vectors &o = lanes_.rays.origin, &d = lanes_.rays.direction;
        const std::uint32_t mirrored =
            lanesWhere([&](int i) { return (lanes_.last[i] == RayLanes<N>::Event::mirror) & !lanes_.again[i]; });
        if (mirrored == 0 || std::ranges::find(wasTried_, 0) != wasTried_.end()) return mirrored;
        // In single precision, twice as many at a time; candidates that might only pass by rounding are tested in
        // double precision.
        constexpr int kMax = RayLanes<N>::kMax;
        constexpr float kRounding = 1e-5f;
        const glm::dvec3 center = ears_[0].position;
        alignas(64) float ox[kMax], oy[kMax], oz[kMax], dx[kMax], dy[kMax], dz[kMax];
        alignas(64) float maximum[kMax] = {};  // squares of half the ways through balls
        for (int i = 0; i < kMax; ++i) {
            ox[i] = static_cast<float>(center.x - o.x[i]), dx[i] = static_cast<float>(d.x[i]);
            oy[i] = static_cast<float>(center.y - o.y[i]), dy[i] = static_cast<float>(d.y[i]);
            oz[i] = static_cast<float>(center.z - o.z[i]), dz[i] = static_cast<float>(d.z[i]);
        }
        for (const Ear& ear : ears_) {
            const glm::vec3 off(ear.position - center);
            const auto square = static_cast<float>(ear.radius * ear.radius);
            for (int i = 0; i < kMax; ++i) {
                const float x = off.x + ox[i], y = off.y + oy[i], z = off.z + oz[i];
                const float nearest = x * dx[i] + y * dy[i] + z * dz[i];
                const float half2 = square - ((x * x + y * y + z * z) * (1 - kRounding) - nearest * nearest);
                maximum[i] = half2 > maximum[i] ? half2 : maximum[i];
            }
        }
        return mirrored & lanesWhere([&](int i) { return maximum[i] > 0; });
    }
    /// Lets listeners hear a ray that a mirror sent here, along its way.
    void hearAlong(int i, double length) {
        const glm::dvec3 origin = lanes_.rays.origin[i], direction = lanes_.rays.direction[i];
        for (std::size_t who = 0; who < ears_.size(); ++who) {
            const Ear& ear = ears_[who];
            const glm::dvec3 toCenter = ear.position - origin;
            const double nearest = glm::dot(toCenter, direction);
            const double half2 = ear.radius * ear.radius - (glm::dot(toCenter, toCenter) - nearest * nearest);
            // Whether it would have counted matters as long as none has.
            const bool crosses = half2 > 0;
            if ((!crosses && wasTried_[who]) || !countsInBall(i, ear)) continue;
            noteTried(who, lanes_.energyOf(i));
            if (crosses) crossBall(i, who, length, nearest, std::sqrt(half2));
        }
    }
    void noteTried(std::size_t who, const Energy<N>& energy) {
        Energy<N>& tried = batch_.heard[who].tried;
        add<N>(tried, energy);
        wasTried_[who] = std::all_of(tried.begin(), tried.begin() + static_cast<std::ptrdiff_t>(task_.classes.count),
                                     [](double e) { return e > 0; });
    }
    /// Not where it is one of the images of the source, nor where images of the listener were looked for.
    bool countsInBall(int i, const Ear& ear) const {
        if (!lanes_.onlyMirrors[i]) return ear.images.of(lanes_.mirrors[i]) == ListenerImages::kNone;
        return !(lanes_.mirrorOrder[i] <= ear.imageOrder && lanes_.mirrorFraction[i] >= ear.imageFraction);
    }

    /// Mean intensity over the ball is energy times chord over volume.
    void crossBall(int i, std::size_t who, double length, double nearest, double half) {
        const glm::dvec3 origin = lanes_.rays.origin[i], direction = lanes_.rays.direction[i];
        const Ear& ear = ears_[who];
        const double from = std::max(0.0, nearest - half), to = std::min(length, nearest + half);
        if (to <= from) return;
        double at = (from + to) / 2;
        if (ear.cut) {
            // One point of the chord stands for all: it counts if it is seen from the listener.
            at = from + (to - from) * random_.uniform();
            const glm::dvec3 toPoint = origin + direction * at - ear.position;
            const double distance = glm::length(toPoint);
            AcousticHit hit;
            if (distance > 0 && geometry_.closest(ear.position, toPoint / distance, distance, kNoPlane, hit)) return;
        }
        receive(who, lanes_.energyOf(i), (to - from) / ear.volume, lanes_.travelled[i] + at, -direction);
    }

    /// `from`: towards where it comes from.
    void receive(std::size_t who, const Energy<N>& energy, double factor, double travelled, const glm::dvec3& from) {
        if (travelled >= maxDistance_) return;
        const auto bin = static_cast<std::size_t>(std::max(0.0, (travelled - ears_[who].startMetres) * binsPerMetre_));
        const auto addTo = [&](std::vector<Energy<N>>& bins, double fraction) {
            if (bin >= bins.size()) bins.resize(bin + 1 + bin / 4, Energy<N>{});
            add<N>(bins[bin], energy, fraction);
        };
        addTo(batch_.heard[who].bins, factor);
        if (!ears_[who].sided) return;
        const double side = glm::dot(ears_[who].across, from);  // the share that a figure-of-eight microphone hears
        addTo(batch_.heard[who].lateral, factor * side * side);
    }

    /// Lets walls act on the rays that met them, and returns a bit for each that goes on.
    std::uint32_t interact(std::uint32_t met) {
        lanes_.arrive(met, hits_, task_.walls, task_.underway.known());
        std::uint32_t left = lanes_.left(met);
        const std::uint32_t scattering = lanes_.scatters(left) & ~lanesWhere([&](int i) { return lanes_.again[i]; });
        alignas(64) double choice[RayLanes<N>::kMax], look[RayLanes<N>::kMax], across[RayLanes<N>::kMax],
            round[RayLanes<N>::kMax];
        drawPairs(random_, choice, look);
        drawPairs(random_, across, round);
        if (choice_.size() > 0)
            connectSome(scattering, look);
        else if (ears_.size() == 1 && !task_.transmits)
            lookForListener(scattering);
        else
            forEachBit(scattering, [&](int i) {
                nextEvent(0, 1, lanes_.rays.origin[i], lanes_.rays.facing[i], lanes_.scattered(i),
                          hits_[static_cast<std::size_t>(i)], lanes_.travelled[i]);
            });
        if (task_.underway.known()) {
            left = weigh(left);
            lanes_.goOn(choice, across, round, task_.planes);
            return left;
        }
        lanes_.goOn(choice, across, round, task_.planes);
        std::uint32_t result = left;
        forEachBit(lanes_.faint(left, initial_), [&](int i) {
            if (!survives(i)) result &= ~(1u << i);
        });
        return result;
    }

    /// Splits a ray that has much more energy than the mean of rays at its time, and plays Russian roulette with one
    /// that has much less: late sound often comes from few rays, which makes it noisy. Returns whether the ray
    /// continues. The parts take different paths where walls scatter, and hit a bounded number of walls. The
    /// expectation does not depend on when rays are split, as long as this is decided before anything that follows from
    /// it.
    std::uint32_t weigh(std::uint32_t lanes) {
        constexpr double kMuch = 4, kLittle = 1.0 / 8, kScatters = 0.05;
        constexpr int kMaxAtOnce = 8, kMaxParts = 4096;
        double usual[RayLanes<N>::kMax], has[RayLanes<N>::kMax];
        for (int i = 0; i < RayLanes<N>::kMax; ++i) usual[i] = task_.underway.at(lanes_.travelled[i]) * initial_;
        lanes_.leftMaximum(has);
        const std::uint32_t ofParts = lanes & lanesWhere([&](int i) { return lanes_.isPart[i]; });
        wallsOfParts_ += std::popcount(ofParts), wallsOfSent_ += std::popcount(lanes & ~ofParts);
        std::fill_n(lanes_.again, RayLanes<N>::kMax, false);
        std::uint32_t result = lanes;
        forEachBit(lanes & lanesWhere([&](int i) { return has[i] < kLittle * usual[i]; }), [&](int i) {
            const double chance = has[i] / (usual[i] / 2);
            if (random_.uniform() >= chance)
                result &= ~(1u << i);
            else
                lanes_.scale(i, 1 / chance);
        });
        if (wallsOfParts_ >= kWallsOfParts * wallsOfSent_) return result;
        forEachBit(lanes & ~cornered_ & lanesWhere([&](int i) { return has[i] > kMuch * usual[i]; }), [&](int i) {
            if (!(lanes_.scattering(i) > kScatters) || lanes_.parts[i] >= kMaxParts) return;
            const int into = static_cast<int>(std::min<double>(kMaxAtOnce, has[i] / usual[i] / 1.5));
            parts_.insert(parts_.end(), static_cast<std::size_t>(into - 1), lanes_.split(i, into));
        });
        return result;
    }

    /// Russian roulette: half of the rays continue with twice the energy, each time that their own has fallen to a
    /// quarter. So their number falls with the root of the energy that is left.
    bool survives(int i) {
        do {
            if (random_.uniform() >= 0.5) return false;
            for (std::size_t b = 0; b < N; ++b) lanes_.energy[b][i] *= 2;
            lanes_.roulette[i] /= 2;
        } while (largest<N>(lanes_.energyOf(i)) < lanes_.roulette[i] * initial_);
        return true;
    }

    /// Connects scattering walls to the only listener.
    void lookForListener(std::uint32_t from) {
        constexpr int kMax = RayLanes<N>::kMax;
        const AcousticRays& rays = lanes_.rays;
        const glm::dvec3 ear = ears_[0].position;
        alignas(64) double factor[kMax], distance[kMax];
        AcousticRays::Vectors& direction = towardsListener_;
        for (int i = 0; i < kMax; ++i) {
            const double x = ear.x - rays.origin.x[i], y = ear.y - rays.origin.y[i], z = ear.z - rays.origin.z[i];
            const double towards = x * rays.facing.x[i] + y * rays.facing.y[i] + z * rays.facing.z[i];
            distance[i] = std::sqrt(x * x + y * y + z * z);
            const double inverse = 1 / distance[i];
            direction.x[i] = x * inverse, direction.y[i] = y * inverse, direction.z[i] = z * inverse;
            factor[i] = towards * (inverse * bounded(inverse) * bounded(inverse)) * std::numbers::inv_pi;
        }
        const std::uint32_t wanted =
            lanesWhere([&](int i) { return factor[i] > 0 && lanes_.travelled[i] + distance[i] < maxDistance_; });
        Energy<N> tried = batch_.heard[0].tried;
        forEachBit(wanted & from, [&](int i) { add<N>(tried, lanes_.scattered(i)); });
        batch_.heard[0].tried = tried;
        forEachBit(wanted & from, [&](int i) {
            ask(0, lanes_.scattered(i), factor[i], lanes_.travelled[i] + distance[i], rays.origin[i], rays.facing[i],
                direction[i], distance[i], hits_[static_cast<std::size_t>(i)]);
        });
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
        const double factor = weight * towards * (inverse * bounded(inverse) * bounded(inverse)) * std::numbers::inv_pi;
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
        receive(who, energy, factor, travelled + distance, -direction);
    }

    /// Connects scattering walls to some of the listeners and their images, chosen at random in proportion to their
    /// possible contribution. `round`: numbers in [0, 1).
    void connectSome(std::uint32_t from, const double (&round)[RayLanes<N>::kMax]) {
        std::int32_t looks[RayLanes<N>::kMax];
        for (int i = 0; i < RayLanes<N>::kMax; ++i) looks[i] = static_cast<std::int32_t>(looksOf(i) + round[i]);
        forEachBit(from & lanesWhere([&](int i) { return looks[i] > 0; }),
                   [&](int i) { connectSome(i, looks[i], looksOf(i)); });
        for (int i = 0; i < RayLanes<N>::kMax; ++i) lanes_.wallsMet[i] += static_cast<std::int32_t>(from >> i & 1);
    }
    double looksOf(int i) const { return lanes_.wallsMet[i] < kEarly ? earlyLooks_ : laterLooks_; }
    /// So many times; as often as `mean` in the mean.
    void connectSome(int i, std::int32_t times, double mean) {
        const glm::dvec3 point = lanes_.rays.origin[i], normal = lanes_.rays.facing[i];
        const Energy<N> energy = lanes_.scattered(i);
        const AcousticHit& wall = hits_[static_cast<std::size_t>(i)];
        const std::size_t side = 2 * std::size_t{wall.plane} + (glm::dot(normal, wall.normal) > 0 ? 1 : 0);
        for (; times > 0; --times) {
            std::size_t which = 0;
            const double chance = choice_.choose(side, point, normal, random_.uniform(), which) * mean;
            if (!(chance > 0)) return;
            const ListenerChoice::Target& target = choice_.target(which);
            if (target.image == ListenerImages::kNone)
                nextEvent(target.ear, 1 / chance, point, normal, energy, wall, lanes_.travelled[i]);
            else
                connect(target, 1 / chance, point, normal, energy, wall, lanes_.travelled[i]);
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
        connections_.of[at] = {
            energy,
            weight * towards * (inverse * bounded(inverse) * bounded(inverse)) * std::numbers::inv_pi,
            travelled + distance,
            target.ear,
            target.image,
            {}};
        while (connections_.rays.count == AcousticRays::kMax) followConnections();
    }

    /// Each way to an image to its next mirror. If those so far are a way to the image, the listener is next.
    void followConnections() {
        AcousticHits hits;
        AcousticRays& rays = connections_.rays;
        const std::uint32_t met = geometry_.closestOf(rays, hits);
        const int count = std::exchange(rays.count, 0);
        for (int i = 0; i < count; ++i) {
            if (!(met >> i & 1)) continue;
            Connection connection = connections_.of[i];
            const AcousticHit& hit = hits[static_cast<std::size_t>(i)];
            const Fractions<N>& wall = task_.walls[hit.material];
            for (std::size_t b = 0; b < N; ++b) connection.energy[b] *= wall.mirror[b];
            if (!(largest<N>(connection.energy) > 0)) continue;
            const glm::dvec3 point = rays.origin[i] + rays.direction[i] * hit.distance;
            const double cosine = glm::dot(rays.direction[i], hit.normal);
            const glm::dvec3 direction = rays.direction[i] - hit.normal * (2 * cosine);
            const glm::dvec3 facing = cosine > 0 ? -hit.normal : hit.normal;
            const double left = rays.maxDistance[i] - hit.distance;
            connection.mirrors.append(hit.plane);
            if (ears_[connection.ear].images.of(connection.mirrors) == connection.image) {
                arrive(connection, point, facing, hit);
            } else if (!connection.mirrors.full()) {
                // No farther than those that were read already.
                const int at = rays.count;
                rays.add(point, facing, direction, left, hit.plane, hit.clear);
                connections_.of[at] = connection;
            }
        }
    }

    const Task<N>& task_;
    const AcousticGeometry& geometry_;
    std::span<const Ear> ears_;
    double maxDistance_, binsPerMetre_;
    Batch<N>& batch_;
    std::vector<char> wasTried_;  // by ear: in every class of bands
    Random random_, exitRandom_;  // the latter changes nothing that is heard
    double initial_ = 1, shiftU_ = 0, shiftV_ = 0;
    RayLanes<N> lanes_;
    std::vector<typename RayLanes<N>::Part> parts_;  // that wait for a lane
    std::uint32_t cornered_ = 0;                     // lanes that isBehindCorner() has put to their wall
    std::int64_t wallsOfParts_ = 0, wallsOfSent_ = 0;
    AcousticHits hits_;  // of the lanes
    AcousticRays::Vectors towardsListener_;
    /// The sound that listeners hear of the walls of one step if nothing is in between.
    struct {
        AcousticRays rays;
        std::size_t ear[AcousticRays::kMax];
        Energy<N> energy[AcousticRays::kMax];
        double factor[AcousticRays::kMax], travelled[AcousticRays::kMax];
    } events_;
    struct {
        AcousticRays rays;
        Connection of[AcousticRays::kMax];
    } connections_;
    ListenerChoice choice_;
    double earlyLooks_, laterLooks_;  // of one wall, for all listeners together
};

}  // namespace rtsg::trace
