// The shared world: one flattener and one RayWorld on the bus, their subscribers, and states of all of it for readers
// on other threads.
#include <rtsg/renderers/shared_world.h>

#include <algorithm>
#include <atomic>
#include <ctime>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include <rtsg/core/scene.h>

#include "hand_over.h"

namespace rtsg {

namespace {

double threadSeconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Runs `work`, which returns a Result; exceptions become errors as well.
template <class Work>
Result<> guarded(const Work& work) {
    try {
        return work();
    } catch (const std::exception& e) {
        return fail(e.what());
    } catch (...) {
        return fail("an exception of unknown type");
    }
}

bool touchesRays(const InstanceDelta& d) {
    return !d.removed.empty() || !d.added.empty() || !d.moved.empty() || !d.rebound.empty() || !d.geometries.empty() ||
           !d.geometriesRemoved.empty();
}

std::string reason(const Diagnostic& error) {
    return error.text.empty() ? "it failed without saying why" : error.text;
}

}  // namespace

struct SharedWorld::Impl final : Subscriber {
    struct Entry {
        InstanceSubscriber* subscriber = nullptr;  // null: removed during a delivery
        bool upToDate = false;
        std::string failure;
        std::uint64_t number = 0;
    };

    Impl(Scene& s, Options o) : scene(s), options(std::move(o)), flattener(std::move(options.flattening)) {}

    double clock() const { return options.timed ? threadSeconds() : 0; }

    void beforeRestart() override {
        if (heardOfRestart) heardOfRestart();
    }

    Result<> apply(const Scene& at, const ChangeSet& changes) override {
        const Result<> done = guarded([&] {
            const double start = clock();
            takeEye();
            const InstanceDelta& now = flattener.apply(at, changes);
            times.flattening = clock() - start;
            return deliver(at, changes, now);
        });
        if (!done) failed.store(true, std::memory_order_relaxed);
        return done;
    }
    std::string subscriberName() const override { return "shared world"; }

    /// With an empty change set: what happened to the viewer or to those added, not to the scene.
    Result<> deliverViewer() {
        ChangeSet none;
        none.from = none.to = scene.sequence();
        const double start = clock();
        const InstanceDelta& now = flattener.updateViewer(scene);
        times.flattening = clock() - start;
        return deliver(scene, none, now);
    }

    Result<> deliver(const Scene& at, const ChangeSet& changes, const InstanceDelta& now) {
        delta = &now;
        const double start = clock();
        if (rays) {
            rays->apply(now);
            counts.commits += touchesRays(now);
        }
        const double done = clock();
        times.rays = done - start;
        const bool news = changes.from != changes.to || !now.empty();
        counts.deliveries += news;
        std::optional<std::pair<ChangeSet, InstanceDelta>> whole;  // for those who come late
        // Somebody may have edited the scene from within this delivery: a snapshot would be ahead of the instances.
        const bool inThisState = at.sequence() == now.sequence && !at.hasUnsealedEdits();
        delivering = true;
        // By index: a subscriber may add or remove others while it runs.
        for (std::size_t i = 0; i < entries.size(); ++i) {
            if (!entries[i].subscriber || !entries[i].failure.empty()) continue;
            const bool late = !entries[i].upToDate;
            if (late && !inThisState) continue;  // with the next set
            if (!late && !news) continue;
            entries[i].upToDate = true;
            if (late && !whole) whole.emplace(at.snapshot(), flattener.snapshot());
            InstanceSubscriber* subscriber = entries[i].subscriber;
            const Result<> result = guarded([&] {
                return late ? subscriber->apply(at, whole->first, whole->second) : subscriber->apply(at, changes, now);
            });
            if (result || entries[i].subscriber != subscriber) continue;
            entries[i].failure = reason(result.error());
            failures.error(result.error().where, subscriber->subscriberName() + ": " + entries[i].failure,
                           result.error().code);
        }
        delivering = false;
        std::erase_if(entries, [](const Entry& entry) { return !entry.subscriber; });
        const double served = clock();
        times.subscribers = served - done;
        if (news) ++moment;
        serve();
        times.handingOver = clock() - served;
        return {};
    }

