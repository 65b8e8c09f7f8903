// Groups of routes by field, and parents beyond the first.
#include "node_links.h"

#include <utility>

namespace rtsg {

RouteGroup& RouteGroups::add(FieldIndex field) {
    if (count_ == room_) {
        auto more = std::make_unique<RouteGroup[]>(2 * std::size_t{room_});
        std::move(begin(), end(), more.get());
        more_ = std::move(more);
        first_ = more_.get();
        room_ *= 2;
    }
    RouteGroup& group = first_[count_++];
    group.field = field;
    return group;
}

void RouteGroups::erase(RouteGroup* group) {
    std::move(group + 1, end(), group);
    first_[--count_] = RouteGroup();
}

void ParentList::add(ParentRef parent) {
    if (!many_ && few_.size() < kFew) {
        few_.push_back(parent);
        return;
    }
    if (!many_) many_ = std::make_unique<Counts>();
    for (const ParentRef& p : few_) ++(*many_)[key(p)];
    few_.clear();
    ++(*many_)[key(parent)];
}

bool ParentList::remove(ParentRef parent) {
    if (!many_) {
        const auto found = std::ranges::find(few_, parent);
        if (found == few_.end()) return false;
        *found = few_.back();
        few_.pop_back();
        return true;
    }
    const auto found = many_->find(key(parent));
    if (found == many_->end()) return false;
    if (--found->second == 0) many_->erase(found);
    if (many_->empty()) many_.reset();
    return true;
}

ParentRef ParentList::takeAny() {
    const ParentRef parent = !many_ ? few_.back() : fromKey(many_->begin()->first);
    remove(parent);
    return parent;
}

void ParentList::appendTo(std::vector<ParentRef>& out) const {
    out.insert(out.end(), few_.begin(), few_.end());
    if (!many_) return;
    for (const auto& [k, count] : *many_) out.insert(out.end(), count, fromKey(k));
}

}  // namespace rtsg
