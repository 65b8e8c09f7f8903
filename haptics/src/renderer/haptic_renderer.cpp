// Follows a world for touch, and runs the haptic clock.
#include <rtsg/haptics/haptic_renderer.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <mutex>
#include <thread>
#include <unordered_set>
#include <utility>

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <glm/geometric.hpp>

#include <rtsg/core/worker.h>
#include <rtsg/core/x3d.h>

#include "contact/touch.h"
#include "touch_events.h"

namespace rtsg {

namespace {

using Clock = std::chrono::steady_clock;
using haptics::TouchTables;

/// Times of ticks in microseconds; what takes longer than the last of them counts as that.
class TickTimes {
  public:
    void add(double seconds) {
        ++counts_[static_cast<std::size_t>(std::clamp(1e6 * seconds, 0.0, kMax - 1.0))];
        ++all_;
        worst_ = std::max(worst_, seconds);
    }
    double median() const {
        std::uint64_t below = 0;
        for (std::size_t i = 0; i < counts_.size(); ++i) {
            below += counts_[i];
            if (below * 2 >= all_ && all_) return 1e-6 * (static_cast<double>(i) + 0.5);
        }
        return 0;
    }
    double worst() const { return worst_; }

  private:
    static constexpr std::size_t kMax = 4096;
    std::vector<std::uint64_t> counts_ = std::vector<std::uint64_t>(kMax);
    std::uint64_t all_ = 0;
    double worst_ = 0;
};

/// How far the corners of a box move at most.
double farthest(const Bounds& box, const WorldFromLocal& from, const WorldFromLocal& to) {
    const WorldFromLocal change = to - from;
    double maximum = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::dvec4 at(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                            corner & 4 ? box.max.z : box.min.z, 1);
        maximum = std::max(maximum, glm::length(change * at));
    }
    return maximum;
}

/// Those in whose metadata the entry stands.
std::vector<NodeId> appearancesOf(const Scene& scene, const Node& entry) {
    std::vector<NodeId> sets{entry.id()}, found;
    for (int depth = 0; depth < 4 && !sets.empty(); ++depth) {
        std::vector<NodeId> above;
        for (const NodeId id : sets)
            for (const ParentRef& parent : scene.parents(id)) {
                const Node& node = scene.node(parent.node);
                if (node.is(x3d::MetadataSet::type)) above.push_back(node.id());
                if (node.is(x3d::Appearance::type)) found.push_back(node.id());
            }
        sets = std::move(above);
    }
    return found;
}

/// "SCHED_FIFO", or why the calling thread is an ordinary one.
std::string hurry() {
    sched_param priority{};
    priority.sched_priority = sched_get_priority_min(SCHED_FIFO) + 1;
    const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority);
    return error ? fmt::format("an ordinary thread: SCHED_FIFO is not permitted ({})", std::strerror(error))
                 : "SCHED_FIFO";
}

}  // namespace

struct HapticRenderer::Impl {
    Impl(HapticRenderer& r, HapticOptions o) : renderer(r), options(o), touch(options), events(options) {}

    // On the scene's thread: the tables.
    struct Placed {
        WorldFromLocal pose{1.0};
        std::uint32_t generation = 0;
    };
    void putInstance(const Instance& instance) {
        const std::uint32_t slot = instance.id.slot;
        if (slot >= positions.size()) positions.resize(slot + 1);
        positions[slot] = {instance.worldFromLocal, instance.id.generation};
        movers.erase(slot);
        movedBefore.erase(slot);
    }
    void move(const InstanceDelta::Moved& moved) {
        Placed& known = positions[moved.id.slot];
        TouchTables::Mover& mover =
            movers.try_emplace(moved.id.slot, TouchTables::Mover{.from = known.pose}).first->second;
        mover.to = known.pose = moved.worldFromLocal;
        mover.generation = moved.id.generation;
        mover.steady = movedBefore.contains(moved.id.slot);
        arrived = arrived || !mover.steady;
    }
    void readSurface(const Scene& scene, NodeId appearance) {
        Diagnostics said;
        const TouchSurface surface = readTouchSurface(scene, appearance, options.surface, &said);
        if (!said.all().empty() && reported.insert(appearance.value).second) diagnostics.append(said);
        const auto known = surfaces->find(appearance.value);
        if (known != surfaces->end() ? known->second == surface : surface == options.surface) return;
        auto next = std::make_shared<std::unordered_map<std::uint32_t, TouchSurface>>(*surfaces);
        (*next)[appearance.value] = surface;
        surfaces = std::move(next);
    }

