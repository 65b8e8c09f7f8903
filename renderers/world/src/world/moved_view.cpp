// Motion between two states, and the world at an instant between them.
#include "moved_view.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "ray_world_impl.h"

namespace rtsg {

namespace {

glm::dmat3 linearOf(const WorldFromLocal& m) {
    return {m[0], m[1], m[2]};
}

Vec3d applied(const WorldFromLocal& m, const Vec3d& p) {
    return m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3];
}

/// The rotation of a matrix of positive determinant that is nearest to it (Higham's iteration).
glm::dmat3 rotationPart(const glm::dmat3& m) {
    constexpr int kMax = 64;
    glm::dmat3 rotation = m;
    for (int i = 0; i < kMax; ++i) {
        const glm::dmat3 next = .5 * (rotation + glm::transpose(glm::inverse(rotation)));
        double change = 0;
        for (int k = 0; k < 3; ++k) change += glm::length(next[k] - rotation[k]);
        rotation = next;
        if (change < 1e-15) break;
    }
    return rotation;
}

}  // namespace

// ---- one thing's way ----------------------------------------------------------------------------------------------

Course::Course(const WorldFromLocal& from, const WorldFromLocal& to, const Vec3d& pivot)
    : from_(from),
      to_(to),
      pivot_(pivot),
      pivotFrom_(applied(from, pivot)),
      pivotTo_(applied(to, pivot)),
      linearFrom_(linearOf(from)) {
    // Both of one handedness and neither flat: then there is a change from one to the other that turns and stretches.
    if (determinantSign(from) * determinantSign(to) <= 0) return;
    const glm::dmat3 change = linearOf(to) * glm::inverse(linearFrom_), rotation = rotationPart(change);
    rotation_ = glm::normalize(glm::quat_cast(rotation));
    stretch_ = glm::transpose(rotation) * change;
    rotates_ =
        std::isfinite(glm::dot(rotation_, rotation_)) && isFinite({stretch_[0], stretch_[1], stretch_[2], Vec3d(0)});
}

WorldFromLocal Course::at(double t) const {
    if (!rotates_) {
        WorldFromLocal m;
        for (int i = 0; i < 4; ++i) m[i] = glm::mix(from_[i], to_[i], t);
        return m;
    }
    glm::dmat3 stretch;
    for (int i = 0; i < 3; ++i) {
        Vec3d unit(0);
        unit[i] = 1;
        stretch[i] = glm::mix(unit, stretch_[i], t);
    }
    const glm::dmat3 linear = glm::mat3_cast(glm::slerp(glm::dquat(1, 0, 0, 0), rotation_, t)) * stretch * linearFrom_;
    return {linear[0], linear[1], linear[2], glm::mix(pivotFrom_, pivotTo_, t) - linear * pivot_};
}

// ---- what moves ---------------------------------------------------------------------------------------------------

bool wasThere(const RayView& before, const RayInstance& now) {
    const std::uint32_t slot = now.info.id.slot;
    return now.info.id && slot < before.instances().size() && before.instance(slot).info.id == now.info.id;
}

Motions::Motions(const RayView& before, const RayView& now) {
    const RayInstances &then = before.instances(), &all = now.instances();
    std::vector<std::uint32_t> moved;
    for (std::size_t first = 0; first < all.size(); first += RayInstances::kPerPage) {
        if (first < then.size() && &then[first] == &all[first]) continue;  // nobody has written to this page
        for (std::size_t slot = first; slot < std::min(all.size(), first + RayInstances::kPerPage); ++slot) {
            const RayInstance& instance = all[slot];
            if (!instance.mesh || instance.mesh->strokeCount > 0 || instance.info.volume) continue;
            if (!wasThere(before, instance)) continue;
            const WorldFromLocal& from = then[slot].info.worldFromLocal;
            if (from != instance.info.worldFromLocal && isFinite(from))
                moved.push_back(static_cast<std::uint32_t>(slot));
        }
    }
    const bvh::TopView& top = now.tables_->top;
    std::map<std::uint32_t, std::size_t> numbers;  // objects' places in objects_
    for (const std::uint32_t slot : moved) {
        const std::uint32_t number = top.ownerOf(slot);
        if (number == bvh::TreeView::kNone || top.objectOf(number).resting) continue;
        if (!numbers.try_emplace(number, objects_.size()).second) continue;
        const Instance& info = all[slot].info;
        objects_.push_back({number,
                            {slot},
                            Course(then[slot].info.worldFromLocal, info.worldFromLocal, Vec3d(info.pivot)),
                            inverse(info.worldFromLocal)});
    }
    if (objects_.empty()) return;
    moves_.resize(all.size());
    for (std::uint32_t slot = 0; slot < all.size(); ++slot) {
        const RayInstance& instance = all[slot];
        if (!instance.mesh || instance.mesh->strokeCount > 0) continue;
        const auto found = numbers.find(top.ownerOf(slot));
        if (found == numbers.end()) continue;
        moves_[slot] = true;
        if (std::vector<std::uint32_t>& slots = objects_[found->second].slots; slots.front() != slot)
            slots.push_back(slot);
    }
    std::ranges::sort(objects_, {}, &Object::number);
    leaves_ = bvh::leavesOf(top);
}

