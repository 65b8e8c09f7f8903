// Finds entries in the catalogue's bytes, which are type descriptions one after the other.
#include "catalogue.h"

#include <algorithm>
#include <vector>

#include <rtsg/core/never_destroyed.h>

#include "columns/wire.h"

namespace rtsg::wire {

/// The build makes the source of these from sync/catalogue.bin and sync/words.bin.
std::span<const unsigned char> catalogueBytes();
std::span<const unsigned char> wordsBytes();

namespace {

using Entries = std::vector<std::span<const std::byte>>;

const Entries& catalogueEntries() {
    static const Entries& entries = neverDestroyed([] {
        Entries result;
        for (Reader in(std::as_bytes(catalogueBytes())); in.left() && !in.problem;) {
            const std::byte* start = in.at;
            (void)in.part(in.count(1));
            result.emplace_back(start, in.at);
        }
        return result;
    });
    return entries;
}

}  // namespace

std::size_t catalogueSize() {
    return catalogueEntries().size();
}

std::unique_ptr<NodeType> catalogueType(std::size_t number) {
    if (number >= catalogueSize()) return nullptr;
    Reader in(catalogueEntries()[number]);
    return readType(in);
}

std::span<const std::byte> sceneWords() {
    return std::as_bytes(wordsBytes());
}

std::optional<std::uint16_t> catalogueNumber(const NodeType& type) {
    ByteBuffer bytes;
    putType(bytes, type);
    const Entries& entries = catalogueEntries();
    for (std::size_t i = entries.size(); i-- > 0;)
        if (std::ranges::equal(entries[i], bytes.bytes())) return static_cast<std::uint16_t>(i);
    return std::nullopt;
}

ByteBuffer catalogueWith(TypeTable types) {
    ByteBuffer result;
    result.append(std::as_bytes(catalogueBytes()));
    for (const auto& type : types)
        if (!catalogueNumber(*type)) putType(result, *type);
    return result;
}

}  // namespace rtsg::wire
