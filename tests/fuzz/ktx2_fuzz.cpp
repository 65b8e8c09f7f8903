// KTX2 files of any kind: no crash, no hang, no memory for pixels that are refused, and a picture of the size it says.
#include <cstdint>
#include <string>
#include <vector>

#include "ktx2.h"
#include "reading.h"

namespace {

/// Blocks of the size that the head says, each texel as their first bytes.
std::string blocksOf(std::span<const std::uint8_t> dds, rtsg::FilePixels& out) {
    const auto word = [&](std::size_t at) { return dds[at] | dds[at + 1] << 8 | dds[at + 2] << 16; };
    out.height = word(12), out.width = word(16), out.channels = 4;
    const auto count = static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height) * 4;
    const bool floats = dds[84] == 'D' && dds[85] == 'X' && dds[86] == '1' && (dds[128] == 95 || dds[128] == 96);
    if (floats)
        out.values.assign(count, static_cast<float>(dds.back()));
    else
        out.bytes.assign(count, dds.back());
    return {};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    constexpr int maximum = 1 << 16;
    for (const bool asData : {false, true}) {
        rtsg::ReadRequest request{
            .bottomRowFirst = asData, .layers = true, .straight = true, .data = asData, .check = {}};
        request.check = [](int width, int height, int layers, bool) {
            return width > maximum || height > maximum / width || layers > maximum / width / height ? "too many"
                                                                                                    : std::string();
        };
        rtsg::FilePixels pixels;
        const std::string error = rtsg::readKtx2({data, size}, request, blocksOf, pixels);
        rtsg::Diagnostics none;
        const auto numbers = static_cast<std::size_t>(pixels.width) * static_cast<std::size_t>(pixels.height) *
                             static_cast<std::size_t>(pixels.layers) * static_cast<std::size_t>(pixels.channels);
        rtsg::fuzz::require(!error.empty() || (numbers > 0 && pixels.bytes.size() + pixels.values.size() == numbers),
                            "not the size that it says", "", none);
    }
    return 0;
}
