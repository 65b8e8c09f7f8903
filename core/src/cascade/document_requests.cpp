// Keeps what scripts ask for between two frames in a hidden field of the root until the next frame begins, so that a
// scene that takes over from a snapshot does it, too.
#include <charconv>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "state/state.h"

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

/// Between two frames. Reading them is in nobody's time.
constexpr std::size_t kMaxRequests = 64;

void append(Array<String>& out, std::uint64_t number) {
    out.push_back(String(std::to_string(number)));
}

/// Appends a request as strings: its numbers, and each list after its length.
void append(Array<String>& out, const DocumentRequest& request) {
    append(out, static_cast<std::uint64_t>(request.kind));
    append(out, request.script.value);
    append(out, request.target.value);
    append(out, request.field);
    append(out, request.urls.size());
    for (const std::string& url : request.urls) out.push_back(String(url));
    append(out, request.nodes.size());
    for (const NodeId node : request.nodes) append(out, node.value);
    append(out, request.names.size());
    for (const auto& [name, node] : request.names) {
        out.push_back(String(name));
        append(out, node.value);
    }
}

/// Reads requests that append() wrote; other content ends the reading early.
class RequestReader {
  public:
    explicit RequestReader(const Array<String>& words) : words_(words) {}
    bool atEnd() const { return at_ >= words_.size(); }
    std::string word() { return atEnd() ? std::string() : words_[at_++].str(); }
    std::uint32_t number() {
        const std::string text = word();
        std::uint32_t value = 0;
        std::from_chars(text.data(), text.data() + text.size(), value);
        return value;
    }
    NodeId node() { return NodeId{number()}; }

  private:
    const Array<String>& words_;
    std::size_t at_ = 0;
};

DocumentRequest nextRequest(RequestReader& in) {
    DocumentRequest request;
    request.kind = static_cast<DocumentRequest::Kind>(in.number() % 3);
    request.script = in.node();
    request.target = in.node();
    request.field = static_cast<FieldIndex>(in.number());
    for (std::uint32_t i = in.number(); i > 0 && !in.atEnd(); --i) request.urls.push_back(in.word());
    for (std::uint32_t i = in.number(); i > 0 && !in.atEnd(); --i) request.nodes.push_back(in.node());
    for (std::uint32_t i = in.number(); i > 0 && !in.atEnd(); --i) {
        std::string name = in.word();
        request.names.emplace_back(std::move(name), in.node());
    }
    return request;
}

}  // namespace

Result<> ScriptPrograms::request(Scene& scene, const DocumentRequest& request) {
    Array<String> waiting = scene.node(scene.root()).get(Root::_requests);
    std::size_t requests = 0;
    for (RequestReader in(waiting); !in.atEnd(); ++requests) (void)nextRequest(in);
    if (requests >= kMaxRequests) return fail(fmt::format("{} documents are asked for already", requests));
    append(waiting, request);
    return scene.set(scene.root(), Root::_requests, std::move(waiting));
}

/// Serves the requests that wait. New ones that come meanwhile wait for the next frame.
void Scene::State::serveRequests() {
    const Array<String> waiting = find(owner.root())->get(Root::_requests);
    if (waiting.empty() || !behavioursEnabled) return;
    if (auto ok = owner.set(owner.root(), Root::_requests, Array<String>()); !ok) return;
    for (RequestReader in(waiting); !in.atEnd();) {
        const DocumentRequest request = nextRequest(in);
        // A world that is loaded brings its own.
        const std::shared_ptr<const Resources> resources = scriptOptions.resources;
        const std::shared_ptr<const DocumentServices> services = documents;
        const auto serve = [&] { return services->serve(owner, request, resources.get()); };
        const bool isPiece = request.kind == DocumentRequest::Kind::piece;
        if (auto ok = isPiece ? createdByScript(serve) : serve(); !ok)
            diagnostics.warning({}, fmt::format("what a script asked for was not loaded: {}", ok.error().format()));
    }
}

}  // namespace rtsg