    /// Takes the eye of a reader, if one has set it.
    bool takeEye() {
        if (!eyeMoved.load(std::memory_order_relaxed)) return false;
        const std::unique_lock lock(eyeMutex, std::try_to_lock);  // a reader that holds it is heard the next time
        if (!lock) return false;
        eyeMoved.store(false, std::memory_order_relaxed);
        flattener.setViewer(eye, eyeSights);
        return true;
    }

    // ---- for readers on other threads --------------------------------------------------------------------------

    /// After a delivery: a new state if somebody has asked for one.
    void serve() {
        if (delivering || waits) return;  // not all have had their turn, or a picture is made first
        current.store(moment, std::memory_order_release);
        if (wanted.load(std::memory_order_relaxed)) {
            askedAt = moment;
            if (handedAt != moment) handOver();
        } else if (handedAt != 0 && moment - askedAt > kForget) {
            if (states.put(nullptr)) handedAt = 0;
        }
    }
    void handOver() {
        if (lookAnew()) return;
        wanted.store(false, std::memory_order_relaxed);  // later requests want the next one
        const Result<> created = guarded([&]() -> Result<> {
            auto state = std::make_shared<WorldState>();
            state->sequence = delta ? delta->sequence : 0;
            state->time = scene.now();
            state->moment = moment;
            if (flattener.usesPixels())
                state->sights = std::make_shared<const std::vector<LayerSight>>(flattener.sights());
            if (rays) state->rays = rays->freeze();
            if (rays && !state->rays) return fail("so many are held");
            state->tables.reserve(entries.size());
            for (const Entry& entry : entries)
                if (entry.subscriber && entry.upToDate && entry.failure.empty())
                    if (auto table = entry.subscriber->freeze())
                        state->tables.emplace_back(entry.number, std::move(table));
            if (!states.put(std::move(state))) return fail("all places are taken");
            return {};
        });
        if (created) {
            handedAt = moment;
            ++counts.handedOver;
            return;
        }
        ++counts.refused;
        refusedAt.store(moment, std::memory_order_release);
        wanted.store(true, std::memory_order_relaxed);
    }

    /// Lays out content whose size depends on pixels, for renderers of states: if there are several, for the picture
    /// size that was requested last. True: it did, and the wanted state has been handed over.
    bool lookAnew() {
        if (asIs || !rays || !flattener.usesPixels()) return false;
        if (!delta || scene.sequence() != delta->sequence || scene.hasUnsealedEdits())
            return false;  // edited meanwhile
        std::optional<PictureSight> look;
        for (const Entry& entry : entries) {
            auto one = entry.subscriber && entry.upToDate && entry.failure.empty() ? entry.subscriber->looksFrom()
                                                                                   : std::nullopt;
            if (!one) continue;
            look = std::move(one);
            if (areOfOneSize(look->layers, flattener.sights())) break;
        }
        if (!look) return false;
        asIs = true;
        flattener.setViewer(look->eye, std::move(look->layers));
        (void)outside([&] { return deliverViewer(); });  // a failure is kept
        asIs = false;
        return true;
    }

    /// Runs work outside of the bus's deliveries; a failure stops everything, as one in a delivery does.
    Result<> outside(const std::function<Result<>()>& work) {
        if (!failure.empty()) return fail(failure);
        const Result<> result = guarded(work);
        if (!result) {
            failure = reason(result.error());
            failed.store(true, std::memory_order_relaxed);
        }
        return result;
    }

    Scene& scene;
    Options options;
    Flattener flattener;
    std::unique_ptr<RayWorld> rays;
    const InstanceDelta* delta = nullptr;
    std::vector<Entry> entries;
    bool delivering = false;
    bool asIs = false;   // states are handed over as they are laid out
    bool waits = false;  // none is handed over
    Diagnostics failures;
    std::string failure;
    Counts counts;
    Times times;
    std::uint64_t added = 0;  // subscribers, ever
    std::map<std::string, std::weak_ptr<void>> common;

