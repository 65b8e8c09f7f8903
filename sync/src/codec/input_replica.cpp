// Runs a scene from the inputs of its frames, and applies changes where a frame cannot be run.
#include <rtsg/sync/input_replica.h>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>

namespace rtsg {

InputReplica::InputReplica(Scene& scene, ChangeDecoder* states) : scene_(scene), states_(states) {
    scene.setBehavioursEnabled(true);
}

/// The hash of the scene's state, as the stream's writer counts it.
Hash128 InputReplica::hashAtWriter() const {
    const std::optional<Hash128> origins = states_ ? states_->originHash() : std::nullopt;
    return origins.value_or(scene_.hash());
}

bool InputReplica::lost(std::string why) {
    exact_ = false;
    why_ = std::move(why);
    return false;
}

Result<bool> InputReplica::take(std::shared_ptr<const ChangeSet> set) {
    const FrameInput* input = set->input.get();
    Result<bool> done = true;
    if (input && input->complete && (exact_ || !set->isSnapshot())) {
        done = run(*set);
    } else if (set->from != set->to || set->isSnapshot()) {
        done = applyChanges(set);
    } else if (!input || !input->runState || scene_.sequence() != set->to || hashAtWriter() != set->hash) {
        // The run state belongs to another state than the scene's, so it is useless.
        return lost(fmt::format("the run state of state {} does not belong to the scene's", set->to));
    } else if (auto resumed = scene_.resumeFrom(*input->runState); !resumed) {
        return lost(resumed.error().text);
    } else {
        exact_ = true;
        why_.clear();
    }
    if (!done) lost(done.error().text);
    return done;
}

Result<bool> InputReplica::run(const ChangeSet& set) {
    if (!exact_) return why_.empty() ? lost("an input, but no run state before it") : false;
    if (set.from != scene_.sequence())
        return lost(fmt::format("an input from {} does not follow state {}", set.from, scene_.sequence()));
    const auto own = scene_.runInput(*set.input, set.time);
    if (!own) return std::unexpected(own.error());
    if (states_ && *own) states_->countRun(**own);
    const Hash128 hash = hashAtWriter();
    const std::uint64_t reached = scene_.sequence();
    if (reached == set.to && hash == set.hash) {
        ++statistics_.run;
        return true;
    }
    ++statistics_.divergences;
    return lost(fmt::format("state {} came out with hash {}, state {} of the origin has {}", reached, hash.hex(),
                            set.to, set.hash.hex()));
}

Result<bool> InputReplica::applyChanges(std::shared_ptr<const ChangeSet> set) {
    exact_ = false;
    if (set->isSnapshot() && scene_.sequence() != 0)
        if (auto ok = scene_.reset(); !ok) return std::unexpected(ok.error());
    if (auto ok = scene_.apply(set); !ok) return std::unexpected(ok.error());
    ++statistics_.applied;
    // The writer's hash is no part of such a set. It is compared with the run state, which follows.
    const bool unknown = states_ && states_->originHash();
    if (!unknown && scene_.hash() != set->hash) {
        ++statistics_.divergences;
        return lost(fmt::format("state {} has another hash than the origin's", set->to));
    }
    why_.clear();
    exact_ = set->input && set->input->runState;  // else the run state is still to come
    return true;
}

}  // namespace rtsg
