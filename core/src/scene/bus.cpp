#include <rtsg/core/bus.h>

#include <algorithm>
#include <exception>
#include <mutex>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

namespace {

/// A cursor's backlog is merged when it grows beyond this many sets.
constexpr std::size_t kBacklog = 256;

}  // namespace

struct Attachment::Cursor {
    Subscriber* subscriber = nullptr;
    const Scene* scene = nullptr;
    Delivery delivery = Delivery::immediate;

    std::mutex mutex;  // guards everything below
    bool attached = true;
    std::string failure;
    std::uint64_t seen = 0;
    bool restarted = false;  // the next set counts whatever its number
    using Sets = std::vector<std::shared_ptr<const ChangeSet>>;
    Sets backlog;

    // The polling thread's own: memory that is used again with every poll.
    Sets taken;
    ChangeComposer composer;
    ChangeSet merged;

    /// Whatever the subscriber does, nothing is thrown across the bus.
    Result<> call(const ChangeSet& set) {
        try {
            return subscriber->apply(*scene, set);
        } catch (const std::exception& e) {
            return fail(e.what());
        } catch (...) {
            return fail("unknown exception");
        }
    }
    bool deliver(const ChangeSet& set) {
        const Result<> result = call(set);
        const std::scoped_lock lock(mutex);
        seen = set.to;
        if (result) return true;
        attached = false;
        failure = result.error().text;
        backlog.clear();
        return false;
    }
    /// Give it back with putBack: a subscriber may poll from within its own apply.
    Sets takeBacklog() {
        Sets sets = std::move(taken);
        sets.clear();
        const std::scoped_lock lock(mutex);
        if (attached) sets.swap(backlog);
        return sets;
    }
    void putBack(Sets sets) {
        sets.clear();
        taken = std::move(sets);
    }
};

struct Bus::State {
    Scene* scene = nullptr;
    std::vector<std::shared_ptr<Attachment::Cursor>> cursors;
    std::function<void(const Diagnostic&)> reporter;
};

Bus::Bus(Scene& scene) : state_(std::make_shared<State>()) {
    state_->scene = &scene;
}

Bus::~Bus() {
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        cursor->attached = false;
    }
}

Attachment Bus::attach(Subscriber& subscriber, Delivery delivery) {
    auto cursor = std::make_shared<Attachment::Cursor>();
    cursor->subscriber = &subscriber;
    cursor->scene = state_->scene;
    cursor->delivery = delivery;
    state_->scene->seal();  // pending edits would otherwise come twice: in the snapshot and in the next set
    auto snapshot = std::make_shared<const ChangeSet>(state_->scene->snapshot());
    Attachment attachment;
    attachment.cursor_ = cursor;
    if (delivery == Delivery::polled)
        cursor->backlog.push_back(std::move(snapshot));
    else if (!cursor->deliver(*snapshot)) {
        if (state_->reporter)
            state_->reporter({Severity::error, subscriber.subscriberName(), {}, "detached: " + cursor->failure});
        return attachment;
    }
    state_->cursors.push_back(std::move(cursor));
    return attachment;
}

void Bus::publish(std::shared_ptr<const ChangeSet> set) {
    // By index: a subscriber may attach or detach others while it runs; who attaches has this state already.
    bool anyGone = false;
    const std::size_t count = state_->cursors.size();
    for (std::size_t i = 0; i < std::min(count, state_->cursors.size()); ++i) {
        const auto cursor = state_->cursors[i];
        {
            const std::scoped_lock lock(cursor->mutex);
            if (!cursor->attached) {
                anyGone = true;
                continue;
            }
            const std::uint64_t have = cursor->backlog.empty() ? cursor->seen : cursor->backlog.back()->to;
            // A set that leads to the state it starts from puts right what had gone wrong in it.
            const bool repairs = set->from == set->to && have == set->to && have != 0;
            if (have >= set->to && !repairs && !cursor->restarted) continue;
            cursor->restarted = false;
            if (cursor->delivery == Delivery::polled) {
                cursor->backlog.push_back(set);
                if (cursor->backlog.size() > kBacklog) {
                    ChangeComposer composer;
                    for (const auto& waiting : cursor->backlog) composer.add(*waiting);
                    cursor->backlog.assign(1, std::make_shared<const ChangeSet>(composer.take()));
                }
                continue;
            }
        }
        if (!cursor->deliver(*set)) {
            anyGone = true;
            if (state_->reporter)
                state_->reporter(
                    {Severity::error, cursor->subscriber->subscriberName(), {}, "detached: " + cursor->failure});
        }
    }
    if (anyGone)
        std::erase_if(state_->cursors, [](const auto& cursor) {
            const std::scoped_lock lock(cursor->mutex);
            return !cursor->attached;
        });
}

void Bus::restart() {
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        cursor->seen = 0;
        cursor->restarted = true;
        cursor->backlog.clear();
    }
}

void Bus::setReporter(std::function<void(const Diagnostic&)> reporter) {
    state_->reporter = std::move(reporter);
}

std::size_t Bus::subscribers() const {
    std::size_t count = 0;
    for (const auto& cursor : state_->cursors) {
        const std::scoped_lock lock(cursor->mutex);
        count += cursor->attached ? 1 : 0;
    }
    return count;
}

Attachment::Attachment(Attachment&&) noexcept = default;
Attachment& Attachment::operator=(Attachment&& other) noexcept {
    if (this != &other) {
        detach();
        cursor_ = std::move(other.cursor_);
    }
    return *this;
}
Attachment::~Attachment() {
    detach();
}

void Attachment::detach() {
    if (!cursor_) return;
    const std::scoped_lock lock(cursor_->mutex);
    cursor_->attached = false;
    cursor_->backlog.clear();
}

bool Attachment::poll() {
    if (!cursor_) return false;
    const auto cursor = cursor_;  // a subscriber may detach itself
    auto sets = cursor->takeBacklog();
    const bool any = !sets.empty();
    if (sets.size() == 1) {
        cursor->deliver(*sets.front());
    } else if (any) {
        for (const auto& set : sets) cursor->composer.add(*set);
        ChangeSet merged = std::move(cursor->merged);
        cursor->composer.take(merged);
        sets.clear();  // what they hold can go back to the scene's pool
        cursor->deliver(merged);
        merged.clear();
        cursor->merged = std::move(merged);
    }
    cursor->putBack(std::move(sets));
    return any;
}

std::size_t Attachment::drain() {
    if (!cursor_) return 0;
    const auto cursor = cursor_;
    auto sets = cursor->takeBacklog();
    std::size_t count = 0;
    for (const auto& set : sets) {
        ++count;
        if (!cursor->deliver(*set)) break;
    }
    cursor->putBack(std::move(sets));
    return count;
}

std::uint64_t Attachment::sequence() const {
    if (!cursor_) return 0;
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->seen;
}

bool Attachment::attached() const {
    if (!cursor_) return false;
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->attached;
}

std::string Attachment::failure() const {
    if (!cursor_) return {};
    const std::scoped_lock lock(cursor_->mutex);
    return cursor_->failure;
}

}  // namespace rtsg