    HapticRenderer& renderer;
    const HapticOptions options;
    std::vector<Placed> positions;  // by slot
    std::unordered_map<std::uint32_t, TouchTables::Mover> movers;
    std::unordered_map<std::uint32_t, bool> movedBefore;
    std::shared_ptr<const std::unordered_map<std::uint32_t, TouchSurface>> surfaces =
        std::make_shared<std::unordered_map<std::uint32_t, TouchSurface>>();
    double frozenAt = 0;
    bool arrived = false;
    Diagnostics diagnostics;
    std::unordered_set<std::uint32_t> reported;  // appearances of which something was said

    // On the touch's thread.
    HapticTick step(const Vec3d& hand, double seconds);
    void run();
    haptics::Touch touch;
    haptics::WorldMoment moment;
    std::unique_ptr<HapticDevice> device;

    // Shared, with the mutex held.
    mutable std::mutex mutex;
    HapticReport report;
    TickTimes times;
    HapticTick last, strongest;  // strongest: since the last events
    std::vector<HapticTick> kept;
    haptics::TouchEvents events;
    std::unique_ptr<Worker> worker;  // of the device; last: its job uses the others
};

HapticRenderer::HapticRenderer(SharedWorld& world, HapticOptions options)
    : WorldRenderer(world), impl_(std::make_unique<Impl>(*this, [&] {
          options.radius = std::max(options.radius, 1e-4);
          options.rate = std::clamp(options.rate, 1.0, 1e5);
          return options;
      }())) {}

HapticRenderer::~HapticRenderer() {
    stop();
    detachFromScene();
}

const HapticOptions& HapticRenderer::options() const {
    return impl_->options;
}

Vec3d HapticRenderer::inWorld(const Vec3d& position) const {
    return impl_->options.origin + impl_->options.scale * position;
}

Result<> HapticRenderer::renderFrame() {
    if (auto ok = begin(); !ok) return ok;
    world().rays();
    presentsNow();
    return {};
}

Result<> HapticRenderer::follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    for (const InstanceId id : delta.removed) impl_->movers.erase(id.slot), impl_->movedBefore.erase(id.slot);
    impl_->arrived = impl_->arrived || !delta.added.empty() || !delta.geometries.empty();
    for (const Instance& instance : delta.added) {
        impl_->putInstance(instance);
        impl_->readSurface(scene, instance.appearance);
    }
    for (const Instance& instance : delta.rebound) impl_->readSurface(scene, instance.appearance);
    for (const InstanceDelta::Moved& moved : delta.moved)
        if (moved.id.slot < impl_->positions.size()) impl_->move(moved);
    for (const NodeId node : delta.appearanceChanged) impl_->readSurface(scene, node);
    // Metadata mean nothing to those who draw, so no instance tells of them.
    for (const Change& change : changes.changes) {
        const Node* node = scene.find(change.node);
        if (!node || !(node->is(x3d::MetadataFloat::type) || node->is(x3d::MetadataDouble::type))) continue;
        for (const NodeId appearance : appearancesOf(scene, *node)) impl_->readSurface(scene, appearance);
    }
    return {};
}

std::shared_ptr<const void> HapticRenderer::freezeTables() {
    auto tables = std::make_shared<TouchTables>();
    tables->surfaces = impl_->surfaces;
    tables->movers = std::exchange(impl_->movers, {});
    tables->arrived = std::exchange(impl_->arrived, false);
    impl_->movedBefore.clear();
    const RayWorld& rays = world().rays();
    for (const auto& [slot, mover] : tables->movers) {
        impl_->movedBefore[slot] = true;
        if (!mover.steady || slot >= rays.instances().size() || !rays.instance(slot).mesh) continue;
        tables->farthest = std::max(tables->farthest, farthest(rays.instance(slot).mesh->bounds, mover.from, mover.to));
    }
    const double now = world().scene().now();
    tables->seconds = now - std::exchange(impl_->frozenAt, now);
    return tables;
}

/// The newest state there is; the one before if there is none.
HapticTick HapticRenderer::Impl::step(const Vec3d& hand, double seconds) {
    if (auto newest = renderer.world().latest(std::chrono::nanoseconds(0))) {
        if (*newest != moment.state && (*newest)->rays) {
            moment.tables = std::static_pointer_cast<const TouchTables>(renderer.begin(**newest));
            moment.state = std::move(*newest);
            moment.since = seconds;
        }
    }
    return touch.tick(moment, hand, seconds);
}