// ---- the world on its way -----------------------------------------------------------------------------------------

MovedView::MovedView(const RayView& now, const Motions& motions, double t) : RayView(now) {
    ownTables_.strokes = now.tables_->strokes;
    ownTables_.volumes = now.tables_->volumes;
    ownTables_.proxies = now.tables_->proxies;
    constexpr std::size_t kPerPage = RayInstances::kPerPage;
    for (std::size_t first = 0; first < instances_.size(); first += kPerPage) pages_.push_back(&instances_[first]);
    std::map<std::size_t, RayInstance*> written;
    const auto write = [&](std::uint32_t slot) -> RayInstance& {
        RayInstance*& page = written[slot / kPerPage];
        if (!page) {
            own_.push_back(std::make_unique<RayInstance[]>(kPerPage));
            page = own_.back().get();
            std::copy_n(pages_[slot / kPerPage], kPerPage, page);
            pages_[slot / kPerPage] = page;
        }
        return page[slot % kPerPage];
    };
    std::vector<bvh::MovedTop::Move> moves;
    for (const Motions::Object& object : motions.objects_) {
        const WorldFromLocal first = object.course.at(t), change = compose(first, object.firstFromWorld);
        const bvh::TopObject& rests = now.tables_->top.objectOf(object.number);
        const auto as = moved(rests, change, first);
        if (!as) continue;  // half way through a mirror it is flat: nothing of it is seen there that could be told
        moves.push_back({object.number, as->first, as->second});
        for (const std::uint32_t slot : object.slots) {
            RayInstance& instance = write(slot);
            const WorldFromLocal m =
                slot == object.slots.front() ? first : compose(change, instance.info.worldFromLocal);
            setTransform(instance, m, origin_);
            instance.errorFloor *= 2;  // of a body: its frame was rounded once more
        }
    }
    top_ = std::make_unique<bvh::MovedTop>(now.tables_->top, motions.leaves_, moves);
    ownTables_.top = top_->view();
    tables_ = &ownTables_;
    instances_ = {pages_.data(), instances_.size()};
}

/// The object after all of it has gone through `change` of the world, and its box; nothing if no ray could be taken
/// into its frame. `first` is where an instance is then.
std::optional<std::pair<bvh::TopObject, bvh::InstanceTree::Box>> MovedView::moved(const bvh::TopObject& now,
                                                                                  const WorldFromLocal& change,
                                                                                  const WorldFromLocal& first) const {
    bvh::TopObject as = now;
    WorldFromLocal rayFromObject = first;
    if (!isFinite(first) || !isFinite(change) || !canEnter(first) || !canEnter(change)) return std::nullopt;
    if (!now.slots) {
        rayFromObject[3] -= origin_;
        as.setTransform(rayFromObject);
    } else {
        const glm::dmat3 linear(change[0], change[1], change[2]);
        as.localFromRay = glm::mat3(glm::dmat3(now.localFromRay) * glm::inverse(linear));
        as.translation = Vec3f(linear * (Vec3d(now.translation) + origin_) + change[3] - origin_);
        as.normalFromGroup = normalMatrix(change) * now.normalFromGroup;
        const glm::dmat3 back = glm::inverse(glm::dmat3(as.localFromRay));
        rayFromObject = {back[0], back[1], back[2], Vec3d(as.translation)};
    }
    const bvh::InstanceTree::Box local = bvh::localBox(now);
    if (!(local.lower.x <= local.upper.x)) return std::pair(as, bvh::InstanceTree::Box{as.translation, as.translation});
    Bounds bounds;
    bounds.min = local.lower, bounds.max = local.upper;
    DoubleBox box = transformed(bounds, rayFromObject);
    box.half *= 1 + 0x1p-18;  // a body's frame, taken back from what rays need of it, is not exact
    if (!box.inReach()) return std::nullopt;
    return std::pair(as, floatBox(box));
}

}  // namespace rtsg