    // The scene's thread counts; readers look at the atomic ones.
    std::uint64_t moment = 1;                                     // deliveries, from 1
    std::uint64_t handedAt = 0, askedAt = 0;                      // moments
    mutable std::atomic<std::uint64_t> current{1}, refusedAt{0};  // moments
    mutable std::atomic<bool> wanted{false};
    std::atomic<bool> failed{false};
    HandOver<WorldState> states;
    std::mutex eyeMutex;
    std::atomic<bool> eyeMoved{false};
    std::optional<EyePosition> eye;  // as a reader last said
    std::vector<LayerSight> eyeSights;

    std::function<void()> heardOfRestart;
    Attachment attachment;  // last: detached first
};

SharedWorld::SharedWorld(Scene& scene) : SharedWorld(scene, Options()) {}
SharedWorld::SharedWorld(Scene& scene, Options options) : impl_(std::make_unique<Impl>(scene, std::move(options))) {
    impl_->attachment = scene.bus().attach(*impl_, impl_->options.delivery);
    impl_->attachment.poll();
}
SharedWorld::~SharedWorld() = default;

void SharedWorld::onRestart(std::function<void()> heard) {
    impl_->heardOfRestart = std::move(heard);
}

std::uint64_t SharedWorld::add(InstanceSubscriber& subscriber) {
    Impl& s = *impl_;
    if (!s.delivering) (void)update();  // a failure is kept
    s.entries.push_back({&subscriber, false, {}, ++s.added});
    ++s.moment;  // states handed over before lack it
    if (!s.delivering && failure().empty()) (void)s.outside([&] { return s.deliverViewer(); });
    return s.added;
}

void SharedWorld::remove(InstanceSubscriber& subscriber) {
    Impl& s = *impl_;
    for (Impl::Entry& entry : s.entries)
        if (entry.subscriber == &subscriber) entry.subscriber = nullptr;
    if (!s.delivering) std::erase_if(s.entries, [](const Impl::Entry& entry) { return !entry.subscriber; });
}

std::string SharedWorld::failure(const InstanceSubscriber& subscriber) const {
    for (const Impl::Entry& entry : impl_->entries)
        if (entry.subscriber == &subscriber) return entry.failure.empty() ? failure() : entry.failure;
    return {};
}

std::string SharedWorld::failure() const {
    if (!impl_->failure.empty()) return impl_->failure;
    return impl_->attachment.attached() ? std::string() : impl_->attachment.failure();
}

Result<> SharedWorld::update() {
    Impl& s = *impl_;
    if (s.delivering) return {};
    s.scene.seal();
    s.attachment.poll();
    if (const std::string why = failure(); !why.empty()) return fail("the scene could not be followed: " + why);
    if (s.takeEye()) return s.outside([&] { return s.deliverViewer(); });
    s.serve();
    return {};
}

Result<std::shared_ptr<const WorldState>> SharedWorld::latest(std::chrono::nanoseconds patience) const {
    using Clock = std::chrono::steady_clock;
    Impl& s = *impl_;
    const Clock::time_point end = Clock::now() + patience;
    // The state that is current while the caller waits does not count: a scene that asks for rays before each frame
    // hands a state over that this frame makes old at once, and then no reader would ever get the newest one.
    const std::uint64_t asked = s.current.load(std::memory_order_acquire);
    for (std::chrono::microseconds pause{50};; pause = std::min(2 * pause, std::chrono::microseconds(1000))) {
        std::shared_ptr<const WorldState> state = s.states.get();
        s.wanted.store(true, std::memory_order_relaxed);
        if (s.failed.load(std::memory_order_relaxed))
            return fail("the world follows its scene no longer; SharedWorld::failure() says why");
        if (state && state->moment >= asked) return state;
        if (s.refusedAt.load(std::memory_order_acquire) >= asked || Clock::now() >= end) {
            if (state) return state;
            return fail(
                "no state of the scene was handed over: its thread must run frames, or call SharedWorld::update(), and "
                "readers must let go of old states");
        }
        std::this_thread::sleep_for(pause);
    }
}

Result<std::shared_ptr<const WorldState>> SharedWorld::present() {
    Impl& s = *impl_;
    s.wanted.store(true, std::memory_order_relaxed);
    s.asIs = true;
    const Result<> updated = update();
    s.asIs = false;
    if (!updated) return std::unexpected(updated.error());
    auto state = s.states.get();
    if (!state || state->moment != s.moment) return fail("readers hold too many states of the scene");
    return state;
}

void SharedWorld::lookFrom(const EyePosition& eye, std::vector<LayerSight> sights) {
    const std::lock_guard lock(impl_->eyeMutex);
    if (impl_->eye == eye && impl_->eyeSights == sights) return;
    impl_->eye = eye;
    impl_->eyeSights = std::move(sights);
    impl_->eyeMoved.store(true, std::memory_order_relaxed);
}

Result<> SharedWorld::setViewer(std::optional<EyePosition> eye, std::vector<LayerSight> sights) {
    Impl& s = *impl_;
    // Edits that are not sealed yet come first: the flattener must not look at nodes of a state it does not know.
    if (!s.delivering)
        if (auto ok = update(); !ok) return ok;
    s.flattener.setViewer(eye, std::move(sights));
    if (const std::unique_lock lock(s.eyeMutex, std::try_to_lock); lock) s.eye.reset();
    if (s.delivering) return {};         // with the next one
    s.waits = s.flattener.usesPixels();  // pictures of others are not to move the content of this one
    const Result<> done = s.outside([&] { return s.deliverViewer(); });
    s.waits = false;
    return done;
}

void SharedWorld::setMeshSource(std::string_view type, MeshSource source) {
    Impl& s = *impl_;
    if (!s.delivering) (void)update();  // a failure is kept
    s.flattener.setMeshSource(s.scene, type, std::move(source));
    if (!s.delivering && failure().empty()) (void)s.outside([&] { return s.deliverViewer(); });
}

std::shared_ptr<void> SharedWorld::shared(const std::string& name, const std::function<std::shared_ptr<void>()>& make) {
    std::weak_ptr<void>& slot = impl_->common[name];
    std::shared_ptr<void> there = slot.lock();
    if (!there) slot = there = make();
    return there;
}

void SharedWorld::finishBackgroundWork() {
    if (!impl_->rays) return;
    (void)impl_->outside([&]() -> Result<> {
        impl_->rays->finishBackgroundWork();
        return {};
    });
}

Scene& SharedWorld::scene() const {
    return impl_->scene;
}
const Flattener& SharedWorld::flattener() const {
    return impl_->flattener;
}
const InstanceDelta& SharedWorld::delta() const {
    return *impl_->delta;
}
const SharedWorld::Times& SharedWorld::times() const {
    return impl_->times;
}

const RayWorld& SharedWorld::rays() {
    Impl& s = *impl_;
    if (s.rays) return *s.rays;
    if (!s.options.rays.nodes)
        s.options.rays.nodes = [&scene = s.scene](NodeId id) -> RayWorld::NamedNode {
            const Node* node = scene.find(id);
            if (!node) return {};
            const std::string_view name = scene.name(id);
            // Nodes without a name go by their number, so that each is reported.
            const std::string which = name.empty() ? "#" + std::to_string(id.value) : " " + std::string(name);
            return {node->type().name + which, scene.locationOf(id)};
        };
    s.rays = std::make_unique<RayWorld>(s.options.rays);
    if (failure().empty())
        (void)s.outside([&]() -> Result<> {
            s.rays->apply(s.flattener.snapshot());
            ++s.counts.commits;
            ++s.moment;
            s.serve();
            return {};
        });
    return *s.rays;
}

std::uint64_t SharedWorld::sequence() const {
    return impl_->delta ? impl_->delta->sequence : 0;
}

SharedWorld::Counts SharedWorld::counts() const {
    Counts counts = impl_->counts;
    counts.flatteners = Flattener::created();
    counts.rayWorlds = RayWorld::created();
    return counts;
}

Diagnostics SharedWorld::diagnostics() const {
    Diagnostics all = impl_->flattener.diagnostics();
    if (impl_->rays) all.append(impl_->rays->diagnostics());
    all.append(impl_->failures);
    if (const std::string why = failure(); !why.empty()) all.error({}, "the scene could not be followed: " + why);
    return all;
}

}  // namespace rtsg
