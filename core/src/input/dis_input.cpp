// PDUs as the value of an event of the scene's root: for each its node, whether there was an RTP header, its length in
// numbers of four bytes, and these numbers.
#include <rtsg/core/dis_input.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

Array<std::int32_t> wordsOf(std::span<const std::uint8_t> bytes) {
    auto words = Array<std::int32_t>::ofSize((bytes.size() + 3) / 4);
    std::int32_t* out = words.mutableData();
    for (std::size_t i = 0; i < bytes.size(); i += 4) {
        std::uint32_t word = 0;
        for (std::size_t k = 0; k < 4; ++k) word = word << 8 | (i + k < bytes.size() ? bytes[i + k] : 0u);
        *out++ = static_cast<std::int32_t>(word);
    }
    return words;
}

std::vector<std::uint8_t> bytesOf(std::span<const std::int32_t> words) {
    std::vector<std::uint8_t> bytes;
    bytes.reserve(4 * words.size());
    for (const std::int32_t word : words)
        for (int shift = 24; shift >= 0; shift -= 8)
            bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint32_t>(word) >> shift));
    return bytes;
}

Array<std::int32_t> HeardPdu::toValue(std::span<const HeardPdu> pdus) {
    std::vector<std::int32_t> rows;
    for (const HeardPdu& pdu : pdus) {
        const Array<std::int32_t> words = wordsOf(pdu.bytes);
        rows.push_back(static_cast<std::int32_t>(pdu.node.value));
        rows.push_back(pdu.hadRtpHeader ? 1 : 0);
        rows.push_back(static_cast<std::int32_t>(words.size()));
        rows.insert(rows.end(), words.begin(), words.end());
    }
    return Array<std::int32_t>(std::span<const std::int32_t>(rows));
}

Result<std::vector<HeardPdu>> HeardPdu::fromValue(const Array<std::int32_t>& value) {
    constexpr std::size_t kHead = 3;
    std::vector<HeardPdu> pdus;
    for (std::size_t at = 0; at < value.size();) {
        if (value.size() - at < kHead) return fail("ends within the head of a PDU");
        const std::int32_t node = value[at], length = value[at + 2];
        if (node <= 0 || length < 0 || value.size() - at - kHead < static_cast<std::size_t>(length))
            return fail("ends within a PDU");
        const std::span words(value.data() + at + kHead, static_cast<std::size_t>(length));
        pdus.push_back({NodeId{static_cast<std::uint32_t>(node)}, value[at + 1] != 0, bytesOf(words)});
        at += kHead + words.size();
    }
    return pdus;
}

Result<> hear(Scene& scene, std::span<const HeardPdu> pdus) {
    if (pdus.empty()) return {};
    return scene.sendEvent(scene.root(), x3d::RtsgScene::heard.index, Value(HeardPdu::toValue(pdus)));
}

}  // namespace rtsg
