// Shared by the integrators of a tile: the rays that it starts with, and the loop in which these and their followers go
// in packets of sixteen.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "lighting/trace_scene.h"

namespace rtsg::trace {

/// The places of one sample in the pixels of a tile, in [0, 1)^2, by block and by pixel in the block.
struct alignas(64) SamplePositions {
    float u[16][16], v[16][16];
};
/// Finds the places of the first samples of the tile at (x0, y0). Precondition: a pixel has more than one.
void findSpatialIndex(std::uint64_t seed, int x0, int y0, std::span<SamplePositions> samples);

/// Sixteen neighbouring pixels' rays (`block` 0 to 15 of the tile, four by four pixels each), and which pixels of the
/// tile they belong to. Returns a bit per ray; lanes outside the picture are inactive. `seed`: in place of the
/// settings'. `places`: of the sample, where they are known.
std::uint32_t primaryRays(const TraceScene& scene, const Camera& camera, const RenderSettings& settings,
                          std::uint64_t seed, int x0, int y0, int block, int sample, RayPacket16& rays,
                          std::uint16_t* pixels, const SamplePositions* positions = nullptr);

/// How far a ray that has come straight from the eye, through clear surfaces, is followed on.
float endOfSight(const Camera& camera, const PathTask& task);

/// All of a picture's, through the middles of its pixels. Precondition: a perspective.
bvh::PixelGrid pixelGrid(const TraceScene& scene, const Camera& camera, const RenderSettings& settings);

/// Rays that are traced together, and what they are for.
struct TilePacket {
    RayPacket16 rays;
    std::uint32_t active;      // a bit each, at least one
    std::uint16_t pixels[16];  // of primary rays those of a block
    int block, sample;         // of primary rays
    std::uint64_t seed;        // of primary rays
    PathTask* tasks;           // one for each active lane; null: primary rays
};

/// A tile's rays: the primary ones, then those that they lead to, generation by generation.
class TileLoop {
  public:
    enum class Round : std::uint8_t { none, mirrored, bent };
    static constexpr std::size_t kTogether = 4;  // packets; they and what is made of them stay in the nearest cache
    TileLoop(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
             std::span<TileResult> groups)
        : scene_(scene),
          camera_(camera),
          settings_(settings),
          isBounded_(camera.isBounded()),
          x0_(x0),
          y0_(y0),
          groups_(groups) {
        swapQueues();
    }
    TileLoop(const TileLoop&) = delete;
    TileLoop& operator=(const TileLoop&) = delete;
    ~TileLoop() {
        for (std::vector<PathTask>& queue : now_) queue.clear();
        for (std::vector<PathTask>& queue : next_) queue.clear();
        swapQueues();
    }

    /// `trace(packets)` gets a few packets at a time, so that the work on one need not wait for the one before. Rays
    /// that are to be followed go to push().
    template <class Trace>
    void run(const Trace& trace) {
        std::size_t count = 0;
        const auto pass = [&] {
            if (count > 0) trace(std::span(packets_, count));
            count = 0;
        };
        for (std::size_t group = 0; group < groups_.size(); ++group) {
            const TileResult& asked = groups_[group];
            const int end = std::min(asked.lastSample, settings_.samplesPerPixel);
            for (int block = 0; block < kTilePixels / 16; ++block) {
                if (!(asked.blocks >> block & 1u)) continue;
                for (int sample = asked.firstSample; sample < end; ++sample) {
                    TilePacket& packet = packets_[count];
                    if (!startPacket(group, block, sample, packet)) break;
                    if (++count < kTogether) continue;
                    pass();
                    if (waiting() >= kDrain) drain(trace);
                }
            }
        }
        pass();
        drain(trace);
    }
    /// The rest of run(), where push() has begun it.
    template <class Trace>
    void finish(const Trace& trace) {
        drain(trace);
    }
    /// Sets the places of the samples, so that they are not computed again. They must outlive run().
    void usePositions(std::span<const SamplePositions> positions) { positions_ = positions; }
    void push(const PathTask& task) { next_[0].push_back(task); }
    /// Adds a ray, to be filled in. Rays that turn alike at neighbouring places go on side by side, so they wait apart
    /// from others.
    PathTask& push(Round round = Round::none) { return next_[static_cast<std::size_t>(round)].emplace_back(); }
    /// One like another, to be changed.
    PathTask& push(Round round, const PathTask& like) {
        return next_[static_cast<std::size_t>(round)].emplace_back(like);
    }

