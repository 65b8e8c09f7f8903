// Allocates and frees the shared blocks behind MF values, padded at the end for vector loads.
#include <rtsg/core/array.h>

#include <cstdlib>
#include <limits>

namespace rtsg::detail {

ArrayHeader* allocateArray(std::size_t elementSize, std::uint64_t capacity) {
    constexpr std::uint64_t maximum = std::numeric_limits<std::size_t>::max() - sizeof(ArrayHeader) - kArrayPadding;
    if (elementSize != 0 && capacity > maximum / elementSize) throw std::bad_alloc();
    // calloc: the bytes behind the last element must be zero, and large blocks come zeroed from the system anyway.
    void* memory = std::calloc(1, sizeof(ArrayHeader) + elementSize * capacity + kArrayPadding);
    if (!memory) throw std::bad_alloc();
    auto* header = new (memory) ArrayHeader;
    header->elementSize = static_cast<std::uint32_t>(elementSize);
    header->capacity = capacity;
    return header;
}

void destroyArray(ArrayHeader* header) noexcept {
    if (header->destroyElements) header->destroyElements(header + 1, header->size);
    header->~ArrayHeader();
    std::free(header);
}

}  // namespace rtsg::detail
