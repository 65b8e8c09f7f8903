// Turns PDUs for the nodes of the DIS component into inputs of a frame. So they are recorded, mirrored and replayed
// like all other inputs, and only the scene that listens needs a network.
//
// Invariant: a node's reaction to a PDU follows from the PDU, the node's fields and the scene's clock alone. Threading:
// the scene's thread. Source: ISO/IEC 19775-1 V4.0, clause 28.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// For an EspduTransform, ReceiverPdu, SignalPdu or TransmitterPdu.
struct HeardPdu {
    NodeId node;
    bool hadRtpHeader = false;
    std::vector<std::uint8_t> bytes;  // one PDU, without the RTP header

    static Array<std::int32_t> toValue(std::span<const HeardPdu> pdus);
    /// Error: values that toValue() does not make.
    static Result<std::vector<HeardPdu>> fromValue(const Array<std::int32_t>& value);
};

/// Packs four bytes into each number, the first byte highest; unused bytes are 0.
Array<std::int32_t> wordsOf(std::span<const std::uint8_t> bytes);
std::vector<std::uint8_t> bytesOf(std::span<const std::int32_t> words);

/// Queues PDUs for the next frame. Nodes that are no networkReader, not enabled or of another entity ignore them; all
/// nodes ignore bytes that are no PDU, with a warning. Errors: as for Scene::sendEvent().
Result<> hear(Scene& scene, std::span<const HeardPdu> pdus);

}  // namespace rtsg
