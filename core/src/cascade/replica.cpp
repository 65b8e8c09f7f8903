// A separate scene for another thread, which polls the original's bus.
#include <rtsg/core/replica.h>

#include <array>

namespace rtsg {

struct Replica::Follower final : Subscriber {
    std::unique_ptr<Scene> scene;  // made by the thread that will own it
    std::array<std::shared_ptr<ChangeSet>, 2> sets;
    std::size_t last = 0;

    Scene& own() {
        if (!scene) {
            scene = std::make_unique<Scene>();
            scene->setBehavioursEnabled(false);
        }
        return *scene;
    }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        if (changes.isSnapshot() && own().sequence() != 0)
            if (auto ok = own().reset(); !ok) return ok;
        // Its subscribers may keep a set for a while: the memory of the one before it is used again.
        std::shared_ptr<ChangeSet>& set = sets[last ^= 1];
        if (!set || set.use_count() > 1) set = std::make_shared<ChangeSet>();
        *set = changes;
        const Result<> applied = own().apply(set);
        if (changes.isSnapshot()) set.reset();  // frames take less
        return applied;
    }
    std::string subscriberName() const override { return "replica"; }
};

Replica::Replica(Scene& origin)
    : follower_(std::make_unique<Follower>()), attachment_(origin.bus().attach(*follower_, Delivery::polled)) {}
Replica::~Replica() = default;

Scene& Replica::scene() {
    return follower_->own();
}
bool Replica::poll() {
    return attachment_.poll();
}
std::size_t Replica::drain() {
    return attachment_.drain();
}
bool Replica::attached() const {
    return attachment_.attached();
}
std::string Replica::failure() const {
    return attachment_.failure();
}

}  // namespace rtsg
