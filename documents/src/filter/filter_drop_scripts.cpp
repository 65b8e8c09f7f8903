// Leaves out Scripts and the routes to and from them.
#include "filter_drop_nodes.h"

namespace rtsg::detail {

namespace {

class DropScripts final : public DropNodes {
  public:
    using DropNodes::DropNodes;
    bool drops(std::string_view type) const override { return type == "Script"; }
};

}  // namespace

std::unique_ptr<DocumentHandler> makeDropScripts(DocumentHandler& next) {
    return std::make_unique<DropScripts>(next);
}

}  // namespace rtsg::detail
