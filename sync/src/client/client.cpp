// The public functions of a mirror's client; client_connection.cpp and client_replica.cpp do the work.
#include <rtsg/sync/mirror_client.h>

#include <fmt/format.h>

#include "client_impl.h"
#include "edits/upstream.h"

namespace rtsg {

MirrorClient::MirrorClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MirrorClient::~MirrorClient() = default;

Result<std::unique_ptr<MirrorClient>> MirrorClient::connect(Scene& replica, const std::string& endpoint,
                                                            MirrorClientOptions options) {
    if (!options.transport) options.transport = zmqTransport();
    if (const Result<bool> local = options.transport->isLocal(endpoint); !local) return std::unexpected(local.error());
    if (options.keys)
        if (auto ok = options.keys->checkForClient(); !ok) return std::unexpected(ok.error());
    if (options.parts.size() > mirror::kMaxParts)
        return fail(fmt::format("{} parts: a hello names {} at most", options.parts.size(), mirror::kMaxParts), {},
                    endpoint);
    if (options.name.size() > mirror::kLongestName)
        return fail(fmt::format("a name of {} bytes, the most is {}", options.name.size(), mirror::kLongestName), {},
                    endpoint);
    if (!replica.isOwnThread())
        return std::unexpected(Diagnostic{Severity::error, endpoint, {}, "the replica belongs to another thread"});
    replica.setBehavioursEnabled(false);
    auto impl = std::make_unique<Impl>(replica, std::move(options));
    if (auto ok = impl->start(endpoint); !ok) return std::unexpected(ok.error());
    return std::unique_ptr<MirrorClient>(new MirrorClient(std::move(impl)));
}

std::size_t MirrorClient::poll(std::chrono::milliseconds timeout) {
    if (impl_->replica_.isOwnThread()) return impl_->poll(timeout);
    impl_->refuseThread();
    (void)impl_->clock().wait({}, timeout);
    return 0;
}
void MirrorClient::onStep(std::function<void(const RecordStep&)> heard) {
    impl_->onStep(std::move(heard));
}
MirrorClient::Waiting MirrorClient::waiting() const {
    return impl_->waiting();
}
void MirrorClient::wakeBy(int descriptor) {
    impl_->wakeBy(descriptor);
}
bool MirrorClient::inStep() const {
    return impl_->inStep();
}
bool MirrorClient::receiving() const {
    return impl_->receiving();
}
const MirrorStatistics& MirrorClient::statistics() const {
    return impl_->statistics_;
}
std::vector<Diagnostic> MirrorClient::takeDiagnostics() {
    std::vector<Diagnostic> result = std::exchange(impl_->diagnostics_, {});
    if (std::optional<Diagnostic> refused = impl_->takeRefusedPolls()) result.push_back(std::move(*refused));
    return result;
}
bool MirrorClient::turnedAway() const {
    return impl_->turnedAway_;
}
bool MirrorClient::originLost() const {
    return impl_->originLost();
}
bool MirrorClient::serverLeft() const {
    return impl_->serverLeft_;
}
const std::string& MirrorClient::refusal() const {
    return impl_->refusal_;
}

Result<std::uint64_t> MirrorClient::submit(std::vector<Change> changes) {
    MirrorRequest request;
    request.changes = std::move(changes);
    return impl_->submit(std::move(request));
}

Result<std::uint64_t> MirrorClient::submit(MirrorRequest request) {
    return impl_->submit(std::move(request));
}

Result<std::uint64_t> MirrorClient::undo() {
    return impl_->submit({.kind = MirrorRequest::Kind::undo, .changes = {}, .nodes = {}});
}

Result<std::uint64_t> MirrorClient::redo() {
    return impl_->submit({.kind = MirrorRequest::Kind::redo, .changes = {}, .nodes = {}});
}

Result<std::uint64_t> MirrorClient::lock(std::vector<NodeId> nodes, std::chrono::milliseconds lease) {
    return impl_->submit({.kind = MirrorRequest::Kind::lock, .changes = {}, .nodes = std::move(nodes), .lease = lease});
}

Result<std::uint64_t> MirrorClient::submitEvent(NodeId node, FieldIndex field, Value value) {
    Change change;
    change.kind = ChangeKind::event;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return submit({std::move(change)});
}

Result<std::uint64_t> MirrorClient::submitEdit(NodeId node, FieldIndex field, Value value) {
    Change change;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return submit({std::move(change)});
}

NodeId MirrorClient::newNode() {
    return NodeId{mirror::kFirstProvisional + impl_->nextProvisional_++ % mirror::kFirstProvisional};
}
std::vector<MirrorVerdict> MirrorClient::takeVerdicts() {
    return std::exchange(impl_->verdicts_, {});
}
bool MirrorClient::control(std::string_view command) {
    return impl_->control(command);
}
std::vector<std::string> MirrorClient::takeReplies() {
    return std::exchange(impl_->replies_, {});
}
std::size_t MirrorClient::unanswered() const {
    return impl_->requests_.size();
}
Value MirrorClient::presented(NodeId node, FieldIndex field) const {
    return impl_->presented(node, field);
}

}  // namespace rtsg
