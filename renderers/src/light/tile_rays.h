// What integrators share of a tile: the rays that it starts with, and the loop in which they and their followers go in
// packets of sixteen.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "trace_scene.h"

namespace rtsg::trace {

/// Sixteen neighbouring pixels' rays (`block` 0 to 15 of the tile, four by four pixels each), and which pixels of the
/// tile they belong to. Returns a bit per ray; lanes outside the picture are inactive.
std::uint32_t primaryRays(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
                          int block, int sample, RayPacket16& rays, std::uint16_t* pixels);

/// Rays that are traced together, and what they are for.
struct TilePacket {
    RayPacket16 rays;
    std::uint32_t active;      // a bit each, at least one
    std::uint16_t pixels[16];  // of primary rays those of a block
    int sample;                // of primary rays
    PathTask* tasks;           // one for each active lane; null: primary rays
};

/// A tile's rays: the primary ones, then those that they lead to, generation by generation.
class TileLoop {
  public:
    static constexpr std::size_t kTogether = 4;  // packets; they and what is made of them stay in the nearest cache
    TileLoop(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, int x0, int y0,
             TileResult& result)
        : scene_(scene), camera_(camera), settings_(settings), x0_(x0), y0_(y0), result_(result) {
        swapQueues();
    }
    TileLoop(const TileLoop&) = delete;
    TileLoop& operator=(const TileLoop&) = delete;
    ~TileLoop() {
        now_.clear(), next_.clear();
        swapQueues();
    }

    /// `trace(packets)` is given a few packets at a time: what is done to one after the other of them does not wait for
    /// the one before. Of what it is asked to follow, push() is told.
    template <class Trace>
    void run(const Trace& trace) {
        std::size_t count = 0;
        const auto pass = [&] {
            if (count > 0) trace(std::span(packets_, count));
            count = 0;
        };
        for (int block = 0; block < kTilePixels / 16; ++block) {
            if (!(result_.blocks >> block & 1u)) continue;
            const int end = std::min(result_.lastSample, settings_.samplesPerPixel);
            for (int sample = result_.firstSample; sample < end; ++sample) {
                TilePacket& packet = packets_[count];
                packet.active =
                    primaryRays(scene_, camera_, settings_, x0_, y0_, block, sample, packet.rays, packet.pixels);
                if (!packet.active) break;
                packet.sample = sample, packet.tasks = nullptr;
                result_.primaryRays += static_cast<std::uint64_t>(std::popcount(packet.active));
                if (++count < kTogether) continue;
                pass();
                if (next_.size() >= kDrain) drain(trace);
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
    void push(const PathTask& task) { next_.push_back(task); }
    /// A new one, to be filled in.
    PathTask& push() { return next_.emplace_back(); }

    int x(std::uint16_t pixel) const { return x0_ + pixel % kTileSide; }
    int y(std::uint16_t pixel) const { return y0_ + pixel / kTileSide; }

  private:
    static constexpr std::size_t kDrain = 8192;  // queued rays, so that many samples need no more memory than few

    /// The queues' memory stays with the thread: to get it anew for each tile costs more than to trace some.
    void swapQueues() {
        thread_local std::vector<PathTask> now, next;
        now_.swap(now), next_.swap(next);
    }

    template <class Trace>
    void drain(const Trace& trace) {
        while (!next_.empty()) {
            now_.swap(next_);
            next_.clear();
            for (std::size_t first = 0; first < now_.size();) {
                std::size_t count = 0;
                for (; count < kTogether && first < now_.size(); ++count, first += 16) fill(packets_[count], first);
                trace(std::span(packets_, count));
            }
        }
    }
    /// With queued rays.
    void fill(TilePacket& packet, std::size_t first) {
        const auto count = static_cast<int>(std::min<std::size_t>(16, now_.size() - first));
        for (int lane = 0; lane < 16; ++lane) {
            packet.rays.skip(lane);
            if (lane >= count) continue;
            const PathTask& task = now_[first + static_cast<std::size_t>(lane)];
            packet.rays.set(lane, {task.origin, kLeave, task.direction, std::numeric_limits<float>::infinity()});
            packet.pixels[lane] = task.pixel;
        }
        packet.active = (std::uint32_t{1} << count) - 1;
        packet.sample = 0, packet.tasks = &now_[first];
        result_.secondaryRays += static_cast<std::uint64_t>(count);
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    int x0_, y0_;
    TileResult& result_;
    std::vector<PathTask> now_, next_;
    TilePacket packets_[kTogether];
};

}  // namespace rtsg::trace
