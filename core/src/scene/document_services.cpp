// The answers of a scene that has no reader of documents.
#include <rtsg/core/document_services.h>

namespace rtsg {

namespace {

std::unexpected<Diagnostic> nobodyReads() {
    return fail("nobody reads documents for this scene: registerDocuments() was not called");
}

}  // namespace

Result<NodeId> DocumentServices::makePrototypeInstance(Scene&, TypeIndex, NodeId, const Resources*) const {
    return nobodyReads();
}

Result<> DocumentServices::declareAs(Scene&, TypeIndex, std::string_view, const Resources*) const {
    return nobodyReads();
}

Result<DocumentServices::Piece> DocumentServices::makePiece(Scene&, std::string_view, NodeId, const Resources*) const {
    return nobodyReads();
}

Result<DocumentServices::Piece> DocumentServices::makePieceOfUrls(Scene&, NodeId, const std::vector<std::string>&,
                                                                  const Resources*) const {
    return nobodyReads();
}

Result<> DocumentServices::serve(Scene&, const DocumentRequest&, const Resources*) const {
    return nobodyReads();
}

std::string DocumentServices::nodeText(const Scene&, NodeId, TextForm) const {
    return {};
}

std::vector<DocumentServices::ProfileParts> DocumentServices::profiles() const {
    return {};
}

std::string_view DocumentServices::nameNow(const NodeType&, std::string_view) const {
    return {};
}

NodeId DocumentServices::localNode(const Scene& scene, NodeId scope, std::string_view name) const {
    return scene.findName(name, scope);
}

}  // namespace rtsg