    /// The pixel's coordinate in the picture.
    int x(std::uint16_t pixel) const { return x0_ + pixel % kTileSide; }
    int y(std::uint16_t pixel) const { return y0_ + pixel % kTilePixels / kTileSide; }
    /// The sum to which a pixel adds.
    TileResult& resultOf(std::uint16_t pixel) const { return groups_[pixel / kTilePixels]; }
    Vec4f& sumOf(std::uint16_t pixel) const { return resultOf(pixel).sum[pixel % kTilePixels]; }

  private:
    static constexpr std::size_t kDrain = 8192;  // queued rays, so that many samples need no more memory than few

    using Queues = std::array<std::vector<PathTask>, 3>;  // by Turn

    std::size_t waiting() const { return next_[0].size() + next_[1].size() + next_[2].size(); }
    /// The queues' memory stays with the thread: to get it anew for each tile costs more than to trace some.
    void swapQueues() {
        thread_local Queues now, next;
        now_.swap(now), next_.swap(next);
    }

    /// Generation by generation, and in each turn by turn: what a pixel gets comes in the same order whatever goes
    /// along in the packets.
    template <class Trace>
    void drain(const Trace& trace) {
        while (waiting() > 0) {
            now_.swap(next_);
            for (std::vector<PathTask>& queue : next_) queue.clear();
            std::size_t count = 0, mixed = 0, round = 0, at = 0;
            const auto pass = [&] {
                if (count > 0) trace(std::span(packets_, count));
                count = 0;
            };
            for (;;) {
                while (round < now_.size() && at == now_[round].size()) ++round, at = 0;
                if (round == now_.size()) break;
                std::span<PathTask> tasks = std::span(now_[round]).subspan(at);
                if (tasks.size() >= 16) {
                    tasks = tasks.first(16);
                    at += 16;
                } else {
                    tasks = gather(round, at, mixed_[mixed++]);
                }
                fill(packets_[count], tasks);
                if (++count == kTogether) pass();
            }
            pass();
        }
    }
    /// The last tasks of a turn and the first of those that follow.
    std::span<PathTask> gather(std::size_t& round, std::size_t& at, std::array<PathTask, 16>& to) {
        std::size_t count = 0;
        for (; round < now_.size(); ++round, at = 0) {
            while (count < to.size() && at < now_[round].size()) to[count++] = now_[round][at++];
            if (count == to.size()) break;
        }
        return std::span(to).first(count);
    }
    /// With primary rays; false: all of them are outside the picture.
    bool startPacket(std::size_t group, int block, int sample, TilePacket& packet) {
        const std::uint64_t seed = groups_[group].seed;
        packet.active =
            primaryRays(scene_, camera_, settings_, seed, x0_, y0_, block, sample, packet.rays, packet.pixels,
                        positions_.empty() ? nullptr : &positions_[static_cast<std::size_t>(sample)]);
        if (!packet.active) return false;
        if (group > 0)
            for (std::uint16_t& pixel : packet.pixels) pixel += static_cast<std::uint16_t>(group * kTilePixels);
        packet.block = block, packet.sample = sample, packet.seed = seed, packet.tasks = nullptr;
        groups_[0].primaryRays += static_cast<std::uint64_t>(std::popcount(packet.active));
        return true;
    }
    /// With queued rays.
    void fill(TilePacket& packet, std::span<PathTask> tasks) {
        const auto count = static_cast<int>(tasks.size());
        for (int lane = 0; lane < 16; ++lane) {
            packet.rays.skip(lane);
            if (lane >= count) continue;
            const PathTask& task = tasks[static_cast<std::size_t>(lane)];
            const bool ends = isBounded_ && task.depth == 0;
            packet.rays.set(lane, {task.origin, kLeave, task.direction,
                                   ends ? endOfSight(camera_, task) : std::numeric_limits<float>::infinity()});
            packet.pixels[lane] = task.pixel;
        }
        packet.active = (std::uint32_t{1} << count) - 1;
        packet.block = 0, packet.sample = 0, packet.tasks = tasks.data();
        groups_[0].secondaryRays += static_cast<std::uint64_t>(count);
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    const bool isBounded_;
    int x0_, y0_;
    std::span<TileResult> groups_;
    std::span<const SamplePositions> positions_;
    Queues now_, next_;
    std::array<PathTask, 16> mixed_[3];  // packets of several turns
    TilePacket packets_[kTogether];
};

}  // namespace rtsg::trace