HapticTick HapticRenderer::touch(const Vec3d& hand, double seconds) {
    const Clock::time_point start = Clock::now();
    const HapticTick tick = impl_->step(hand, seconds);
    const double took = std::chrono::duration<double>(Clock::now() - start).count();
    const std::lock_guard lock(impl_->mutex);
    HapticReport& report = impl_->report;
    ++report.ticks;
    report.unknown += !tick.known;
    report.contacts += tick.touching && !impl_->last.touching;
    report.largestForce = std::max(report.largestForce, glm::length(tick.force));
    impl_->times.add(took);
    impl_->last = tick;
    HapticTick& strongest = impl_->strongest;
    if (tick.touching && (!strongest.touching || glm::length(tick.force) >= glm::length(strongest.force)))
        strongest = tick;
    if (impl_->options.keepsTicks) impl_->kept.push_back(tick);
    return tick;
}

void HapticRenderer::Impl::run() {
    const std::string scheduling = hurry();
    {
        const std::lock_guard lock(mutex);
        report.scheduling = scheduling;
    }
    const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / options.rate));
    const Clock::time_point start = Clock::now();
    Clock::time_point due = start;
    while (!worker->stops() && !device->hasEnded()) {
        std::this_thread::sleep_until(due);
        const Clock::time_point now = Clock::now();
        if (now - due > period) {
            const auto behind = (now - due) / period;
            const std::lock_guard lock(mutex);
            report.missed += static_cast<std::uint64_t>(behind);
            due += behind * period;
        }
        due += period;
        const double seconds = std::chrono::duration<double>(now - start).count();
        const Result<Vec3d> position = device->position(seconds);
        const Vec3d nowhere(std::nan(""));
        const HapticTick tick = renderer.touch(position ? renderer.inWorld(*position) : nowhere, seconds);
        device->push(tick.force);
    }
    device->push(Vec3d(0));
    if (const std::string warning = device->warning(); !warning.empty()) {
        const std::lock_guard lock(mutex);
        report.diagnostics.warning({}, warning);
    }
}

Result<> HapticRenderer::start(std::unique_ptr<HapticDevice> device) {
    if (!attached()) return fail("touch: it is not attached to a scene");
    if (impl_->worker) return fail("touch: a device is started already");
    if (!device) return fail("touch: there is no device");
    world().rays();
    if (auto state = world().present(); !state) return std::unexpected(state.error());
    impl_->device = std::move(device);
    impl_->worker = std::make_unique<Worker>("rtsg touch");
    try {
        impl_->worker->run([this] { impl_->run(); });
    } catch (const std::system_error& error) {
        impl_->worker.reset();
        return fail(fmt::format("touch: no thread can be had: {}", error.what()));
    }
    return {};
}

HapticReport HapticRenderer::stop() {
    if (impl_->worker) {
        impl_->worker->stop();
        const std::lock_guard lock(impl_->mutex);
        if (const auto ok = impl_->worker->failure("touch ended"); !ok) impl_->report.diagnostics.add(ok.error());
    }
    impl_->worker.reset();
    impl_->device.reset();
    return report();
}

HapticReport HapticRenderer::report() const {
    const std::lock_guard lock(impl_->mutex);
    HapticReport report = impl_->report;
    report.medianSeconds = impl_->times.median();
    report.worstSeconds = impl_->times.worst();
    report.failure = failure();
    report.diagnostics.append(impl_->diagnostics);
    return report;
}

HapticTick HapticRenderer::latest() const {
    const std::lock_guard lock(impl_->mutex);
    return impl_->last;
}

bool HapticRenderer::hasEnded() const {
    return !impl_->worker || impl_->worker->idle();
}

void HapticRenderer::sendEvents() {
    HapticTick strongest, last;
    {
        const std::lock_guard lock(impl_->mutex);
        last = impl_->last;
        strongest = std::exchange(impl_->strongest, {});
    }
    impl_->events.send(world().scene(), strongest, last);
}

std::vector<HapticTick> HapticRenderer::takeTicks() {
    const std::lock_guard lock(impl_->mutex);
    return std::exchange(impl_->kept, {});
}

}  // namespace rtsg
