// The objects that are traced, and the tree over them.
#include "top.h"

#include <utility>

namespace rtsg::bvh {

void TopObject::setTransform(const WorldFromLocal& m) {
    localFromRay = glm::mat3(glm::inverse(glm::dmat3(m[0], m[1], m[2])));
    translation = Vec3f(m[3]);
}

void Top::setCuts(TopObject& object, const LongTriangles* const* cuts) {
    cutObjects_ += (cuts != nullptr) - (object.cuts != nullptr);
    object.cuts = cuts;
}

std::uint32_t Top::newObject() {
    std::uint32_t object;
    if (free_.empty()) {
        object = static_cast<std::uint32_t>(objects_.size());
        objects_.grow(object + std::size_t{1});
    } else {
        object = free_.back();
        free_.pop_back();
    }
    objects_.write(object) = {};
    return object;
}

void Top::setInstance(std::uint32_t object, std::uint32_t slot, const MeshBvh& mesh, const WorldFromLocal& rayFromLocal,
                      const InstanceTree::Box& box, std::uint32_t kinds) {
    TopObject& o = objects_.write(object);
    o.setTransform(rayFromLocal);
    o.scene = mesh.scene();
    setCuts(o, mesh.cuts());
    o.slot = slot;
    o.mask = Versions::inAllEpochs(kinds);
    tree_.set(object, box);
}

void Top::move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const InstanceTree::Box& box) {
    objects_.write(object).setTransform(rayFromLocal);
    tree_.set(object, box);
}

void Top::setNormals(std::uint32_t object, const glm::mat3& normalFromGroup) {
    objects_.write(object).normalFromGroup = normalFromGroup;
}

void Top::changeMesh(std::uint32_t object, const MeshBvh& mesh, const InstanceTree::Box& box) {
    TopObject& o = objects_.write(object);
    o.scene = mesh.scene();
    setCuts(o, mesh.cuts());
    tree_.set(object, box);
}

void Top::setKinds(std::uint32_t object, std::uint32_t kinds) {
    objects_.write(object).mask = Versions::inAllEpochs(kinds);
}

void Top::setGroup(std::uint32_t object, const Group& group) {
    if (!objects_[object].resting) resting_.push_back(object);
    objects_.write(object).resting = &group;
    updateGroup(object);
}

void Top::setBody(std::uint32_t object, const Group& group, const WorldFromLocal& rayFromGroup,
                  const InstanceTree::Box& box) {
    TopObject& o = objects_.write(object);
    o.setTransform(rayFromGroup);
    o.scene = group.scene();
    o.slots = group.slots();
    setCuts(o, group.hasCuts() ? group.cuts() : nullptr);
    tree_.set(object, box);
}

void Top::setOwner(std::uint32_t slot, std::uint32_t object) {
    owners_.grow(slot + std::size_t{1});
    owners_.write(slot) = object;
}

namespace {

bool isVisible(const Group& group) {
    return group.live() > group.hidden() && group.box().lower.x <= group.box().upper.x;
}

}  // namespace

void Top::updateGroup(std::uint32_t object) {
    TopObject& o = objects_.write(object);
    const Group& group = *o.resting;
    o.scene = group.scene();
    o.slots = group.slots();
    setCuts(o, group.hasCuts() ? group.cuts() : nullptr);
    if (object == mainObject_) return;
    if (isVisible(group))
        tree_.set(object, group.box());
    else
        tree_.remove(object);
}

void Top::remove(std::uint32_t object) {
    if (objects_[object].resting) std::erase(resting_, object);
    if (object == mainObject_) mainObject_ = InstanceTree::kNone;
    tree_.remove(object);
    setCuts(objects_.write(object), nullptr);
    objects_.write(object) = {};
    free_.push_back(object);
}

void Top::chooseMain() {
    std::uint32_t best = InstanceTree::kNone;
    std::size_t maximum = 0;
    for (const std::uint32_t object : resting_) {
        const Group& group = *objects_[object].resting;
        const std::size_t triangles = group.triangles() - group.hiddenTriangles();
        // One that is main already stays so until another is much larger.
        const std::size_t weight = object == mainObject_ ? 2 * triangles : triangles;
        if (isVisible(group) && weight > maximum) maximum = weight, best = object;
    }
    if (best == mainObject_) return;
    const std::uint32_t before = std::exchange(mainObject_, best);
    if (before != InstanceTree::kNone) updateGroup(before);
    if (best != InstanceTree::kNone) tree_.remove(best);
}

void Top::commit() {
    chooseMain();
    tree_.commit();
    view_.tree_ = tree_;
    view_.objects_ = objects_.pages();
    view_.owners_ = owners_.pages();
    view_.main_ = mainObject_ == InstanceTree::kNone ? nullptr : &objects_[mainObject_];
    view_.mainObject_ = mainObject_;
    InstanceTree::Box box = tree_.bounds();
    if (view_.main_) box.extend(view_.main_->resting->box());
    view_.setSize(box);
    view_.hasCuts_ = cutObjects_ > 0;
    view_.maskShift_ = versions_ ? versions_->maskShift() : 0;
}

TopView Top::freeze(Pages& pages) const {
    TopView frozen = view_;
    frozen.tree_ = tree_.freeze(pages.nodes);
    objects_.freezeInto(pages.objects);
    owners_.freezeInto(pages.owners);
    frozen.objects_ = pages.objects.data();
    frozen.owners_ = pages.owners.data();
    return frozen;
}

void Top::sweep() {
    tree_.sweep();
    objects_.sweep();
    owners_.sweep();
}

}  // namespace rtsg::bvh
