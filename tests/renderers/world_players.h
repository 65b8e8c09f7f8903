// A world of instances in rigid groups that is edited at random, with the truth beside it.
#pragma once

#include <array>

#include "renderers/ray_support.h"

namespace rtsg::test {

/// Instances in rigid groups, edited at random; the truth beside them.
class Players {
  public:
    Players(std::uint32_t seed, const RayWorld::Options& options) : random_(seed), world_(options) {
        for (std::uint32_t node = 1; node <= kMeshes; ++node) {
            meshes_[node] = node % 3 == 0 ? makeSphere(1) : makeSoup(random_, 5 + static_cast<int>(pick(60)));
            next_.geometries.push_back({NodeId{node}, meshes_[node]});
        }
        for (std::uint32_t slot = 0; slot < kSlots; ++slot) free_.push_back(kSlots - 1 - slot);
        for (WorldFromLocal& frame : frames_) frame = randomTransform(random_, 10);
        while (truth_.items.size() < 60) add();
        apply();
    }

    void step() {
        switch (pick(12)) {
            case 0:
                for (unsigned n = pick(30); n > 0; --n) add();
                break;
            case 1:
                removeSome(pick(4) == 0 ? 3 : 20);
                break;
            case 2:
            case 3:
            case 4:
                moveGroup(pick(kGroups), 1);  // all of it
                break;
            case 5:
                moveGroup(pick(kGroups), 2);  // half of it
                break;
            case 6:
                moveOne();
                break;
            case 7:
                rebindSome();
                break;
            case 8:
                deform();
                break;
            case 9:
                collapse(pick(kGroups));
                break;
            default:
                break;  // rests
        }
        apply();
        for (std::size_t n = pick(3) ? 0 : pick(30); n > 0; --n) world_.apply({});
        if (pick(3) == 0) world_.finishBackgroundWork();
    }
    void compare(int packets) { compare(world_, truth_, random_, packets); }
    /// Some lie tens of metres out, seen along grazing rays.
    static void compare(const RayView& world, const BruteForce& truth, std::mt19937& random, int packets) {
        expectSameHits(world, truth, random, packets, 14, 1e-3);
    }
    RayWorld& world() { return world_; }
    const BruteForce& truth() const { return truth_; }
    std::mt19937& random() { return random_; }

  private:
    static constexpr std::uint32_t kMeshes = 12, kSlots = 160, kGroups = 6;

    std::uint32_t pick(std::size_t n) { return static_cast<std::uint32_t>(random_() % n); }
    void apply() {
        for (auto& [slot, item] : truth_.items) item.mesh = meshes_[item.info.geometry.value];
        world_.apply(next_);
        next_ = {};
    }
    void add() {
        if (free_.size() < 20) return;
        const std::uint32_t slot = free_.back();
        free_.pop_back();
        Instance instance = makeInstance(slot, NodeId{1 + pick(kMeshes)}, identityTransform(), generations_[slot]);
        instance.rigid = pick(kGroups);  // 0: none
        instance.motion = pick(2) ? Motion::moving : Motion::unknown;
        offsets_[slot] = randomTransform(random_, 3);
        instance.worldFromLocal = compose(frames_[instance.rigid], offsets_[slot]);
        truth_.items[slot].info = instance;
        next_.added.push_back(instance);
    }
    void removeSome(std::uint32_t oneIn) {
        for (auto at = truth_.items.begin(); at != truth_.items.end();) {
            if (pick(oneIn) != 0) {
                ++at;
                continue;
            }
            next_.removed.push_back(at->second.info.id);
            ++generations_[at->first];
            free_.insert(free_.begin(), at->first);
            at = truth_.items.erase(at);
        }
    }
    void putInstance(std::uint32_t slot) {
        Instance& info = truth_.items.at(slot).info;
        info.worldFromLocal = compose(frames_[info.rigid], offsets_[slot]);
        next_.moved.push_back({info.id, info.worldFromLocal});
    }
    void moveGroup(std::uint32_t group, std::uint32_t oneIn) {
        frames_[group] = randomTransform(random_, 10);
        for (const auto& [slot, item] : truth_.items) {
            if (item.info.rigid != group) continue;
            if (pick(oneIn) != 0) {
                // Stays where it is: the group is not as rigid as it was said to be.
                offsets_[slot] = compose(inverseOf(frames_[group]), item.info.worldFromLocal);
                continue;
            }
            putInstance(slot);
        }
    }
    void moveOne() {
        if (truth_.items.empty()) return;
        auto at = truth_.items.begin();
        std::advance(at, pick(truth_.items.size()));
        offsets_[at->first] = randomTransform(random_, 3);
        putInstance(at->first);
    }
    /// To a plane and back within two steps, as an animated scale may.
    void collapse(std::uint32_t group) {
        const WorldFromLocal before = frames_[group];
        frames_[group][1] = Vec3d(0);
        for (const auto& [slot, item] : truth_.items)
            if (item.info.rigid == group) putInstance(slot);
        apply();
        frames_[group] = before;
        for (const auto& [slot, item] : truth_.items)
            if (item.info.rigid == group) putInstance(slot);
    }
    void rebindSome() {
        for (auto& [slot, item] : truth_.items) {
            if (pick(10) != 0) continue;
            if (pick(2)) item.info.motion = pick(2) ? Motion::moving : Motion::unknown;
            if (pick(4) == 0) item.info.geometry = NodeId{1 + pick(kMeshes)};
            if (pick(2)) {
                item.info.rigid = pick(kGroups);
                offsets_[slot] = compose(inverseOf(frames_[item.info.rigid]), item.info.worldFromLocal);
            }
            next_.rebound.push_back(item.info);
        }
    }
    void deform() {
        const std::uint32_t node = 1 + pick(kMeshes);
        auto bent = std::make_shared<Mesh>(*meshes_[node]);
        bent->bounds = {};
        Vec3f* p = bent->positions.mutableData();
        for (std::size_t i = 0; i < bent->positions.size(); ++i) {
            p[i].x += .3f * std::sin(3 * p[i].y);
            bent->bounds.extend(p[i]);
        }
        meshes_[node] = bent;
        next_.geometries.push_back({NodeId{node}, bent});
    }
    static WorldFromLocal inverseOf(const WorldFromLocal& m) {
        const glm::dmat3 linear = glm::inverse(glm::dmat3(m[0], m[1], m[2]));
        return {linear[0], linear[1], linear[2], -(linear * m[3])};
    }

    std::mt19937 random_;
    RayWorld world_;
    BruteForce truth_;
    InstanceDelta next_;
    std::map<std::uint32_t, std::shared_ptr<Mesh>> meshes_;
    std::array<WorldFromLocal, kGroups> frames_;
    std::array<WorldFromLocal, kSlots> offsets_;
    std::array<std::uint32_t, kSlots> generations_{};
    std::vector<std::uint32_t> free_;
};

}  // namespace rtsg::test
