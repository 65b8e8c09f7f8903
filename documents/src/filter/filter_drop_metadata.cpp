// Leaves out metadata nodes, WorldInfo and META.
#include "filter_drop_nodes.h"

namespace rtsg::detail {

namespace {

class DropMetadata final : public DropNodes {
  public:
    using DropNodes::DropNodes;
    void meta(std::string_view, std::string_view, SourceLocation) override {}
    bool drops(std::string_view type) const override {
        if (type == "WorldInfo") return true;
        const NodeType* known = findBuiltinType(type);
        return known && known->isA("X3DMetadataObject");
    }
};

}  // namespace

std::unique_ptr<DocumentHandler> makeDropMetadata(DocumentHandler& next) {
    return std::make_unique<DropMetadata>(next);
}

}  // namespace rtsg::detail
