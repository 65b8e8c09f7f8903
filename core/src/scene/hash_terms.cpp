// Computes the hashes that terms are made of.
#include <rtsg/core/hash_terms.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace rtsg {

namespace {

const detail::ArrayHeader* headerAt(const void* storage) {
    const detail::ArrayHeader* header = nullptr;
    std::memcpy(&header, storage, sizeof(header));
    return header;
}

}  // namespace

FieldKey fieldKey(const FieldDef& field) {
    // A hidden field's name counts with the zero behind it, since a public field may have the same name.
    return XXH3_64bits(field.name.c_str(), field.name.size() + (field.hidden ? 1 : 0));
}

std::uint64_t hashOfText(std::string_view text) {
    return XXH3_64bits(text.data(), text.size());
}

Hash128 hashOfBytes(const void* bytes, std::size_t size, std::uint64_t seedValue) {
    const XXH128_hash_t hash = XXH3_128bits_withSeed(bytes, size, seedValue);
    return {hash.low64, hash.high64};
}

Hash128 hashOfValue(FieldType type, const void* storage, std::uint64_t seedValue) {
    const FieldTypeInfo& i = info(type);
    if (!i.shared) return hashOfBytes(storage, i.size, seedValue);
    const detail::ArrayHeader* header = headerAt(storage);
    const std::uint64_t size = header ? header->size : 0;
    if (type != FieldType::MFString && type != FieldType::MFImage && type != FieldType::MFCustom)
        return hashOfBytes(header + 1, header ? size * header->elementSize : 0, seedValue);
    // Elements are pointers: hash each element's length and bytes in turn.
    XXH3_state_t state;
    XXH3_INITSTATE(&state);
    XXH3_128bits_reset_withSeed(&state, seedValue);
    const auto* elements = reinterpret_cast<const detail::ArrayHeader* const*>(header + 1);
    for (std::uint64_t k = 0; k < size; ++k) {
        const std::uint64_t bytes = elements[k] ? elements[k]->size * elements[k]->elementSize : 0;
        XXH3_128bits_update(&state, &bytes, sizeof(bytes));
        if (bytes) XXH3_128bits_update(&state, elements[k] + 1, bytes);
    }
    const XXH128_hash_t hash = XXH3_128bits_digest(&state);
    return {hash.low64, hash.high64};
}

}  // namespace rtsg
