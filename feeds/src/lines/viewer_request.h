// ViewerRequest: what a live viewer asks for, in the protocol of Foxglove.
//
// Threading: values. Source: the WebSocket protocol foxglove.websocket.v1 (github.com/foxglove/ws-protocol).
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::feeds {

struct ViewerRequest {
    std::string op;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> subscriptions;  // their numbers, and channels
    std::vector<std::uint32_t> ended;
};

/// Errors: no JSON; a message without an `op`; numbers of subscriptions or channels that are none.
Result<ViewerRequest> readViewerRequest(std::string text);

}  // namespace rtsg::feeds
