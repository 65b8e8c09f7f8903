// Nodes of fetched files: making them, and reading them elsewhere.
#include <rtsg/fetch/fetched_files.h>

#include <cstring>
#include <optional>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

using F = x3d::FetchedFile;

/// How many bytes there are, then these, four to a number.
Array<std::int32_t> packed(std::string_view bytes) {
    std::vector<std::int32_t> numbers(1 + (bytes.size() + 3) / 4);
    numbers[0] = static_cast<std::int32_t>(bytes.size());
    if (!bytes.empty()) std::memcpy(&numbers[1], bytes.data(), bytes.size());
    return Array<std::int32_t>(std::span<const std::int32_t>(numbers));
}

std::optional<std::string> unpacked(const Array<std::int32_t>& numbers) {
    if (numbers.empty() || numbers[0] < 0) return std::nullopt;
    const auto size = static_cast<std::size_t>(numbers[0]);
    if (numbers.size() != 1 + (size + 3) / 4) return std::nullopt;
    std::string bytes(size, '\0');
    if (size > 0) std::memcpy(bytes.data(), numbers.data() + 1, size);
    return bytes;
}

FetchedFile fileOf(const Node& node) {
    FetchedFile file{node.get(F::_address).str(),
                     node.get(F::_source).str(),
                     node.get(F::_mediaType).str(),
                     node.get(F::_hash).str(),
                     {}};
    if (auto bytes = unpacked(node.get(F::_bytes))) {
        file.bytes = std::move(*bytes);
        file.hasBytes = true;
    }
    return file;
}

bool make(Scene& scene, const FetchedFile& file) {
    const NodeId created = scene.createNode(F::type);
    const bool withBytes = file.hasBytes && file.bytes.size() <= FetchedFiles::kMaxBytes;
    return scene.set(created, F::_address, String(file.address)).has_value() &&
           scene.set(created, F::_source, String(file.source)).has_value() &&
           scene.set(created, F::_mediaType, String(file.mediaType)).has_value() &&
           scene.set(created, F::_hash, String(file.hash)).has_value() &&
           (!withBytes || scene.set(created, F::_bytes, packed(file.bytes)).has_value());
}

}  // namespace

std::size_t FetchedFiles::publish(Scene& scene) {
    std::vector<FetchedFile> files;
    published_ =
        fetcher_.forEachFetched(published_, withBytes_, [&](FetchedFile file) { files.push_back(std::move(file)); });
    if (files.empty()) return 0;
    std::set<std::string> there;
    scene.forEachNode([&](const Node& node) {
        if (node.is(F::type)) there.insert(node.get(F::_address).str());
    });
    std::size_t count = 0;
    for (const FetchedFile& file : files)
        if (!there.contains(file.address) && make(scene, file)) ++count;
    return count;
}

void keepFetchedFiles(const Scene& scene, WebFetcher& fetcher) {
    scene.forEachNode([&](const Node& node) {
        if (node.is(F::type)) (void)fetcher.keep(fileOf(node));
    });
}

Result<> FetchedFilesFollower::apply(const Scene& scene, const ChangeSet& set) {
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::createNode) continue;
        const Node* node = scene.find(change.node);
        if (node && node->is(F::type)) (void)fetcher_.keep(fileOf(*node));
    }
    return {};
}

}  // namespace rtsg
