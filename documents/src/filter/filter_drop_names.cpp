// Leaves out the DEFs that no USE, ROUTE, IMPORT or EXPORT names.
#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class DropNames final : public TreeFilter {
  public:
    using TreeFilter::TreeFilter;

    void change() override {
        for (const Index scope : scopes()) {
            const auto uses = usesIn(scope);
            walk(
                scope,
                [&](Index index) {
                    Item& item = (*this)[index];
                    if (item.kind == Kind::node && !uses.contains(item.def)) item.def.clear();
                    return item.kind != Kind::body || index == scope;
                },
                [](Index) {});
        }
    }
};

}  // namespace

FilterPtr makeDropNames(DocumentHandler& next) {
    return std::make_unique<DropNames>(next);
}

}  // namespace rtsg::detail
