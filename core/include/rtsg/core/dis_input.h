// Turns PDUs that the nodes of the DIS component hear into inputs of a frame. So they are recorded, mirrored and
// replayed like all other inputs, and only the scene that listens needs a network.
//
// Invariant: what a node does about a PDU follows from the PDU, its fields and the scene's clock alone. Threading: the
// scene's thread. Source: ISO/IEC 19775-1 V4.0, clause 28.
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
    std::vector<std::uint8_t> bytes;  // a PDU, without that header

    static Array<std::int32_t> toValue(std::span<const HeardPdu> pdus);
    /// Error: not what toValue() makes.
    static Result<std::vector<HeardPdu>> fromValue(const Array<std::int32_t>& value);
};

/// Four bytes a number, the first one the highest; what is left over is 0.
Array<std::int32_t> wordsOf(std::span<const std::uint8_t> bytes);
std::vector<std::uint8_t> bytesOf(std::span<const std::int32_t> words);

/// For the next frame. Nodes that are no networkReader, not enabled or of another entity leave it alone, and so do all
/// what is no PDU, with a warning. Errors: as Scene::sendEvent().
Result<> hear(Scene& scene, std::span<const HeardPdu> pdus);

}  // namespace rtsg
