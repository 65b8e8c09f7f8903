// Keeps the list of lines and points.
#include "strokes.h"

#include <utility>

namespace rtsg::bvh {

namespace {

void setTransform(StrokeObject& o, const WorldFromLocal& m) {
    o.rayFromLocal = glm::mat4x3(m);
    o.localFromRay = glm::mat3(glm::inverse(glm::dmat3(m[0], m[1], m[2])));
    o.rowLengths = rowLengths(o.localFromRay);
}

}  // namespace

std::uint32_t Strokes::add(std::uint32_t slot, std::shared_ptr<const StrokeBvh> bvh, bool isPoints,
                           std::shared_ptr<const StrokeStyle> style, const WorldFromLocal& rayFromLocal,
                           const TreeView::Box& box, std::uint32_t kinds) {
    std::uint32_t object;
    if (free_.empty()) {
        object = static_cast<std::uint32_t>(objects_.size());
        objects_.grow(object + std::size_t{1});
    } else {
        object = free_.back();
        free_.pop_back();
    }
    StrokeObject& o = objects_.write(object);
    o = {};
    o.bvh = std::move(bvh);
    setTransform(o, rayFromLocal);
    o.kinds = kinds, o.slot = slot, o.isPoints = isPoints;
    if (style) {
        const float points = style->attenuated() ? style->maximum : style->pointSize;
        o.halfWidth = .5f * (isPoints ? points : style->lineWidth);
    }
    o.style = std::move(style);
    widest_ = std::max(widest_, o.reach());
    tree_.set(object, box);
    changed_ = true;
    return object;
}

void Strokes::move(std::uint32_t object, const WorldFromLocal& rayFromLocal, const TreeView::Box& box) {
    setTransform(objects_.write(object), rayFromLocal);
    tree_.set(object, box);
    changed_ = true;
}

void Strokes::setKinds(std::uint32_t object, std::uint32_t kinds) {
    objects_.write(object).kinds = kinds;
    changed_ = true;
}

void Strokes::remove(std::uint32_t object) {
    objects_.write(object) = {};
    free_.push_back(object);
    tree_.remove(object);
    changed_ = true;
}

void Strokes::commit() {
    if (!std::exchange(changed_, false)) return;
    tree_.commit();
    if (tree_.empty()) widest_ = 0;
    view_.tree_ = tree_;
    view_.objects_ = objects_.pages();
    view_.widest_ = widest_;
    view_.box_ = tree_.bounds();
}

StrokeView Strokes::freeze(Pages& pages) const {
    StrokeView frozen = view_;
    if (frozen.empty()) return frozen;
    frozen.tree_ = tree_.freeze(pages.nodes);
    objects_.freezeInto(pages.objects);
    frozen.objects_ = pages.objects.data();
    return frozen;
}

void Strokes::sweep() {
    tree_.sweep();
    objects_.sweep();
}

std::size_t Strokes::bytes() const {
    std::size_t bytes = tree_.bytes() + objects_.bytes();
    for (std::size_t i = 0; i < objects_.size(); ++i)
        if (objects_[i].bvh) bytes += objects_[i].bvh->bytes();
    return bytes;
}

}  // namespace rtsg::bvh
